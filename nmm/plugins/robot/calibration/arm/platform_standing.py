"""Whether a platform stood while its arm was seen, as far as a bag tells."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from nmm.base.arrays import Array
from nmm.base.errors import InputError, no_such
from nmm.base.findings import Finding
from nmm.plugins.robot.calibration.arm.standing import WINDOW
from nmm.plugins.robot.ros.frames import prefixed
from nmm.plugins.robot.ros.recorded import ODOMETRY, Names, Recorded
from nmm.plugins.robot.ros.routes import Route, poses_along, routes
from nmm.plugins.robot.ros.storage import TRANSFORMS, Topic
from nmm.plugins.robot.ros.tracks import ANOTHER, Track

#: A platform that has moved farther between postures, m or rad, did not stand; farther than SHIFTS is said.
MOVED, SHIFTS = 0.05, 1e-3
#: What odometry and frames are called where nobody says so: that they are there is not asked for.
UNASKED = {"odometry": "odom", "tf": "tf", "map": "map", "odom": "odom", "base": None}


def asked(names: Names) -> list[str]:
    """The options of the platform's odometry and frames that were given."""
    return [name for name, usual in UNASKED.items() if getattr(names, name) != usual]


def asks_of_platform(names: Names) -> bool:
    """Whether any of them was; a topic of transforms may be that of what is seen."""
    return bool({*asked(names)} - {"tf"})


def expect_topics(names: Names, topics: Collection[Topic]) -> None:
    """`InputError` for odometry and transforms that were asked for by a topic that the bag lacks."""
    for name, kinds in (("odometry", (ODOMETRY,)), ("tf", TRANSFORMS)):
        if name not in asked(names):
            continue
        of_kind = [topic for topic, kind in topics if kind in kinds]
        given = getattr(names, name)
        own = {names.topic(given)} | ({f"/{given.lstrip('/')}"} if name == "tf" else set())
        if own.isdisjoint(of_kind):
            what = f"a topic of {kinds[0]} on {names.topic(given)}"
            raise InputError(where=name, expected=what, available=of_kind or ["none of that type"])


def route_of(recorded: Recorded, untold: str, on_platform: bool) -> tuple[Route | None, list[Finding]]:
    """The route that tells whether the platform stood, by odometry where there is any; None where nothing
    tells, or nothing depends on it.

    untold : why there is no odometry, "" where nothing is wrong with it

    Raises
    ------
    InputError : frames that were asked for, and are not there
    """
    if not recorded.robot.platform.n_p:
        return None, []
    names, told = recorded.names, [] if recorded.odometry is None else [recorded.odometry]
    frames = sorted({*recorded.tree.frames, *(name for edge in told for name in (edge.parent, edge.child))})
    for name in ("map", "odom"):
        given = getattr(names, name)
        if name in asked(names) and prefixed(given, recorded.prefix, frames, (names.map,)) not in frames:
            raise no_such("frame", given, frames or ["none"], name)
    try:
        if untold:
            raise InputError(untold)
        first, counted_too = routes(recorded)
    except InputError as error:
        if asks_of_platform(names) and not untold:
            raise
        tells = on_platform and (recorded.robot.wheels or untold)
        return None, [Finding("platform_untold", {"why": error.what})] if tells else []
    return (counted_too or first) if on_platform else None, []


def one_clock(joints: Sequence[Track], others: Sequence[tuple[str, Track]]) -> list[Finding]:
    """What is found of the clock of what is seen beside that of the joints, by the times of recording;
    `InputError` where they are another's."""
    findings = dict[str, Finding]()
    for topic, track in others:
        apart = _apart(track, joints) / 1e9
        if abs(apart) > 1e-9 * ANOTHER:
            what = f"stamps of {topic} and of joint states are {abs(apart):.3g} s apart, by when they came"
            raise InputError(what, where="reference", expected=f"stamps of one clock, to {0.5 * WINDOW:g} s")
        if abs(apart) > 0.5 * WINDOW:
            findings[topic] = Finding("stamps_apart", {"topic": topic, "s": abs(apart)})
    return [*findings.values()]


def to_clock(joints: Sequence[Track], route: Route) -> list[Finding]:
    """Put stamps of what tells where the platform is on the joints' clock, where they are another's."""
    findings = list[Finding]()
    for edge, _ in route.way:
        track = edge.track
        if edge.constant or track.by_recording:
            continue
        if abs(ahead := round(_apart(track, joints))) > ANOTHER:
            track.stamps = [stamp + ahead for stamp in track.stamps]
            findings.append(Finding("stamps_of_recording", {"topic": edge.topic, "why": "another clock"}))
    return findings


def expect_standing(route: Route, spans: Array, start: int) -> list[Finding]:
    """What is found of a platform between postures in spans (K, 2), s after `start`, ns; `InputError` where
    it moved."""
    if all(edge.constant for edge, _ in route.way):
        return []
    times = start + np.round(1e9 * spans.mean(axis=1)).astype(np.int64)
    first, last = route.span()
    known = times[(times >= first) & (times <= last)]
    findings = []
    if unknown := len(times) - len(known):
        findings.append(Finding("platform_unseen", {"count": unknown, "of": len(times)}))
    if not len(known):
        return findings
    at = poses_along(route.way, known, {}) @ route.tail
    turns = Rotation.from_matrix(at[:, :3, :3])
    far = float(np.ptp(at[:, :3, 3], axis=0).max().round(6))
    turned = float((turns[0].inv() * turns).magnitude().max().round(6))
    if max(far, turned) > MOVED:
        what = f"the platform moved by {far:.3g} m and {turned:.3g} rad between postures"
        raise InputError(what, where="reference", expected="one that stands, or a table with base=")
    if max(far, turned) > SHIFTS:
        findings.append(Finding("platform_shifts", {"m": far, "rad": turned}))
    return findings


def _apart(track: Track, joints: Sequence[Track]) -> float:
    """How much longer after its stamps a track was recorded than joints of the same stamps were, ns."""
    times, behind = _behind(track)
    others = [_behind(joint) for joint in joints]
    return float(np.median([np.median(behind - np.interp(times, *other)) for other in others]))


def _behind(track: Track) -> tuple[Array, Array]:
    """Times that increase (N,), ns, and how long after these it was recorded (N,), ns."""
    recorded = np.array(track.recorded, dtype=np.int64)
    times = recorded if track.by_recording else np.array(track.stamps, dtype=np.int64)
    order = np.argsort(times, kind="stable")
    return times[order].astype(np.float64), (recorded - times)[order].astype(np.float64)
