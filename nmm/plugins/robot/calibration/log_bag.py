"""Logs of drives from ROS's bags: wheels by JointStates, and a localisation, motion capture or a tracker."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect, few
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.drive_log import DriveLog, Wrapped
from nmm.plugins.robot.calibration.log_checks import (
    MeasuredDrive,
    check_determined,
    check_moves,
    check_rates,
    check_times,
)
from nmm.plugins.robot.calibration.log_reference import check_reference
from nmm.plugins.robot.calibration.log_turns import counted_on, stated_for
from nmm.plugins.robot.calibration.log_units import Counter, counters_of, unit_of
from nmm.plugins.robot.calibration.recorded_seen import POINT, TF, RecordedSeen
from nmm.plugins.robot.ros.frames import SAME, Edge, prefixed, reference
from nmm.plugins.robot.ros.reading import plain, planar_rows
from nmm.plugins.robot.ros.recorded import Names, told_of
from nmm.plugins.robot.ros.routes import AHEAD, Route, routes
from nmm.plugins.robot.ros.tracks import settle

RAD, METRE, SECOND = (
    unit_of(text, quantity, "") for text, quantity in (("rad", "angle"), ("m", "length"), ("s", "time"))
)


def from_bag(
    path: str | Path,
    robot: Robot,
    reference: str = TF,
    *,
    joints: str | Sequence[str] = "joint_states",
    odometry: str = "odom",
    tf: str = "tf",
    map: str = "map",
    odom: str = "odom",
    base: str | None = None,
    namespace: str = "",
    prefix: str | None = None,
    wrapped: Wrapped = None,
    name: str | None = None,
) -> DriveLog:
    """See `DriveLog.from_bag`."""
    file = Path(path)
    names = Names(joints, odometry, tf, map, odom, base, namespace, prefix)
    with told_of(file):
        made, findings = _read(file, robot, reference, names, wrapped, file.name if name is None else name)
    for finding in findings:
        warnings.warn(f"{made.name}: {finding}", RuntimeWarning, stacklevel=3)
    return made


def _read(
    file: Path, robot: Robot, reference: str, names: Names, wrapped: Wrapped, title: str
) -> tuple[DriveLog, list[Finding]]:
    counters = counters_of(robot)
    recorded = RecordedSeen(robot, file, names, counters, None if reference == TF else reference)
    route = _route(recorded) if reference == TF else None
    if route is None:
        _expect_no_odometry(recorded)
    edges = {} if route is None else {edge: None for edge, _ in route.way if not edge.static}
    findings = [*recorded.findings]
    findings += settle(
        [
            *recorded.tracks(),
            *((edge.topic, edge.track) for edge in edges),
            *([] if recorded.topic is None else [(recorded.topic, recorded.seen)]),
        ]
    )
    measured, start = _measured(recorded, counters, wrapped, findings)
    if route is not None:
        seen, rows = _by_route(recorded, route)
        findings += route.findings
    else:
        seen, rows = _by_topic(recorded)
    findings += check_rates(measured, "joint states")
    check_moves(robot, measured.readings, measured.counters, "joint states")
    check_determined(robot, measured.readings, "joint states")
    kind = "poses" if rows.shape[1] == 3 else "positions"
    made = DriveLog(title, measured.t, measured.readings, (seen - start) / 1e9, rows, kind)  # type: ignore[arg-type]  # one of them
    check_reference(robot, measured, made.reference_t, made.reference, (METRE, RAD), str(file))
    return made, findings


def _measured(
    recorded: RecordedSeen, counters: dict[str, Counter], wrapped: Wrapped, findings: list[Finding]
) -> tuple[MeasuredDrive, int]:
    """Counters at the stamps at which any comes, while all are known; and the first of these, ns."""
    counted = [*recorded.positions]
    counted += [
        name
        for name in recorded.velocities
        if name not in recorded.positions and counters[name].group == "wheels"
    ]
    if not any(counters[name].group == "wheels" for name in counted):
        wheels = [name for name, counter in counters.items() if counter.group == "wheels"]
        topics = few(recorded.names.of_joints)
        raise InputError(f"no wheel's position or velocity on {topics}", expected=f"any of {few(wheels)}")
    asked, rows, stamps, anew = stated_for(wrapped, counted, "bag"), {}, {}, []
    for name in counted:
        if name not in recorded.positions:
            stamps[name], rates = recorded.velocities[name].sorted()
            rows[name] = cumulative_trapezoid(rates[:, 0], (stamps[name] - stamps[name][0]) / 1e9, initial=0)
            continue
        stamps[name], values = recorded.positions[name].sorted()
        begins = asked[name] if counters[name].quantity == "angle" else False
        unit = RAD if counters[name].quantity == "angle" else METRE
        at = stamps[name]
        rows[name], span = counted_on(values[:, 0], unit, begins, name, "joint states", _time_of(at))
        if span is not None and asked[name] is None:
            anew.append(name)
    if anew:
        findings.append(Finding("turns_counted_on", {"names": anew}))
    first, last = max(at[0] for at in stamps.values()), min(at[-1] for at in stamps.values())
    times = np.unique(np.concatenate([*stamps.values()]))
    times = times[(times >= first) & (times <= last)]
    expect(len(times) > 1, "joint states", "two at least while all counters are known", len(times))
    t = (times - first) / 1e9
    readings = {name: np.interp(t, (stamps[name] - first) / 1e9, rows[name]) for name in counted}
    check_times(t, SECOND, "joint states")
    units = {name: RAD if counters[name].quantity == "angle" else METRE for name in counted}
    kept = {name: counters[name] for name in counted}
    return MeasuredDrive(t, readings, kept, units, dict(zip(counted, counted, strict=True))), int(first)


def _time_of(stamps: Integers) -> Callable[[int], str]:
    return lambda k: f"t = {(stamps[k] - stamps[0]) / 1e9:.6g} s"


def _route(recorded: RecordedSeen) -> Route:
    """The way from the map to the platform; `InputError` where wheels counted it, or there is none."""
    names = recorded.names
    world, odom = (
        prefixed(one, recorded.prefix, recorded.tree.frames, (names.map,)) for one in (names.map, names.odom)
    )
    route, _ = routes(recorded)
    first = [edge.child if back else edge.parent for edge, back in route.way][:1]
    if first != [world] or world == odom:
        counted = f"in {odom} it is where wheels counted it"
        what = counted if world == odom else f"no transforms lead from {world} to the platform: {counted}"
        expected = "map=, or reference= a topic of poses"
        raise InputError(what, where="reference", expected=expected, available=recorded.tree.frames)
    carried = route.carrier is not None and odom in (route.carrier.parent, route.carrier.child)
    if carried and all(edge.constant for edge in route.corrects):
        what = f"{world} → {odom} never changes: the poses are those that wheels counted"
        raise InputError(
            what, where="reference", expected="a localisation that corrects them, or reference= a topic"
        )
    return route


def _by_route(recorded: RecordedSeen, route: Route) -> tuple[Integers, Array]:
    """Stamps, ns, and x, y, heading (M, 3): where a localisation corrects odometry, at its corrections, since
    in between it is odometry; else wherever a pose comes."""
    changing = [edge for edge in route.corrects if not edge.constant]
    for edge in changing:
        _date_back(edge)
    if changing:
        times = np.unique(np.concatenate([_changes(edge) for edge in changing]))
    else:
        assert route.carrier is not None
        times = route.carrier.poses[0]
    first, last = route.span()
    times = times[(times >= first) & (times <= last)]
    expect(
        len(times) > 1, "reference", f"at least two poses of the platform in {recorded.names.map}", len(times)
    )
    return times, route.base(times)


def _date_back(edge: Edge) -> None:
    """Take from the stamps of corrections what they are dated ahead, as localisations do for tf2."""
    track = edge.track
    ahead = int(min(track.stamps)) - int(min(track.recorded))
    if not track.by_recording and 0 < ahead < AHEAD:
        track.stamps = [stamp - ahead for stamp in track.stamps]


def _changes(edge: Edge) -> Integers:
    """When a correction is another than the one before."""
    times, poses = edge.poses
    other = np.abs(np.diff(poses, axis=0)).reshape(len(poses) - 1, -1).max(axis=1) > SAME
    return np.asarray(times[1:][other])


def _expect_no_odometry(recorded: RecordedSeen) -> None:
    """`InputError` for a topic of what wheels counted, for one of several frames, and for one without any."""
    topic, names = recorded.topic, recorded.names
    frame, child = recorded.only()
    own = {prefixed(names.odom, recorded.prefix, {frame, *recorded.tree.frames}), plain(names.odom)}
    if frame in own or (topic == recorded.odometry_topic and frame != plain(names.map)):
        what = f"{topic} is what the wheels counted ({child or 'a pose'} in {frame or 'no frame'})"
        expected = (
            "a localisation, motion capture or a tracker; or odom= and odometry= as wheels' own are called"
        )
        raise InputError(what, where="reference", expected=expected)


def _by_topic(recorded: RecordedSeen) -> tuple[Integers, Array]:
    """Stamps, ns, and x, y, heading (M, 3) or x, y (M, 2) of the reference's topic: of the platform's
    reference point where messages name a frame that leads to it."""
    times, rows = recorded.seen.sorted()
    if recorded.kind == POINT:
        return times, rows[:, :2]
    _, child = recorded.only()
    if child:
        with suppress(InputError):  # a body of motion capture: where it sits on the robot is learned
            names = recorded.names
            rows = rows @ reference(recorded.robot, child, recorded.prefix, recorded.tree, names.base)
    return times, planar_rows(rows, str(recorded.topic))
