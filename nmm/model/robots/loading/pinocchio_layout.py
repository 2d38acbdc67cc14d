"""To and from Pinocchio's own layouts, for people who share configurations with Pink, Crocoddyl and others.

Ours is q = [x, y, theta, ...] with theta an unwrapped angle, and q_dot its plain derivative. A planar root
has the configuration (x, y, cos θ, sin θ), a free flyer (x, y, z, quaternion x y z w); the velocity of both
is the root body's, along its own axes.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array
from nmm.base.errors import InputError, expect_known, few, no_such
from nmm.model.robots.joint_table import twist
from nmm.model.robots.loading.chain import CHAIN, CHAIN_JOINTS, Head, rebuild, replaced_joints, yaw_of
from nmm.model.robots.loading.joint_kinds import is_continuous, is_mimic, is_simple, kind
from nmm.model.robots.loading.provenance import with_wheels_fixed
from nmm.model.robots.loading.root_layout import ROOTS, ChainRoot
from nmm.model.robots.meshes import read_meshes
from nmm.model.robots.robot import Robot

Root = Literal["planar", "freeflyer", "chain"]

# How far a locked joint may be from where it is locked, rad or m.
_HELD = 1e-6


class PinocchioModels(NamedTuple):
    """A robot's models as other tools take them; wheels stand still.

    Examples
    --------
    >>> models = nmm.pinocchio_models(nmm.load("unicycle_2r"))
    >>> isinstance(models, nmm.extending.PinocchioModels), models.model.nv
    (True, 5)
    >>> len(models.visual_model.geometryObjects) > 0
    True
    """

    model: pin.Model
    visual_model: pin.GeometryModel
    collision_model: pin.GeometryModel


def pinocchio_model(robot: Robot, root: Root | str = "planar") -> pin.Model:
    """The robot's kinematics and dynamics on another root joint; see `pinocchio_models`.

    Examples
    --------
    >>> model = nmm.pinocchio_model(nmm.load("unicycle_2r"), "freeflyer")
    >>> model.nq, model.nv
    (9, 8)
    """
    return _models(robot, root).model


def pinocchio_models(robot: Robot, root: Root | str = "planar") -> PinocchioModels:
    """The robot's models on a planar or a free-flyer root joint, named root_joint, or on x, y, theta as ours.

    Parameters
    ----------
    robot : on a platform that moves, or, with "chain", any
    root : "planar", "freeflyer" or "chain"

    Raises
    ------
    InputError : no such root, or a robot of a fixed base on one that moves

    Examples
    --------
    >>> models = nmm.pinocchio_models(nmm.load("unicycle_2r"))
    >>> models.model.names[1]
    'root_joint'
    >>> models.collision_model.ngeoms
    8
    """
    models = _models(robot, root)
    for shapes in (models.visual_model, models.collision_model):
        read_meshes(shapes.geometryObjects, robot.name)
    return models


def _models(robot: Robot, root: Root | str) -> PinocchioModels:
    """Their meshes may be unread."""
    expect_known("root", root, ROOTS)
    model, shapes = with_wheels_fixed(robot)
    joint = ROOTS[root].joint
    head: Head = CHAIN_JOINTS if joint is None else (("root_joint", joint()),)
    if not robot.platform.coordinates:
        if joint is not None:
            raise InputError("has a fixed base", where=robot.name, expected="root 'chain' (none)", got=root)
        head = ()
    first = robot.platform.coordinates[len(CHAIN_JOINTS) :]
    replaced = len(CHAIN_JOINTS) if robot.platform.coordinates else 0
    rebuilt = rebuild(model, shapes, robot.name, first=first, head=head, replaced=replaced)
    visual, collision = rebuilt.geometries
    collision.removeAllCollisionPairs()
    for pair in robot.shapes.collision_model.collisionPairs:
        collision.addCollisionPair(pair)
    return PinocchioModels(rebuilt.model, visual, collision)


class PinocchioLayout:
    """Between a robot's coordinates and a Pinocchio model's configurations.

    Joints are matched by name; continuous ones may be (cos, sin) pairs. The model may have wheels that the
    robot leaves out (at zero), locked joints (where they are locked), and mimic joints without a number
    (`mimic=True`). A reference point apart from the model's root (`axle`) is found by common frames.

    Parameters
    ----------
    robot : the robot
    model : "planar", "freeflyer" or "chain", for a model made here; or a model of one's own, of the same file

    Attributes
    ----------
    model : the model, nq and nv as Pinocchio counts them

    Raises
    ------
    InputError : a joint that the one has and the other does not, or a root of another kind

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> planar = nmm.PinocchioLayout(robot)
    >>> planar.configuration(robot.q({"x": 1, "theta": np.pi / 2})).round(3)
    array([1., 0., 0., 1., 0., 0.])
    >>> planar.coordinates(planar.configuration(robot.rest)).round(3)
    array([0., 0., 0., 0., 0.])
    """

    def __init__(self, robot: Robot, model: pin.Model | Root = "planar") -> None:
        self.robot = robot
        self.model: pin.Model = model
        if isinstance(model, str):
            self.model = pinocchio_model(robot, model)
        elif not isinstance(model, pin.Model):
            expected = f"a pin.Model or one of {', '.join(ROOTS)}"
            raise InputError(where="model", expected=expected, got=model)
        # On a fixed base joints x, y, theta are the file's.
        own_chain = robot.q_names[:3] == CHAIN and not robot.platform.coordinates
        self._head = 0 if own_chain else replaced_joints(self.model)
        self._root = self._root_layout()
        self._pairs, self._held = self._matched()
        self._mimics = any(is_mimic(joint) for joint in self.model.joints)
        self._standing = np.array(pin.neutral(self.model))[np.newaxis]
        for joint, value in self._held.items():
            self._write(self._standing, joint, np.full(1, value))

    def configuration(self, q: ArrayLike) -> Array:
        """The model's configuration (nq,) at coordinates q (n,); or (N, nq) for a trajectory (N, n)."""
        rows, single = _rows(q, self.robot.n, "q")
        result = np.tile(self._standing, (len(rows), 1))
        if self._root is not None:
            result[:, : self._root.nq] = self._root.configuration(rows[:, :3])
        for joint, column, sign in self._pairs:
            self._write(result, joint, sign * rows[:, column])
        return result[0] if single else result

    def velocity(self, q: ArrayLike, q_dot: ArrayLike) -> Array:
        """The model's velocity (nv,) at coordinates q and their rates q_dot (n,); or (N, nv) for (N, n)."""
        rows, single = _rows(q, self.robot.n, "q")
        rates, _ = _rows(q_dot, self.robot.n, "q_dot", len(rows))
        result = np.zeros((len(rows), self.model.nv))
        if self._root is not None:
            result[:, : self._root.nv] = self._root.velocity(rows[:, :3], rates[:, :3])
        for joint, column, sign in self._pairs:
            result[:, self.model.joints[joint].idx_v] = sign * rates[:, column]
        return result[0] if single else result

    def coordinates(self, configuration: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Coordinates q (n,) of the model's configuration (nq,); or (N, n) of a trajectory (N, nq).

        theta, and joints that are (cos, sin), are known up to full turns: the first row is taken nearest to
        `near`, coordinates (n,), zero by default, every further one nearest to the one before.

        Raises
        ------
        InputError : z, roll or pitch where the robot has none, a pair or quaternion without unit length, a
            locked joint elsewhere
        """
        rows, single = _rows(configuration, self.model.nq, "configuration")
        start = self.robot.q(near if near is not None else np.zeros(self.robot.n))
        for joint, value in self._held.items():
            off = self._read(rows, joint) - value
            if self._is_angle(joint):
                off = (off + np.pi) % (2.0 * np.pi) - np.pi
            far = float(np.abs(off).max(initial=0.0))
            if far > _HELD:
                what = f"is locked at {value:g}, the configuration has it {far:g} away"
                raise InputError(what, where=f"joint {self.model.names[joint]}", got=far)
        result = np.zeros((len(rows), self.robot.n))
        turning = []
        if self._root is not None:
            result[:, :3] = self._root.coordinates(rows[:, : self._root.nq])
            turning.append(2)
        for joint, column, sign in self._pairs:
            result[:, column] = sign * self._read(rows, joint)
            if self._is_angle(joint):
                turning.append(column)
        for column in turning if len(rows) else []:
            ahead = np.concatenate([start[column : column + 1], result[:, column]])
            result[:, column] = np.unwrap(ahead)[1:]
        if self._mimics:
            result = self.robot.following.placed(result)
        return result[0] if single else result

    def rates(self, configuration: ArrayLike, velocity: ArrayLike) -> Array:
        """Rates q_dot (n,) at the model's configuration (nq,) and velocity (nv,); (N, n) for N rows of each.

        Raises
        ------
        InputError : velocities along z or about x or y, or the causes of `coordinates`
        """
        rows, single = _rows(configuration, self.model.nq, "configuration")
        v, _ = _rows(velocity, self.model.nv, "velocity", len(rows))
        q = self.coordinates(rows)
        result = np.zeros((len(rows), self.robot.n))
        if self._root is not None:
            result[:, :3] = self._root.rates(q[:, :3], v[:, : self._root.nv])
        for joint, column, sign in self._pairs:
            result[:, column] = sign * v[:, self.model.joints[joint].idx_v]
        if self._mimics:
            who = self.robot.following
            result[:, who.columns] = who.multipliers * result[:, who.leaders]
        return result[0] if single else result

    def _root_layout(self) -> ChainRoot | None:
        """How the model has x, y and theta; None for a fixed base."""
        robot, model = self.robot, self.model
        name = {0: "fixed", 3: "chain"}.get(self._head) or kind(model.joints[1]).lower()
        if bool(robot.platform.coordinates) != (name != "fixed"):
            base = "on a platform" if name == "fixed" else "of a fixed base"
            raise InputError(f"is {base}, the model has a {name} root", where=robot.name)
        if name == "fixed":
            return None
        ours, theirs = (
            {f.name: f for f in pin_model.frames if f.parentJoint == root and f.type == pin.FrameType.BODY}
            for pin_model, root in ((robot.model, 3), (model, self._head))
        )
        shared = next((name for name in ours if name in theirs), None)
        offset = pin.SE3.Identity()
        if shared is not None:
            offset = ours[shared].placement * theirs[shared].placement.inverse()
        if not robot.model.jointPlacements[1].isApprox(model.jointPlacements[1], 1e-9):
            raise InputError("the model's root joint stands elsewhere in the world", where=robot.name)
        if offset.rotation[2, 2] < 1.0 - 1e-9:
            raise InputError("the model's root is tilted against the platform's", where=robot.name)
        return ROOTS[name](np.array([*offset.translation, yaw_of(offset)]))

    def _matched(self) -> tuple[list[tuple[int, int, float]], dict[int, float]]:
        """Joints of the model with the columns of q and their signs, and those that stand at a value."""
        robot, model = self.robot, self.model
        held = robot.locked
        standing = {name for wheel in robot.wheels for name in wheel.joints}
        own = list(robot.q_names[0 if self._root is None else 3 :])
        following = [mimic.joint for mimic in robot.mimic_joints]
        pairs, still = [], {}
        for joint in range(self._head + 1, model.njoints):
            name = robot.renamed.get(str(model.names[joint]), str(model.names[joint]))
            if is_mimic(model.joints[joint]) and name in (*held, *following):
                own = [other for other in own if other != name]
                continue
            if not is_simple(model.joints[joint]):
                raise InputError("has more than one degree of freedom", where=f"the model: joint {name}")
            if name in own:
                pairs.append((joint, robot.coordinate(name), self._sign(joint, name)))
            elif name in held:
                still[joint] = float(held[name])
            elif name not in standing:
                raise no_such("joint", name, own, f"the model, of robot {robot.name}")
        columns = {column for _, column, _ in pairs}
        missing = [name for name in own if robot.coordinate(name) not in columns]
        if missing:
            steered = [wheel.swivel for wheel in robot.wheels if wheel.swivel in model.names]
            own = [name for name in missing if name in robot.platform.coordinates and steered]
            why = f": {own[0]} is nmm's own, and {', '.join(steered)} follow it" if own else ""
            hint = "; give a root (planar, freeflyer, chain) for a model made here" if own else ""
            what = f"the model has no joint {few(missing)}{why}{hint}"
            raise InputError(what, where=robot.name, got=missing)
        return pairs, still

    def _sign(self, joint: int, name: str) -> float:
        """-1 where the robot's joint has the opposite axis: a platform's own points up (`load`)."""
        ours, theirs = self.robot.model, self.model
        our_twist = twist(ours.joints[ours.getJointId(name)], pin.neutral(ours))
        their_twist = twist(theirs.joints[joint], pin.neutral(theirs))
        return math.copysign(1.0, float(np.vdot(our_twist, their_twist)))

    def _is_angle(self, joint: int) -> bool:
        return is_continuous(self.model.joints[joint])

    def _write(self, result: Array, joint: int, values: Array) -> None:
        index = self.model.joints[joint].idx_q
        if self._is_angle(joint):
            result[:, index], result[:, index + 1] = np.cos(values), np.sin(values)
        else:
            result[:, index] = values

    def _read(self, rows: Array, joint: int) -> Array:
        index = self.model.joints[joint].idx_q
        if self._is_angle(joint):
            return np.arctan2(rows[:, index + 1], rows[:, index])
        return rows[:, index]


def _rows(value: ArrayLike, length: int, name: str, count: int | None = None) -> tuple[Array, bool]:
    """N rows of `length` numbers, `count` of them; and whether a single row was given."""
    rows = array(value, name)
    if rows.ndim not in (1, 2) or rows.shape[-1] != length:
        raise InputError(where=name, expected=f"{length} numbers, or rows of them", got=rows)
    table = rows.reshape(-1, length)
    if count is not None and len(table) != count:
        raise InputError(where=name, expected=f"{count} rows", got=len(table))
    return table, rows.ndim == 1
