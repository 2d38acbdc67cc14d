"""From frame to frame: transforms as they come, and where a robot's platform is in them."""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property, reduce
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Integers, vector
from nmm.base.errors import InputError, expect
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.making import base_joint, root_link
from nmm.plugins.robot.ros.reading import lost, name_of, placement, placements, plain, planar, velocities
from nmm.plugins.robot.ros.tracks import Track
from nmm.plugins.robot.ros.transforms import told_in

#: Poses that differ by less, m and rad, are the same.
SAME = 1e-6


class Transforms:
    """The newest transforms of /tf and /tf_static, which lead from frame to frame.

    Parameters
    ----------
    prefix : what the names of a robot's frames begin with where several share a tree ("robot1/"): frames are
        asked for without it

    Examples
    --------
    >>> from rosbags.typesys import Stores, get_typestore
    >>> types = get_typestore(Stores.ROS2_HUMBLE).types
    >>> robot, frames = nmm.load("unicycle_2r"), nmm.ros.Transforms()
    >>> message = nmm.ros.Messages(robot, types).transforms(0.0, [1, 2, 0.5, 0, 0])
    >>> frames.add(message)
    >>> frames.base("odom", "base_footprint").round(3), frames.base("odom", robot).round(3)
    (array([1. , 2. , 0.5]), array([1. , 2. , 0.5]))
    """

    def __init__(self, prefix: str = "") -> None:
        self.prefix = prefix
        #: By child: its parent, and its pose there.
        self.newest: dict[str, tuple[str, Array]] = {}

    @property
    def frames(self) -> list[str]:
        """The names of all frames, in order."""
        return sorted({*self.newest, *(parent for parent, _ in self.newest.values())})

    def add(self, message: Any) -> None:
        """Take over a TFMessage; `InputError` as of `placement`, with nothing taken over."""
        expect(hasattr(message, "transforms"), type(message).__name__, "a message with the field transforms")
        newest = [(plain(transform.child_frame_id), (plain(transform.header.frame_id), placement(transform)))
                  for transform in message.transforms]  # fmt: skip
        self.newest.update(newest)

    def placement(self, frame: str, child: str) -> Array:
        """The pose (4, 4) of `child` in `frame`, m; `InputError` where no transforms connect them."""
        first, second = self._chain(frame), self._chain(child)
        if not self.connects(frame, child):
            raise InputError(
                "no transforms connect them", where=f"{frame} and {child}", available=self.frames
            )
        return np.asarray(np.linalg.inv([*first.values()][-1]) @ [*second.values()][-1])

    def connects(self, frame: str, child: str) -> bool:
        """Whether there are transforms from the one to the other."""
        return [*self._chain(frame)][-1] == [*self._chain(child)][-1]

    def base(self, frame: str, child: str | Robot) -> Array:
        """x, y, theta (3,) of `child` in `frame`, as of `nmm.ros.base`; of a robot those of its platform's
        reference point, by any of its links that is fixed to the platform."""
        if not isinstance(child, Robot):
            return planar(self.placement(frame, child), f"{child} in {frame}")
        fixed = fixed_frames(child)
        known = [name for name in fixed if self.connects(frame, name)]
        if not known:
            what = f"no transforms from {frame} to a link that is fixed to the platform of {child.name}"
            raise InputError(what, expected=f"one of {', '.join([*fixed][:4])}", available=self.frames)
        nearest = min(known, key=lambda name: len(self._chain(name)))
        pose = self.placement(frame, nearest) @ np.linalg.inv(fixed[nearest])
        return planar(pose, f"{nearest} in {frame}")

    def _chain(self, frame: str) -> dict[str, Array]:
        """The frames above a frame, and its pose in each."""
        frame = prefixed(frame, self.prefix, {*self.frames}, ("map",))
        above = {frame: np.eye(4)}
        while frame in self.newest:
            parent, pose = self.newest[frame]
            expect(parent not in above, f"frame {frame}", "a tree of frames, this is a circle", parent)
            above[parent] = pose @ above[frame]
            frame = parent
        return above


def prefixed(frame: str, prefix: str, frames: Collection[str], shared: Collection[str] = ()) -> str:
    """The name of a frame among those that there are: with the prefix; without it those that robots share, or
    where no frame has it."""
    frame, prefix = plain(frame), plain(prefix)
    if not prefix or frame.startswith(prefix):
        return frame
    tried = f"{prefix}{frame}", f"{prefix.rstrip('/')}/{frame}"
    if known := [name for name in tried if name in frames]:
        return known[0]
    has = any(name.startswith(prefix) for name in frames)
    return tried[0] if has and frame not in shared else frame


def bare(frame: str, prefix: str) -> str:
    """A frame's name without the prefix."""
    frame, prefix = plain(frame), plain(prefix)
    return frame.removeprefix(prefix).lstrip("/") if prefix else frame


def fixed_frames(robot: Robot) -> dict[str, Array]:
    """Poses (4, 4) of the links that are fixed to the platform, in its frame, m; the root link first."""
    model, root = robot.display_model, base_joint(robot)
    own = [frame for frame in model.frames if frame.parentJoint == root and frame.name != "universe"]
    fixed = {frame.name: np.asarray(frame.placement.homogeneous)
             for kind in ("OP_FRAME", "BODY") for frame in own if frame.type.name == kind}  # fmt: skip
    return {root_link(robot): np.eye(4)} | fixed


@dataclass(eq=False)
class Edge:
    """What is known of one frame in another over time."""

    parent: str
    child: str
    static: bool = False
    topic: str = ""
    track: Track = field(default_factory=Track)

    @property
    def name(self) -> str:
        return f"{self.parent} → {self.child}"

    @cached_property
    def poses(self) -> tuple[Integers, Array]:
        """Times (N,), ns, that increase, and poses (N, 4, 4)."""
        return self.track.sorted()

    @cached_property
    def constant(self) -> bool:
        """Whether it is the same throughout."""
        return self.static or bool(np.ptp(np.array(self.track.rows), axis=0).max() < SAME)


#: Edges one after the other, each with whether it is taken from child to parent.
Way = list[tuple[Edge, bool]]


class Tree:
    """All transforms of a log, each edge with times of its own, and a robot's prefix of frames."""

    def __init__(self) -> None:
        self.edges: dict[tuple[str, str], Edge] = {}
        self._rows: dict[Edge, array[float]] = {}
        self._told: dict[tuple[str, str], tuple[Track, array[float]]] = {}

    @property
    def frames(self) -> list[str]:
        return sorted({name for pair in self.edges for name in pair})

    def add(self, message: Any, topic: str, static: bool, recorded: int) -> None:
        """Add the transforms of a TFMessage, as numbers until `place` makes poses of them."""
        for frame, child, stamp, numbers in told_in(message):
            known = self._told.get((frame, child))
            if known is None:
                pair = plain(frame), plain(child)
                edge = self.edges.setdefault(pair, Edge(*pair, static, topic))
                known = self._told[frame, child] = edge.track, self._rows.setdefault(edge, array("d"))
            track, rows = known
            track.stamps.append(stamp)
            track.recorded.append(recorded)
            rows.extend(numbers)

    def place(self) -> list[Finding]:
        """Make poses of all that was added, and tell what of an edge that is known is without one, and left
        out; `InputError` as of `placement`."""
        findings = []
        for edge, told in self._rows.items():
            rows, track = np.array(told).reshape(-1, 7), edge.track
            none = lost(rows)
            if none.any() and not none.all():
                rows[none] = rows[np.argmin(none)]
                findings.append(Finding("looks_lost", {"topic": edge.name, "count": int(none.sum())}))
            known = len(track.rows)
            track.rows.extend(placements(rows, edge.name))
            if none.any():  # all of them were refused above
                track.without(np.concatenate([np.zeros(known, dtype=bool), none]))
        self._rows.clear()
        self._told.clear()
        return findings

    def way(self, frame: str, child: str) -> Way | None:
        """The fewest edges from one frame to another; None where there are none."""
        beside: dict[str, list[tuple[str, Edge, bool]]] = {}
        for (parent, below), edge in self.edges.items():
            beside.setdefault(parent, []).append((below, edge, False))
            beside.setdefault(below, []).append((parent, edge, True))
        ways: dict[str, Way] = {frame: []} if frame in beside else {}
        ahead = deque(ways)
        while ahead and child not in ways:
            at = ahead.popleft()
            for other, edge, back in beside[at]:
                if other not in ways:
                    ways[other] = [*ways[at], (edge, back)]
                    ahead.append(other)
        return ways.get(child)

    def parents(self, child: str) -> list[str]:
        return [parent for parent, below in self.edges if below == child]


def constant(way: Way) -> Array | None:
    """The pose (4, 4) of a way of which nothing changes, else None."""
    if not all(edge.constant for edge, _ in way):
        return None
    poses = (np.linalg.inv(edge.track.rows[-1]) if back else edge.track.rows[-1] for edge, back in way)
    return reduce(np.matmul, poses, np.eye(4))


def reference(
    robot: Robot,
    frame: str,
    prefix: str = "",
    tree: Tree | None = None,
    base: str | None = None,
) -> Array:
    """The pose (4, 4) of a platform's reference point in a frame, m, by the file's fixed joints or transforms
    that do not change; `base` is the point's own frame, where the file does not have it.

    Raises
    ------
    InputError : the frame moves against the platform, or nothing leads from it there
    """
    fixed, name = fixed_frames(robot), bare(frame, prefix)
    if name in fixed:
        return np.asarray(np.linalg.inv(fixed[name]))
    tree = Tree() if tree is None else tree
    for link in tree.frames:
        way = tree.way(plain(frame), link) if bare(link, prefix) in fixed else None
        if way is not None and (pose := constant(way)) is not None:
            return np.asarray(pose @ np.linalg.inv(fixed[bare(link, prefix)]))
    if base is not None and name == bare(base, prefix) and name not in robot.frames:
        return np.eye(4)
    why = "moves on the robot" if name in robot.frames else "is not in the robot's file"
    what = f"{frame} {why}, and no fixed transforms lead from it to the platform"
    mend = "" if name in robot.frames else f", or base={name!r} if it is at the reference point"
    raise InputError(what, expected=f"the pose of a link that is fixed to it{mend}", available=fixed)


def carried(linear: Array, angular: Array, pose: Array) -> Array:
    """(3,) along x and y, m/s, and about z, rad/s, of the axes at a pose (4, 4) in those in which the linear
    and the angular velocity (3,) of their origin are. On level axes only what is level counts."""
    if pose[2, 2] > 1.0 - 1e-9:
        linear, angular = np.array([*linear[:2], 0.0]), np.array([0.0, 0.0, angular[2]])
    turn, (x, y, z), (a, b, c) = pose[:3, :3].T, pose[:3, 3].tolist(), angular.tolist()
    across = np.array([b * z - c * y, c * x - a * z, a * y - b * x])  # np.cross takes ten times as long
    return np.array([*(turn @ (linear + across))[:2], (turn @ angular)[2]])


def odometry(
    message: Any, robot: Robot, transforms: Transforms | None = None, base: str | None = None
) -> tuple[Array, Array]:
    """x, y, theta (3,), m and rad, and the velocity (3,), as of `base` and `twist`, of a platform's reference
    point, of an Odometry of whatever link is fixed to the platform.

    Parameters
    ----------
    message : its child_frame_id says of what it speaks; empty is the reference point
    robot : whose
    transforms : for a frame that the robot's file does not have; their prefix is the robot's
    base : the reference point's own frame, where neither knows it

    Raises
    ------
    InputError : a frame that moves on the robot, or that nothing leads to; the causes of `base` and `twist`

    Examples
    --------
    >>> from rosbags.typesys import Stores, get_typestore
    >>> types = get_typestore(Stores.ROS2_HUMBLE).types
    >>> robot = nmm.load("unicycle_2r")
    >>> message = nmm.ros.Messages(robot, types).odometry(0.0, [1, 2, 0, 0, 0], [0.5, 0, 0.2, 0, 0])
    >>> nmm.ros.odometry(message, robot)
    (array([1., 2., 0.]), array([0.5, 0. , 0.2]))
    """
    where, prefix = name_of(message), "" if transforms is None else transforms.prefix
    tree = Tree()
    for child, (parent, pose) in {} if transforms is None else transforms.newest.items():
        tree.edges[parent, child] = Edge(parent, child, static=True)
        tree.edges[parent, child].track.add(0, 0, pose)
    pose = np.eye(4)
    if child := plain(message.child_frame_id):
        pose = reference(robot, child, prefix, tree, base)
    velocity = vector(carried(*velocities(message), pose), 3, f"{where}: twist")
    return planar(placement(message) @ pose, where), velocity
