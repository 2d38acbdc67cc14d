"""Live streams by real clients: Foxglove's protocol over a WebSocket, Rerun's program without a window."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop_faults import PERIOD, make_loop
from ports import MOST, free_port, listening, wait_for
from streamed import FoxgloveClient, by_rerun, frames_of_foxglove, links_are_where_they_are, rerun_viewer

import nmm
from nmm.plugins.streams.run_stream import RunStream
from nmm.plugins.streams.sending import Sending

pytest.importorskip("foxglove")
pytest.importorskip("mcap_protobuf")


class Driven:
    """A robot that does as its loop says, a step at a time, with a stream beside."""

    def __init__(self, loop: nmm.Loop | None = None) -> None:
        self.loop = make_loop() if loop is None else loop
        self.robot = self.loop.controller.robot
        self.q, self.k = self.robot.q({"q1": 0.1, "q2": 0.5}), 0

    def step(self, shown: Any = None) -> None:
        u = self.loop.step(self.k * PERIOD, self.q)
        self.q = self.q + PERIOD * self.robot.S(self.q) @ u
        self.k += 1
        if shown is not None:
            shown(self.loop)

    def until(self, condition: Callable[[], bool], shown: Any) -> None:
        """Drive on until it holds."""
        end = time.monotonic() + MOST
        while not condition():
            assert time.monotonic() < end, "drove in vain"
            self.step(shown)
            time.sleep(0.002)


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A viewer on a busy machine may take its time for what is left."""
    monkeypatch.setattr("nmm.plugins.streams.sinks.PATIENCE", MOST)


def is_whole(file: Path) -> bool:
    """Whether a viewer has written what is said in the end."""
    try:
        return "/__properties/nmm" in by_rerun(file)
    except Exception:  # it is being written
        return False


def port_of(shown: Any) -> int:
    return int(shown.address.rpartition(":")[2].partition("/")[0])


def test_foxglove_sees_a_loop_as_it_runs(patient: None) -> None:
    driven = Driven()
    with nmm.stream(driven.loop, "foxglove", port=0) as shown:
        port = port_of(shown)
        assert listening()[port] == "0100007F"  # 127.0.0.1 alone
        client = FoxgloveClient(shown.address)
        driven.until(lambda: len(client.of("/tf")) > 20 and len(client.of("/paths")) > 5, shown)
        driven.until(lambda: any(one[2].message == "running" for one in client.of("/log")), shown)
        assert client.of("/robot_description")[0][2]["data"].startswith("<robot")
        late = FoxgloveClient(shown.address)  # who comes later has missed nothing that is said once
        driven.until(lambda: len(late.of("/robot_description")) == 1 and len(late.of("/tf")) > 2, shown)
    wait_for(lambda: client.gone and late.gone)
    assert port not in listening()
    assert {name for name, _ in client.topics.values()} >= {"/tf", "/inputs", "/error", "/odom", "/log"}
    for topic in ("/tf", "/inputs", "/odom", "/paths"):
        stamps = [stamp for _, stamp, _, _ in client.of(topic)]
        assert stamps == sorted(stamps)
    assert all(stamp <= came for _, stamp, _, came in client.messages)  # none is of the future
    assert shown.trouble == ""
    found = {topic: [(one[1], one[2]) for one in client.of(topic)] for topic in ("/tf", "/tf_static")}
    frames, q = frames_of_foxglove(found, -1), driven.loop.q  # the last picture is of where it is in the end
    links_are_where_they_are(driven.robot, q, frames, "odom", 1e-9)


def test_foxglove_is_given_meshes_that_the_robot_has_and_no_others(tmp_path: Path) -> None:
    from nmm.plugins.streams.addresses import addresses

    address, files = addresses("foxglove", live=True)
    assert address is not None
    mesh = tmp_path / "größe 1#.STL"
    assert address(str(mesh)) == address(str(mesh)) == "package://nmm/0.stl"
    assert files == {"package://nmm/0.stl": str(mesh)}


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_rerun_sees_a_loop_as_it_runs(patient: None, tmp_path: Path) -> None:
    driven, file = Driven(), tmp_path / "seen.rrd"
    with rerun_viewer(file) as (port, _):
        with nmm.stream(driven.loop, "rerun", port=port) as shown:
            driven.until(lambda: shown.sent > 20, shown)
        wait_for(lambda: is_whole(file))
    found = by_rerun(file)
    frames = [one for one in found if one.startswith("/world/frames/")]
    moved = [one for one in frames if "t" in found[one]]
    assert {len(found[one]["t"]) for one in moved} == {shown.sent}
    np.testing.assert_allclose(
        [row[0] for row in found["/inputs/v"]["Scalars:scalars"]][-1], driven.loop.u[0], atol=1e-12
    )
    assert max(found["/inputs/v"]["time"]) <= time.time_ns()
    assert found["/__properties/nmm"]["complete"] == [["yes"]]


def test_a_viewer_that_goes_away_holds_up_nothing(tmp_path: Path) -> None:
    """Rerun's package waits for it without end: the stream's process is ended, the loop's goes on."""
    driven = Driven()
    with rerun_viewer(tmp_path / "seen.rrd") as (port, viewer):
        with nmm.stream(driven.loop, "rerun", port=port, rate=1000.0) as shown:
            driven.until(lambda: shown.sent > 5, shown)
            viewer.kill()
            viewer.wait()
            for _ in range(2000):
                driven.step(shown)
        assert str(driven.loop.state) == "running"
    assert shown.dropped > 0
    assert not [one for one in threading.enumerate() if one.name.startswith("nmm stream")]


def test_a_process_that_takes_nothing_more_holds_up_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    driven = Driven()
    monkeypatch.setattr("nmm.plugins.streams.sinks.PATIENCE", 0.2)
    shown = nmm.stream(driven.loop, "foxglove", port=0, rate=1000.0)
    sender = shown._sending._process  # type: ignore[attr-defined]
    os.kill(sender.pid, signal.SIGSTOP)
    driven.until(lambda: not select.select([], [sender.stdin], [], 0.0)[1], shown)  # no more goes in
    for _ in range(500):  # a call that waited for whoever takes it would not return
        driven.step(shown)
    assert shown.dropped > 10
    assert shown._waiting.qsize() <= 120  # type: ignore[attr-defined]
    shown.close()
    assert sender.poll() is not None
    assert port_of(shown) not in listening()
    shown.close()


class Stopped(Sending):
    """A process that takes nothing from the start, though a viewer has come."""

    def __init__(self, *of: Any, **given: Any) -> None:
        super().__init__(*of, **given)
        os.kill(self._process.pid, signal.SIGSTOP)
        self.came.set()


@pytest.mark.parametrize("computed", [False, True])
def test_a_run_ends_though_nothing_is_taken(computed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rerun's package waits without end for a viewer that was closed."""
    monkeypatch.setattr("nmm.plugins.streams.sending.HELD", 0.5)
    monkeypatch.setattr("nmm.plugins.streams.streaming.Sending", Stopped)
    monkeypatch.setattr("nmm.plugins.streams.run_stream.Sending", Stopped)
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 1.0, "dt": 0.005})
    shown: nmm.Stream
    if computed:
        shown = nmm.stream(scenario.run(), "foxglove", port=0, rate=1000.0)
    else:
        controller, q0 = scenario.controller(), scenario.robot().q(scenario.parts.q0)
        with RunStream(controller, q0, "run", "foxglove", 0, 1000.0) as shown:
            shown.end(nmm.simulate(controller, q0, 1.0, 0.005, watch=shown.watch))
    assert "the viewer takes nothing more" in shown.trouble
    assert 0 < shown.sent < 201
    assert port_of(shown) not in listening()


def test_what_fails_beside_a_loop_is_told_and_ends_nothing() -> None:
    driven = Driven()
    with nmm.stream(driven.loop, "foxglove", port=0) as shown:
        driven.until(lambda: shown.sent > 0, shown)
        shown._sending._process.kill()  # type: ignore[attr-defined]
        driven.until(lambda: bool(shown.trouble), shown)
        for _ in range(100):
            driven.step(shown)
    assert "has ended" in shown.trouble
    assert str(driven.loop.state) in ("starting", "running")


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_the_server_is_gone_when_the_loop_fails(error: type[BaseException]) -> None:
    driven, shown = Driven(), nmm.stream(make_loop(), "foxglove", port=0)

    def fails() -> None:
        with shown:
            driven.step(shown)
            raise error

    with pytest.raises(error):
        fails()
    assert port_of(shown) not in listening()
    assert shown._sending._process.poll() is not None  # type: ignore[attr-defined]


@pytest.mark.parametrize("broken", [False, True])
def test_a_loop_is_recorded(broken: bool, tmp_path: Path) -> None:
    """Ctrl-C leaves what there was until then, marked so; a file that is there stays until that is whole."""
    from streamed import by_foxglove, said_of

    driven, file = Driven(), tmp_path / "loop.mcap"
    file.write_text("what was there")
    try:
        with nmm.stream(driven.loop, "foxglove", file=file, rate=1000.0, start=1000.0) as shown:
            for _ in range(60):
                driven.step(shown)
            assert file.read_text() == "what was there"
            if broken:
                raise KeyboardInterrupt
    except KeyboardInterrupt:
        assert broken
    found, said = by_foxglove(file), said_of(file)
    assert (said["complete"], said["why"]) == (("no", "KeyboardInterrupt") if broken else ("yes", ""))
    assert [*tmp_path.iterdir()] == [file]
    assert len(found["/tf"]) == shown.sent >= 60
    stamps = np.array([stamp for stamp, _ in found["/tf"]])
    np.testing.assert_allclose(1e-9 * stamps[:60], 1000.0 + PERIOD * np.arange(60), atol=1e-6)
    links_are_where_they_are(
        driven.robot, driven.loop.q, frames_of_foxglove(found, len(found["/tf"]) - 1), "odom", 1e-9
    )


@pytest.mark.parametrize("when", ["pictures are made", "they are written"])
def test_a_second_ctrl_c_leaves_what_there_was(
    when: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While a loop's recording is finished: what waits is dropped, and what was sent is in the file."""
    from streamed import by_foxglove, said_of

    from nmm.plugins.streams.robot_scene import RobotScene

    waiting = when == "pictures are made"
    go, picture = threading.Event(), RobotScene.picture

    def slow(scene: RobotScene, sample: Any) -> Any:
        assert not waiting or go.wait(MOST)
        return picture(scene, sample)

    monkeypatch.setattr(RobotScene, "picture", slow)
    driven, file = Driven(), tmp_path / "loop.mcap"
    file.write_text("what was there")
    shown: Any = nmm.stream(driven.loop, "foxglove", file=file, rate=1000.0)
    sender = shown._sending._process

    def again() -> None:
        wait_for(shown._ended.is_set if waiting else lambda: not shown._worker.is_alive())
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGINT)
        if waiting:
            wait_for(lambda: shown.dropped > 0)
            go.set()
        else:
            time.sleep(0.2)
            os.kill(sender.pid, signal.SIGCONT)

    second = threading.Thread(target=again)

    def drives() -> None:
        with shown:
            for _ in range(60):
                driven.step(shown)
            if not waiting:
                wait_for(lambda: shown.sent == 60)  # of all that comes a pipe holds the rest
                os.kill(sender.pid, signal.SIGSTOP)
            second.start()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        drives()
    second.join(MOST)
    said, found = said_of(file), by_foxglove(file)
    assert (said["complete"], said["why"]) == ("no", "KeyboardInterrupt")
    assert len(found["/tf"]) == shown.sent
    assert 0 < shown.sent < 10 if waiting else shown.sent >= 60
    assert (shown.dropped > 50) is waiting
    assert [*tmp_path.iterdir()] == [file]


def test_findings_of_a_loop_are_told(tmp_path: Path) -> None:
    from streamed import by_foxglove

    driven, file = Driven(), tmp_path / "loop.mcap"
    with nmm.stream(driven.loop, "foxglove", file=file) as shown:
        for _ in range(100):
            driven.step(shown)
        for _ in range(60):  # no measurement comes
            driven.k += 1
            driven.loop.step(driven.k * PERIOD)
            shown(driven.loop)
    told = [message.message for _, message in by_foxglove(file)["/log"]]
    for finding in driven.loop.findings:
        assert str(finding) in told
    assert [text for text in told if text in ("starting", "running", "stopping", "stopped")][-1] == "stopped"


def test_a_trajectory_is_played_in_its_own_time(patient: None, capsys: pytest.CaptureFixture[str]) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 3.0}).run()
    made: list[Any] = []
    port = free_port()
    playing = threading.Thread(target=lambda: made.append(nmm.stream(run, "foxglove", port=port)))
    playing.start()
    wait_for(lambda: port in listening())
    client = FoxgloveClient(f"ws://127.0.0.1:{port}")
    playing.join(MOST)
    (shown,) = made
    wait_for(lambda: client.gone)
    assert port not in listening()
    stamps = [stamp for _, stamp, _, _ in client.of("/tf")]
    assert 1 < len(stamps) <= shown.sent == 181  # who comes misses what goes on until all is subscribed to
    assert stamps[-1] - stamps[0] >= 1e9 * ((len(stamps) - 1) / 60 - 0.001) - 1000
    assert all(stamp <= came for _, stamp, _, came in client.messages)
    assert shown.trouble == ""


def test_what_cannot_be_opened_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is raised in the process that sends."""
    from nmm.plugins.streams.robot_scene import RobotScene

    made = RobotScene.__init__

    def spoilt(scene: RobotScene, *of: Any, **given: Any) -> None:
        made(scene, *of, **given)
        object.__setattr__(scene.still, "description", {1, 2})  # JSON has no words for it

    monkeypatch.setattr(RobotScene, "__init__", spoilt)
    with pytest.raises(nmm.RunError, match=r"TypeError: .*set"):
        nmm.stream(make_loop(), "foxglove", port=0)


def test_a_port_that_is_taken_is_an_error() -> None:
    loop = make_loop()
    with nmm.stream(loop, "foxglove", port=0) as shown:
        with pytest.raises(nmm.InputError, match="Address already in use"):
            nmm.stream(loop, "foxglove", port=port_of(shown))
        assert port_of(shown) in listening()


def test_without_a_viewer_of_rerun_the_error_says_how_to_start_one() -> None:
    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
    with pytest.raises(nmm.InputError, match=r"no viewer of Rerun .*rerun --bind 127\.0\.0\.1"):
        nmm.stream(make_loop(), "rerun", port=free_port())


@pytest.mark.parametrize("listens", ["web", "silent", "other words", "foxglove"])
def test_what_is_no_viewer_of_rerun_is_told(listens: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever listens there: nothing is sent to it, and nothing waits for it."""
    import socket

    from ports import served_folder

    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
    with ExitStack() as stack:
        if listens == "web":
            port = int(stack.enter_context(served_folder(Path(__file__).parent)).rpartition(":")[2])
        elif listens == "foxglove":
            port = port_of(stack.enter_context(nmm.stream(make_loop(), "foxglove", port=0)))
        else:
            monkeypatch.setattr("nmm.plugins.streams.sending.PATIENCE", 0.2)
            server = stack.enter_context(socket.socket())
            server.bind(("127.0.0.1", 0))
            server.listen()
            port = server.getsockname()[1]
            if listens == "other words":

                def answers() -> None:
                    with server.accept()[0] as one:
                        one.sendall(b"220 post office\r\n")
                        one.recv(1000)

                threading.Thread(target=answers, daemon=True).start()
        with pytest.raises(nmm.InputError, match=f"listens at port {port} is no viewer of Rerun"):
            nmm.stream(make_loop(), "rerun", port=port)


def test_the_server_ends_with_the_process_that_drives(tmp_path: Path) -> None:
    """Also where that is killed."""
    code = """
        import sys, time
        sys.path.insert(0, {helpers!r})
        from loop_faults import make_loop
        import nmm
        shown = nmm.stream(make_loop(), "foxglove", port=0)
        print(shown.address, flush=True)
        time.sleep(1000)
    """
    helpers = str(Path(__file__).parents[2] / "helpers")
    program = [sys.executable, "-c", textwrap.dedent(code).format(helpers=helpers)]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as driving:
        assert driving.stdout is not None
        port = int(driving.stdout.readline().rpartition(":")[2])
        assert port in listening()
        driving.kill()
    wait_for(lambda: port not in listening())


def test_what_is_found_in_the_end_puts_nothing_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """A finding of an earlier time comes at once, dated back, and the end of the run with it."""
    from dataclasses import replace

    from nmm.base.findings import Finding
    from nmm.motion.verdict import Verdict
    from nmm.plugins.streams.clock import RunClock
    from nmm.plugins.streams.pictures import Said

    class Kept:
        address, ended = "here", False

        def __init__(self, *of: Any, **given: Any) -> None:
            self.came, self.items = threading.Event(), list[Any]()
            self.came.set()
            self.send = self.items.append

        def close(self, about: Any) -> None:
            pass

        def kill(self) -> None:
            pass

    late = list[float]()
    own = RunClock.late
    monkeypatch.setattr(RunClock, "late", lambda clock, t: (late.append(t), own(clock, t)))
    monkeypatch.setattr("nmm.plugins.streams.run_stream.Sending", Kept)
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.2})
    controller, q0 = scenario.controller(), scenario.robot().q(scenario.parts.q0)
    with RunStream(controller, q0, "run", "foxglove", 0, 60.0) as shown:
        run = nmm.simulate(controller, q0, 0.2, 0.01, watch=shown.watch)
        found = Finding("said", {"text": "the door is open"}, {"t": 0.01})
        shown.end(replace(run, verdict=Verdict(warnings=((found,),))))
        items = shown._sending.items  # type: ignore[attr-defined]
    said = {one.text: one for one in items if isinstance(one, Said)}
    stamps = [one.stamp for one in items if not isinstance(one, Said)]
    assert len(stamps) == shown.sent == 13
    assert late == sorted(late)
    assert stamps[0] < said["the door is open"].stamp < said["completed"].stamp
    assert said["completed"].stamp == stamps[-1]
    assert shown.trouble == ""
