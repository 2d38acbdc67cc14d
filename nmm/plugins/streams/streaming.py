"""nmm.stream: a loop or a trajectory, live in another tool or in a file for it."""

from __future__ import annotations

import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

from nmm.base.arrays import positive, scalar
from nmm.base.errors import NmmError, expect, expect_kind, expect_known
from nmm.base.files import UnwrittenError, replaceable, whole_file, written_at
from nmm.motion.trajectory import Trajectory
from nmm.plugins.robot.robot_loop import Loop
from nmm.plugins.streams.addresses import addresses
from nmm.plugins.streams.clock import RunClock, WallClock
from nmm.plugins.streams.loop_stream import LoopStream
from nmm.plugins.streams.pictures import Said
from nmm.plugins.streams.replay import Replay, about, scene_of, thinned
from nmm.plugins.streams.sending import Sending, SendingEnded
from nmm.plugins.streams.shown import Stream
from nmm.plugins.streams.sinks import Destination
from nmm.plugins.streams.tools import PORTS, SUFFIXES, expect_installed

#: Samples shown each second unless told otherwise, Hz.
RATE = 60.0
#: Pictures that are written together.
TOGETHER = 256


def stream(
    what: Loop | Trajectory,
    to: str,
    *,
    file: str | Path | None = None,
    port: int | None = None,
    rate: float | None = None,
    start: float | None = None,
    stop: threading.Event | None = None,
    localised: bool = False,
) -> Stream:
    """Show a loop or a trajectory in Rerun or Foxglove, live or in a file: the robot's URDF, every link's
    transform, paths, targets, nearest points, inputs, task error, joints, odometry, events and findings
    (docs/ros.md has a table).

    A loop's stream is a context manager, and is called with the loop after each step, as `Loop.run` does
    with `each`. The call takes some µs, raises nothing and waits for nobody: a process of the stream's own
    sends; what it does not take in time is dropped, and counted. A trajectory is sent at once: into a file as
    it is, live in its own time, until its end, Ctrl-C or `stop`.

    Parameters
    ----------
    what : the loop, or the trajectory
    to : "rerun" (a viewer that runs on this machine, as `rerun --bind 127.0.0.1` starts it) or "foxglove" (a
        WebSocket server on 127.0.0.1, to which Foxglove connects; a trajectory waits for it)
    file : where to write (.rrd, .mcap) in place of that; a file that is there is replaced when the new one is
        whole
    port : of the viewer (9876), or of the server (8765; 0 for a free one)
    rate : samples that are shown each second at most, Hz; 60 unless given, all of a trajectory in a file
    start : the clock's time at t = 0 in a file, s since 1970; 0 for a trajectory; unless given, stamps of a
        loop are the clock's
    stop : ends a live trajectory when set (by another thread)
    localised : whether the loop is given a `PoseFilter`: then all stands in map, odometry is where no fix has
        moved it, and the filter's correction is the transform from map to odom

    Raises
    ------
    InputError : no such tool, or its package is missing; another suffix; a place that cannot be written; the
        port is taken; no viewer runs; a trajectory without samples
    RunError : a file could not be written whole; what was there before stays

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 2})
    >>> nmm.stream(scenario.run(), "foxglove", file="run.mcap").sent
    401

    Of a loop; with `loop.run`, `each=shown` calls it:

    >>> robot, loop = scenario.robot(), nmm.Loop(scenario.controller(), period=0.01)
    >>> q = robot.q({"x": -1, "y": -1, "theta": 3.14})
    >>> with nmm.stream(loop, "foxglove", port=0) as shown:
    ...     for k in range(5):
    ...         q = q + 0.01 * robot.S(q) @ loop.step(0.01 * k, q)
    ...         shown(loop)
    >>> shown.address, shown.sent
    ('ws://127.0.0.1:...', ...)
    """
    expect_known("tool", to, PORTS, "stream")
    expect_kind(what, Loop | Trajectory, "stream", "a Loop or a Trajectory")
    if file is not None:
        file = Path(file)
        expect(file.suffix == SUFFIXES[to], file, f"a file that ends in {SUFFIXES[to]}")
        expect(port is None, "port", "a file or a port")
        replaceable(file)
    else:
        expect(start is None, "start", "a file: live, times are the clock's", start)
    if port is not None:
        port = int(scalar(port, "port", least=0.0))
        expect(port <= 65535, "port", "a port, up to 65535", port)
    expect_kind(localised, bool, "localised", "True or False")
    if rate is not None:
        rate = positive(rate, "rate")
    if start is not None:
        start = scalar(start, "start", least=0.0)
    expect_installed(to)
    port = PORTS[to] if port is None else port
    if isinstance(what, Loop):
        return LoopStream(what, to, file, port, rate or RATE, start, localised)
    expect(not localised, "localised", "a loop: a trajectory says it itself", localised)
    expect(len(what), "stream", "a run with at least one sample")
    if file is not None:
        return written(what, to, file, rate, start or 0.0)
    return played(what, to, port, rate or RATE, stop)


def written(run: Trajectory, tool: str, file: Path, rate: float | None, start: float) -> Stream:
    """Write a trajectory for a tool."""
    made, begin = Stream(tool, file), round(1e9 * start)

    def stamp(t: float) -> int:
        return begin + round(1e9 * t)

    expect(stamp(float(run.t[0])) >= 0, "start", "a time at which no sample is before 1970", start)
    scene = scene_of(run, stamp(float(run.t[0])), addresses(tool, live=False)[0])
    with written_at(file), whole_file(file) as temporary:
        try:
            sink, _ = Destination(tool, temporary).open(scene.still)
            try:
                batch: list[Any] = []
                for item in Replay(run, scene, stamp).items(thinned(run.t, rate)):
                    batch.append(item)
                    if len(batch) == TOGETHER:
                        sink.take(batch)
                        batch = []
                sink.take(batch)
            finally:
                sink.close(about(run))
        except NmmError:
            raise
        except RuntimeError as error:  # as the packages tell it
            raise UnwrittenError(f"cannot be written: {error}", where=temporary) from None
    made.sent = len(thinned(run.t, rate))
    return made


def played(run: Trajectory, tool: str, port: int, rate: float, stop: threading.Event | None) -> Stream:
    """Show a trajectory in its own time."""
    made, wall = Stream(tool), WallClock()
    address, assets = addresses(tool, live=True)
    scene = scene_of(run, wall.began, address)
    ended = threading.Event() if stop is None else stop
    sending = Sending(Destination(tool, None, port, assets), scene.still, ends=True)
    made.address = sending.address
    try:
        print(f"Streaming to {tool} at {made.address} (Ctrl-C ends it)", flush=True)
        with suppress(KeyboardInterrupt):
            while not sending.came.wait(0.1) and not ended.is_set() and not sending.ended:
                pass
            clock = RunClock(wall, float(run.t[0]))
            for item in Replay(run, scene, clock.stamp).items(thinned(run.t, rate)):
                if ended.wait(clock.wait(item.t)):
                    break
                clock.late(item.t)
                sending.send(item)
                made.sent += not isinstance(item, Said)
    except SendingEnded as error:
        made.trouble = str(error)
    finally:
        sending.close(about(run))
    return made
