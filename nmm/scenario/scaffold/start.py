"""Where a robot starts: within its limits, and away from where its Jacobian loses rank."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, RobotError
from nmm.model.collisions.pairs import HULLS, measured_pairs, query_shapes, random_configurations
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.model.robots.semantics import POSTURE
from nmm.scenario.scaffold.end_effector import Hand, movable
from nmm.scenario.scaffold.standing import Standing
from nmm.scenario.short_task import moving_axes

#: A J whose least singular value is below this, per metre of arm, is near a singularity.
REGULAR = 0.03
#: No arm is longer, m, but what slides far on a gantry.
_LONGEST = 5.0
#: A joint nearer to a limit than this share of its range counts less, and at a limit not at all.
_ROOM = 0.15
#: Of a configuration whose end-effector is beside or behind the axle, or at the ground, this much counts.
_BEHIND, _LOW = 0.2, 0.1
#: What the platform adds counts this much beside what the arm can do alone.
_WHOLE = 0.1
#: The end-effector should be this far above the ground, m.
_ABOVE = 0.05
#: What people call a posture to begin with, the likeliest first.
_NAMES = ("home", "ready", "default", "up", "standing", "sitting")
_COUNT = 400
#: The best are tested for shapes that touch: at most this many, worth at least this share of the best.
_BEST, _GOOD = 40, 0.4


@dataclass(frozen=True, eq=False)
class Start:
    """A start, and the components that the end-effector is led along."""

    q: Array  #: (n,), rounded as the file has it; m and rad
    named: Mapping[str, Any]  #: as the file has it: coordinates, and a posture's name
    axes: str  #: of the end-effector's position: some of x, y, z
    why: str  #: where it comes from


def start_for(robot: Robot, hand: Hand, standing: Standing) -> Start | None:
    """The best start for one end-effector; None where no configuration has a J of full rank."""
    moved = moving_axes({"kind": "position", "frame": hand.frame}, robot)
    look = _Look(robot, hand, standing)
    seen = [look.at(q) for q in _tried(robot, hand)]
    for axes in ("".join(some) for count in range(len(moved), 0, -1) for some in combinations(moved, count)):
        if len(axes) <= len(look.all):
            start = _posture(look, axes) or _searched(look, seen, axes)
            if start is not None:
                return start
    return None


class _Seen(NamedTuple):
    """A configuration (n,), the end-effector's place there (3,), and its J (3, m), per metre of arm."""

    q: Array
    place: Array
    J: Array

    def sigma(self, axes: str, columns: list[int]) -> float:
        """The least singular value of J's rows of these axes and of these columns; 0 for too few."""
        rows = ["xyz".index(axis) for axis in axes]
        values = np.linalg.svd(self.J[np.ix_(rows, columns)], compute_uv=False)
        return float(values[len(axes) - 1]) if len(values) >= len(axes) else 0.0


class _Look:
    """One end-effector of a robot, evaluated at configurations."""

    def __init__(self, robot: Robot, hand: Hand, standing: Standing) -> None:
        self.robot, self.hand, self.standing = robot, hand, standing
        self.all = [robot.input(name) for name in movable(robot)]
        self.arm = [robot.input(name) for name in hand.joints]

    def at(self, q: Array) -> _Seen:
        configuration = Configuration(self.robot, q)
        J = configuration.jacobian(self.hand.frame)[:3] @ configuration.S / min(self.robot.reach, _LONGEST)
        return _Seen(q, np.array(configuration.placement(self.hand.frame).translation), J)

    def worth(self, seen: _Seen, axes: str) -> float:
        """How well the end-effector can be led from there: 0 at singularities and limits."""
        robot, q = self.robot, seen.q
        worth = _WHOLE * seen.sigma(axes, self.all) + seen.sigma(axes, self.arm)
        if robot.platform.n_p:
            x, y = seen.place[:2] - q[:2]
            worth *= max(_BEHIND, float(x / (np.hypot(x, y) or 1.0)))
        if "z" in axes and seen.place[2] < _ABOVE:
            worth *= _LOW
        columns = [robot.coordinate(name) for name in self.hand.joints]
        lower, upper = robot.q_limits[columns].T
        both = robot.limited[columns].all(axis=1)
        with np.errstate(invalid="ignore"):
            room = np.where(both, np.minimum(q[columns] - lower, upper - q[columns]) / (upper - lower), 1.0)
        return worth * float(np.clip(room.min(initial=1.0) / _ROOM, 0.0, 1.0))

    def touching(self) -> Callable[[Array], int]:
        """How many pairs of shapes with the arm's are inside each other, a function of q (n,)."""
        robot = self.robot
        joints = {robot.model.getJointId(name) for name in self.hand.joints}
        try:
            shapes = query_shapes(robot, HULLS)
        except RobotError:  # a mesh that nothing can read: the run does without
            return lambda _: 0
        of_arm = [shape.parentJoint in joints for shape in shapes.geometryObjects]
        pairs = [(pair.first, pair.second) for pair in robot.collision_model.collisionPairs]
        distances = measured_pairs(
            robot, shapes, [pair for pair in pairs if of_arm[pair[0]] or of_arm[pair[1]]]
        )
        return lambda q: int((distances(q, 0.0) < 0.0).sum())


def _posture(look: _Look, axes: str) -> Start | None:
    """A named posture of the arm's joints that is within limits and regular, the likeliest name first."""
    robot = look.robot

    def rank(name: str) -> int:
        return next((i for i, word in enumerate(_NAMES) if word in name.lower()), len(_NAMES))

    for name in sorted(robot.postures, key=rank):
        if not {*look.hand.joints} <= {*robot.postures[name]}:
            continue
        q = robot.q({POSTURE: name})
        try:
            robot.check_limits(q)
        except InputError:
            continue
        if look.at(q).sigma(axes, look.all) >= REGULAR and look.standing.margin(q) > 0.0:
            where = "SRDF" if robot.semantics.files else "file"
            return Start(q, {POSTURE: name}, axes, f"a posture of the robot's {where}")
    return None


def _searched(look: _Look, seen: list[_Seen], axes: str) -> Start | None:
    """The best-conditioned posture away from limits, at rest or random; of the best, the least in contact."""
    robot = look.robot
    best = sorted(seen, key=lambda posture: -look.worth(posture, axes))[:_BEST]
    good = [posture.q for posture in best if look.worth(posture, axes) > _GOOD * look.worth(best[0], axes)]
    if not good:
        return None
    touching = look.touching()
    q = min(good, key=lambda q: (look.standing.margin(q) <= 0.0, touching(q)))
    q = robot.following.placed(np.clip(np.round(q, 2), *robot.q_limits.T))
    if look.at(q).sigma(axes, look.all) < REGULAR:
        return None
    following = {mimic.joint for mimic in robot.mimic_joints}
    named = {
        name: round(float(value), 12)
        for name, value in zip(robot.q_names, q, strict=True)
        if value and name not in following
    }
    why = f"within limits and away from singularities, the best of {len(seen)} that were looked at"
    return Start(q, named, axes, why)


def _tried(robot: Robot, hand: Hand) -> Iterator[Array]:
    rest = robot.rest
    yield rest
    columns = [robot.coordinate(name) for name in hand.joints]
    if not columns:
        return
    for drawn in random_configurations(robot, _COUNT - 1):
        q = rest.copy()
        # Half a turn to either side is enough where a joint turns without end.
        q[columns] = np.where(robot.limited[columns].any(axis=1), drawn[columns], drawn[columns] * 0.4)
        yield robot.following.placed(q)
