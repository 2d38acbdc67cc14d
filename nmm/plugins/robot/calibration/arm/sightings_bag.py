"""Sightings from ROS's bags: where an arm stands, what its joints read and what is seen there."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect_kind, few, no_such
from nmm.base.findings import Finding
from nmm.base.text_format import counted
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm.chain import Chain
from nmm.plugins.robot.calibration.arm.platform_standing import (
    asks_of_platform,
    expect_standing,
    expect_topics,
    one_clock,
    route_of,
    to_clock,
)
from nmm.plugins.robot.calibration.arm.seen_standing import seen_in
from nmm.plugins.robot.calibration.arm.sightings import WORLD, Kind, Sightings
from nmm.plugins.robot.calibration.arm.standing import WINDOW, standing
from nmm.plugins.robot.calibration.recorded_seen import RecordedSeen
from nmm.plugins.robot.ros.frames import Edge, Way, bare, prefixed
from nmm.plugins.robot.ros.reading import plain
from nmm.plugins.robot.ros.recorded import Names, Recorded, told_of
from nmm.plugins.robot.ros.routes import parents_told, poses_along
from nmm.plugins.robot.ros.storage import Topic
from nmm.plugins.robot.ros.tracks import Track, settle

#: Between a frame in TF and the one that is seen in it.
IN_TF = ":"


def from_bag(
    path: str | Path,
    robot: Robot,
    on: str,
    by: str,
    reference: str | None,
    *,
    joints: str | Sequence[str],
    odometry: str,
    tf: str,
    map: str,
    odom: str,
    base: str | None,
    namespace: str,
    prefix: str | None,
    sensor: str,
    target: str,
    name: str | None,
) -> Sightings:
    """See `Sightings.from_bag`."""
    expect_kind(path, str | Path, "sightings", "a bag's path")
    file = Path(path)
    expect_kind(robot, Robot, f"{file}: robot", "a Robot, as nmm.load gives it")
    expect_kind(reference, str | None, f"{file}: reference", "a topic, or FRAME:CHILD of TF")
    names = Names(joints, odometry, tf, map, odom, base, namespace, prefix)
    chain = Chain(robot, by, on, str(file))
    with told_of(file):
        recorded = _RecordedSightings(chain, file, names, reference)
        readings, seen, kind, findings = _postures(recorded, chain, bool(sensor))
    title = file.name if name is None else name
    for finding in findings:
        warnings.warn(f"{title}: {finding}", RuntimeWarning, stacklevel=3)
    return Sightings(title, readings, seen, kind, on, by, sensor=sensor, target=target)


class _RecordedSightings(RecordedSeen):
    """What a bag has of an arm's joints, and of what is seen of it.

    pair : in TF, the frame that sees and the one that is seen, as they were asked for
    named : all names in JointStates
    untold : why odometry that was not asked for tells nothing
    """

    beside = "FRAME:CHILD of TF"

    def __init__(self, chain: Chain, file: Path, names: Names, reference: str | None) -> None:
        self._reference, self.named, self.untold = reference, dict[str, None](), ""
        frame, colon, child = (reference or "").partition(IN_TF)
        self.pair = (frame, child) if colon else None
        of_joints = chain.names(chain.coordinates)
        super().__init__(chain.robot, file, names, of_joints, None if colon else reference or "")

    @property
    def _framed(self) -> bool:
        return self.pair is not None or super()._framed

    def _takes(self, topics: list[Topic]) -> dict[Topic, Callable[[str, int, Any], None]]:
        if not self._reference:
            expected = f"what saw it: a topic of poses or points, or {self.beside}"
            raise self._no_reference(expected, topics)
        expect_topics(self.names, topics)
        return super()._takes(topics)

    def _take_joints(self, topic: str, recorded: int, message: Any) -> None:
        self.named.update(dict.fromkeys(message.name))
        super()._take_joints(topic, recorded, message)

    def _one_odometry(self) -> Edge | None:
        if not self.robot.platform.n_p:
            return None
        try:
            return Recorded._one_odometry(self)
        except InputError as error:  # it only tells whether the platform stood
            if asks_of_platform(self.names):
                raise
            self.untold = error.what
        return None

    def way(self) -> Way:
        """From the frame that sees to the one that is seen; `InputError` where there is none, and where the
        robot's own joints move it: their encoders told that."""
        assert self.pair is not None
        frames, ends = self.tree.frames, []
        if not all(self.pair):
            raise InputError(where=f"reference {self._reference}", expected=self.beside)
        for name in self.pair:
            known = [end for end in (prefixed(name, self.prefix, frames), plain(name)) if end in frames]
            ends += known[:1]
            if not known:
                raise no_such("frame", name, frames, f"reference {self._reference}")
        where = f"reference {self._reference}"
        way = self.tree.way(*ends)
        if ends[0] == ends[1]:
            raise InputError("it is one frame", where=where, expected="that which sees, and another")
        if not way:
            raise InputError("no transforms connect them", where=where, available=frames)
        for edge, _ in way:
            links = [bare(name, self.prefix) for name in (edge.parent, edge.child)]
            if {*links} <= {*self.robot.frames} and not edge.constant:
                what = f"its way goes by the robot's own joints, {edge.name}, as encoders count them"
                raise InputError(what, where=where, expected="the frame that sees, itself")
        return way


def _postures(
    recorded: _RecordedSightings, chain: Chain, named: bool
) -> tuple[dict[str, Array], Array, Kind, list[Finding]]:
    """Readings by joint (N,), what is seen, its kind, and what was found."""
    robot, findings = chain.robot, [*recorded.findings]
    of_joints = dict(zip(chain.names(chain.coordinates), chain.coordinates, strict=True))
    if missing := [name for name in of_joints if name not in recorded.positions]:
        what = f"no position of {few(missing)} on {few(recorded.names.of_joints)}"
        raise InputError(what, expected="each by its name in the file, or prefix=", available=recorded.named)
    way = recorded.way() if recorded.pair is not None else []
    frame, child = recorded.only() if recorded.pair is None else recorded.pair
    _expect_on(chain, "by", bare(frame, recorded.prefix), named or chain.by == WORLD)
    _expect_on(chain, "on", bare(child, recorded.prefix))
    route, untold = route_of(recorded, recorded.untold, chain.on_platform)
    edges = [edge for edge, _ in way if not edge.constant]
    own = [] if route is None else [edge for edge, _ in route.way if not edge.constant]
    seen_by = [(edge.topic, edge.track) for edge in edges] if way else [(str(recorded.topic), recorded.seen)]
    of_edges = [(edge.topic, edge.track) for edge in own if edge not in edges]
    findings += [*parents_told(recorded.tree, way), *untold]
    findings += settle([*recorded.tracks(), *seen_by, *of_edges])
    counted_by = [recorded.positions[name] for name in of_joints]
    findings += one_clock(counted_by, seen_by)
    findings += [] if route is None else to_clock(counted_by, route)
    looks, rows = _along(way, edges) if way else recorded.seen.sorted()
    tracks = {name: _counted_on(recorded.positions[name], bool(robot.endless[c]))
              for name, c in of_joints.items()}  # fmt: skip
    start = min(int(times[0]) for times, _ in tracks.values())
    series = {name: ((times - start) / 1e9, values) for name, (times, values) in tracks.items()}
    spans, readings, creeping = standing(
        series, {name: str(robot.q_units[c]) for name, c in of_joints.items()}
    )
    where = f"reference {recorded.topic or ':'.join((frame, child))}"
    _expect_together(looks, [times for times, _ in tracks.values()], start, where)
    chosen, seen, why, few_of = seen_in(spans, (looks - start) / 1e9, rows, where)
    if creeping:
        why["joints creep on"] = creeping
    of = len(spans) + creeping
    findings += few_of
    findings += [Finding("postures_left_out", {"count": n, "of": of, "why": w}) for w, n in why.items() if n]
    if len(chosen) < 3:
        left = "".join(f", in {n} more {w}" for w, n in why.items() if n)
        what = f"the arm stands and is seen in {counted(len(chosen), 'posture')}{left}"
        raise InputError(what, where=where, expected="three at least, fifty for all numbers")
    findings += [] if route is None else expect_standing(route, spans[chosen], start)
    kind: Kind = "points" if seen.ndim == 2 else "poses"
    return dict(zip(of_joints, readings[chosen].T, strict=True)), seen, kind, findings


def _along(way: Way, edges: Sequence[Edge]) -> tuple[Integers, Array]:
    """Stamps, ns, at which a way in TF is told, and poses (N, 4, 4); not where a part of it that changes is
    silent."""
    if not edges:
        raise InputError(f"{way[0][0].name} never changes", where="reference", expected="what is seen anew")
    times = np.unique(np.concatenate([edge.poses[0] for edge in edges]))
    near = np.ones(len(times), dtype=bool)
    for edge in edges:
        stamps = edge.poses[0]
        before = np.searchsorted(stamps, times, side="right") - 1
        after = np.searchsorted(stamps, times)
        within = (before >= 0) & (after < len(stamps))
        lasts = stamps[np.minimum(after, len(stamps) - 1)] - stamps[np.maximum(before, 0)]
        near &= within & (lasts <= 1e9 * WINDOW)
    return times[near], poses_along(way, times[near], {})


def _counted_on(track: Track, endless: bool) -> tuple[Integers, Array]:
    times, rows = track.sorted()
    return times, np.unwrap(rows[:, 0]) if endless else rows[:, 0]


def _expect_together(looks: Integers, joints: Sequence[Integers], start: int, where: str) -> None:
    """`InputError` where nothing is seen while the joints are told."""
    last = min(times[-1] for times in joints)
    if len(looks) and (looks[-1] < start or looks[0] > last):
        first, end, until = ((t - start) / 1e9 for t in (looks[0], looks[-1], last))
        what = f"what is seen is stamped {first:.3g} to {end:.3g} s, joint states are 0 to {until:.3g} s"
        raise InputError(what, where=where, expected=f"stamps of one clock, to {0.5 * WINDOW:g} s")


def _expect_on(chain: Chain, side: str, frame: str, fixed: bool = True) -> None:
    """`InputError` where messages speak of a frame of the robot that is not the one asked for: that moves
    against it or, unless `fixed` will do, is another."""
    robot, own = chain.robot, chain.by if side == "by" else chain.on
    if frame == own or frame not in robot.frames:
        return
    carrier, _ = chain.ends[0 if side == "by" else 1]
    parent = int(chain.model.frames[robot.frame_id(frame)].parentJoint)
    if fixed and _of_arm(chain, parent) == _of_arm(chain, carrier):
        return
    what = f"{own} {'sees' if side == 'by' else 'is seen'}, and messages speak of {frame}"
    raise InputError(what, where=side, expected=f"{side}={frame!r}")


def _of_arm(chain: Chain, joint: int) -> int:
    """A joint of the model, that of the world instead of the platform's own."""
    return joint if joint and chain.model.joints[joint].idx_q >= chain.robot.platform.n_p else 0
