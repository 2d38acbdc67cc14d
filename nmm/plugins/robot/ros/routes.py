"""Where a robot's platform is over time, by the transforms and the odometry of a log."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from nmm.base.arrays import Array, Flags, Integers
from nmm.base.errors import InputError, no_such
from nmm.base.findings import Finding
from nmm.plugins.robot.ros.frames import Edge, Tree, Way, bare, fixed_frames, prefixed, reference
from nmm.plugins.robot.ros.reading import planar_rows
from nmm.plugins.robot.ros.recorded import Recorded
from nmm.plugins.robot.ros.tracks import Track, foretold, jumps_of, poses_at, steps_of

#: A correction that is dated farther ahead than this, ns, is stamped by another clock.
AHEAD = 10_000_000_000


class Route:
    """A way from a frame to the platform's reference point, which moves along it.

    carrier : the edge that carries its motion; None where nothing can move
    corrects : the edges before it, which correct it
    """

    def __init__(self, way: Way, tail: Array, odom: str, twists: Track) -> None:
        self.way, self.tail, self.findings = way, tail, list[Finding]()
        self._twists = twists
        free = [edge for edge, _ in way if not edge.static]
        below = [k for k, (edge, back) in enumerate(way) if (edge.child if back else edge.parent) == odom]
        own = [edge for edge, _ in way[below[0] :] if not edge.static] if below else []
        moving = [edge for edge in free if not edge.constant]
        self.carrier = next(iter(own or moving[-1:] or free[-1:]), None)
        self.corrects = free[: free.index(self.carrier)] if self.carrier is not None else []

    def span(self) -> tuple[float, float]:
        """From when to when it is known, ns: what does not change, always; what is dated ahead, from when it
        was recorded; a correction, until the next one should have come."""
        first, last = -np.inf, np.inf
        for edge, _ in self.way:
            if edge is self.carrier or not edge.constant:
                times, track = edge.poses[0], edge.track
                ahead = 0 if track.by_recording else int(times[0]) - min(track.recorded)
                early = ahead if edge in self.corrects and 0 < ahead < AHEAD else 0
                late = np.diff(times).max() if edge in self.corrects and len(times) > 1 else 0
                first, last = max(first, times[0] - early), min(last, times[-1] + late)
        return first, last

    @cached_property
    def _jumps(self) -> dict[Edge, Flags]:
        flags = {
            edge: jumps_of(*edge.poses, edge in self.corrects) for edge, _ in self.way if not edge.static
        }
        if self.carrier in flags and len(self._twists):  # a robot may be as fast as it says
            times = self.carrier.poses[0]
            flags[self.carrier] &= ~foretold(*self.carrier.poses, self._twists.between(times))
        return flags

    def told_jumps(self) -> dict[Edge, dict[str, float]]:
        """Of the edges that jump: how often, by how much at most (m, rad), and when first (ns)."""
        jumps = {}
        for edge, flags in self._jumps.items():
            if flags.any():
                times, poses = edge.poses
                steps = np.abs(steps_of(times, poses)[1][flags])
                far = np.hypot(steps[:, 0], steps[:, 1])
                jumps[edge] = {
                    "count": int(flags.sum()),
                    "m": float(far.max()),
                    "rad": float(steps[:, 2].max()),
                    "ns": int(times[1:][flags][0]),
                }
        return jumps

    def breaks(self, times: Integers) -> Flags:
        """Between which of the times, ns, it jumps, (N - 1,)."""
        at = [edge.poses[0][1:][flags] for edge, flags in self._jumps.items()]
        edges = np.unique(np.concatenate([*at, np.zeros(0, dtype=np.int64)]))
        return np.asarray(np.diff(np.searchsorted(edges, times, side="right")) > 0)

    def base(self, times: Integers) -> Array:
        """x, y, theta (N, 3) of the reference point at times, ns; theta counts on from the first."""
        carried = np.zeros(0, dtype=np.int64) if self.carrier is None else self.carrier.poses[0]
        grid = np.union1d(times, carried[(carried > times[0]) & (carried < times[-1])])
        whole = poses_along(self.way, grid, self._jumps)
        rows = planar_rows(whole @ self.tail, self.way[-1][0].child if self.way else "base")
        rows[:, 2] = np.unwrap(rows[:, 2])
        return np.asarray(rows[np.searchsorted(grid, times)])


def poses_along(way: Way, times: Integers, jumps: Mapping[Edge, Flags]) -> Array:
    """Poses (N, 4, 4) of the end of a way in its first frame at times, ns: each edge between its own stamps,
    held across its jumps (M - 1,)."""
    whole = np.broadcast_to(np.eye(4), (len(times), 4, 4))
    for edge, back in way:
        stamps, rows = edge.poses
        none = np.zeros(len(stamps) - 1, dtype=bool)
        placed = rows[-1:] if edge.static else poses_at(times, stamps, rows, jumps.get(edge, none))
        whole = whole @ (np.linalg.inv(placed) if back else placed)
    return whole


def routes(recorded: Recorded) -> tuple[Route, Route | None]:
    """The route to the platform in the map, and that in odometry's frame or None; the latter alone where the
    log has no map. `InputError` where there is neither."""
    names, tree, edge = recorded.names, recorded.tree, recorded.odometry
    frames = tree.frames
    world, odom = (
        prefixed(frame, recorded.prefix, frames, (names.map,)) for frame in (names.map, names.odom)
    )
    mapped = counted = None
    fixed, base = fixed_frames(recorded.robot), names.base
    known = {*frames, *fixed, *([] if edge is None else [edge.child])}
    spelt = set() if base is None else {bare(base, recorded.prefix), prefixed(base, recorded.prefix, known)}
    if base is not None and known.isdisjoint(spelt):
        raise no_such("frame", base, frames or fixed, "base")
    if edge is not None:
        tail = _tail_of(recorded, edge.child)
        counted = Route([(edge, False)], tail, edge.parent, recorded.twists)
        if not edge.child:
            counted.findings.append(Finding("child_unnamed", {"topic": edge.topic}))
        if edge.parent == world:
            mapped, counted = counted, None
        elif way := tree.way(world, edge.parent):
            mapped = Route([*way, (edge, False)], tail, edge.parent, recorded.twists)
    if counted is None and (ended := _to_base(recorded, odom)):
        counted = Route(*ended, odom, recorded.twists)
    if (mapped is None or edge is None or edge.parent != world) and (ended := _to_base(recorded, world)):
        mapped = Route(*ended, odom, recorded.twists)
    if mapped is None and counted is None:
        raise _nowhere(recorded, world, odom)
    both = [route for route in (mapped, counted) if route is not None]
    for route in both:
        route.findings += parents_told(tree, route.way)
    return both[0], counted if mapped is not None else None


def parents_told(tree: Tree, way: Way) -> list[Finding]:
    """Of the frames on a way those that have several parents."""
    findings = []
    for step, back in way:
        below = step.parent if back else step.child
        if len(parents := tree.parents(below)) > 1:
            values = {"frame": below, "parents": " and ".join(parents), "edge": step.name}
            findings.append(Finding("parents_differ", values))
    return findings


def _tail_of(recorded: Recorded, frame: str) -> Array:
    """The pose (4, 4) of the reference point in a frame of the platform."""
    if not frame:
        return np.eye(4)
    return reference(recorded.robot, frame, recorded.prefix, recorded.tree, recorded.names.base)


def _to_base(recorded: Recorded, frame: str) -> tuple[Way, Array] | None:
    """The shortest way from a frame to one of the platform, and the reference point's pose in that."""
    base, tree = recorded.names.base, recorded.tree
    known = [*fixed_frames(recorded.robot)] if base is None else [base]
    ends = [prefixed(name, recorded.prefix, tree.frames) for name in known]
    ways = [(way, end) for end in ends if (way := tree.way(frame, end)) is not None]
    if not ways:
        return None
    way, end = min(ways, key=lambda pair: len(pair[0]))
    return way, _tail_of(recorded, end)


def _nowhere(recorded: Recorded, world: str, odom: str) -> InputError:
    base, frames = recorded.names.base, recorded.tree.frames
    if {world, odom}.isdisjoint(frames) and frames:
        what = f"no frame {odom} or {world}, and no odometry on {recorded.odometry_topic}"
        return InputError(what, expected="odom=, map= or prefix=, or another topic", available=frames)
    link = base or next(iter(fixed_frames(recorded.robot)))
    what = f"no transforms from {world} or {odom} to {link}, and no odometry on {recorded.odometry_topic}"
    return InputError(what, expected="base=, prefix=, or another topic", available=frames)
