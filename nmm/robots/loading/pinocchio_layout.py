"""To and from Pinocchio's own layouts, for people who share configurations with Pink, Crocoddyl and others.

Ours is q = [x, y, theta, ...] with theta an unwrapped angle, and q_dot its plain derivative. A planar root
has the configuration (x, y, cos θ, sin θ), a free flyer (x, y, z, quaternion x y z w); the velocity of both
is the root body's, along its own axes.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.arrays import Array, array
from nmm.errors import InputError, expect_known, unknown
from nmm.robots.loading.chain import CHAIN_JOINTS, Head, rebuild, replaced_joints
from nmm.robots.loading.joint_kinds import is_continuous, is_mimic, is_simple, kind
from nmm.robots.loading.provenance import parts_of
from nmm.robots.loading.reduction import at_zero
from nmm.robots.loading.root_layout import ROOTS, ChainRoot, RootLayout
from nmm.robots.meshes import read_meshes
from nmm.robots.robot import Robot

Root = Literal["planar", "freeflyer", "chain"]

# How far a locked joint may be from where it is locked, rad or m.
_HELD = 1e-6


class PinocchioModels(NamedTuple):
    """A robot's models as other tools take them; wheels stand still.

    Examples
    --------
    >>> models = nmm.pinocchio_models(nmm.load("unicycle_2r"))
    >>> isinstance(models, nmm.PinocchioModels), models.model.nv, len(models.visual_model.geometryObjects) > 0
    (True, 5, True)
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
    """The models, whose meshes need not be read yet."""
    expect_known("root", root, ROOTS)
    rolling = dict.fromkeys(name for wheel in robot.wheels for name in wheel.joints)
    shapes = robot.shapes.visual_model, parts_of(robot).collision_model
    model, shapes = at_zero(robot.display_model, shapes, rolling)
    if not robot.platform.coordinates:
        if root != "chain":
            raise InputError(f"{robot.name} has a fixed base: expected root 'chain' (none), got {root!r}")
        head: Head = ()
    else:
        joint = ROOTS[root].joint()
        head = CHAIN_JOINTS if joint is None else (("root_joint", joint),)
    first = robot.platform.coordinates[len(CHAIN_JOINTS) :]
    rebuilt = rebuild(model, shapes, robot.name, first=first, head=head)
    visual, collision = rebuilt.geometries
    collision.removeAllCollisionPairs()
    for pair in robot.shapes.collision_model.collisionPairs:
        collision.addCollisionPair(pair)
    return PinocchioModels(rebuilt.model, visual, collision)


class PinocchioLayout:
    """Between a robot's coordinates and a Pinocchio model's configurations.

    Joints are matched by name, continuous ones may be (cos, sin) pairs; the model may have the wheels that
    the robot leaves out (they stand at zero) and the joints that were locked (they stand where they are
    locked). Joints that follow others may be without a number in the model (`mimic=True`). The reference
    point may be elsewhere than the model's root (`axle`): it is found by the frames that both have.

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
            raise InputError(f"expected a pin.Model or one of {', '.join(ROOTS)}, got {model!r}")
        self._head = replaced_joints(self.model)
        self._root = self._root_layout()
        self._pairs, self._held = self._matched()
        self._mimics = any(is_mimic(joint) for joint in self.model.joints)

    def configuration(self, q: ArrayLike) -> Array:
        """The model's configuration (nq,) at coordinates q (n,); or (N, nq) for a trajectory (N, n)."""
        rows, single = _rows(q, self.robot.n, "q")
        result = np.tile(np.array(pin.neutral(self.model)), (len(rows), 1))
        result[:, : self._root.nq] = self._root.configuration(rows[:, : self._n_root])
        for joint, column in self._pairs:
            self._write(result, joint, rows[:, column])
        for joint, value in self._held.items():
            self._write(result, joint, np.full(len(rows), value))
        return result[0] if single else result

    def velocity(self, q: ArrayLike, q_dot: ArrayLike) -> Array:
        """The model's velocity (nv,) at coordinates q and their rates q_dot (n,); or (N, nv) for (N, n)."""
        rows, single = _rows(q, self.robot.n, "q")
        rates, _ = _rows(q_dot, self.robot.n, "q_dot")
        _same_length(rows, rates, "q_dot")
        result = np.zeros((len(rows), self.model.nv))
        k = self._n_root
        result[:, : self._root.nv] = self._root.velocity(rows[:, :k], rates[:, :k])
        for joint, column in self._pairs:
            result[:, self.model.joints[joint].idx_v] = rates[:, column]
        return result[0] if single else result

    def coordinates(self, configuration: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Coordinates q (n,) of the model's configuration (nq,); or (N, n) of a trajectory (N, nq).

        theta, and joints that the model has as (cos, sin), are known up to full turns: the (first) one is
        taken nearest to `near`, coordinates (n,), zero by default, and every further one nearest to the one
        before.

        Raises
        ------
        InputError : z, roll or pitch where the robot has none, a pair or quaternion without unit length, a
            locked joint elsewhere
        """
        rows, single = _rows(configuration, self.model.nq, "configuration")
        start = self.robot.q(near if near is not None else np.zeros(self.robot.n))
        for joint, value in self._held.items():
            off = np.abs(_wrapped(self._read(rows, joint) - value, self._is_angle(joint)))
            if off.size and off.max() > _HELD:
                raise InputError(
                    f"joint {self.model.names[joint]} is locked at {value:g}, the configuration has it "
                    f"{off.max():g} away"
                )
        result = np.zeros((len(rows), self.robot.n))
        result[:, : self._n_root] = self._root.coordinates(rows[:, : self._root.nq])
        turning = [2] if self._n_root else []
        for joint, column in self._pairs:
            result[:, column] = self._read(rows, joint)
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
        v, _ = _rows(velocity, self.model.nv, "velocity")
        _same_length(rows, v, "velocity")
        q = self.coordinates(rows)
        result = np.zeros((len(rows), self.robot.n))
        k = self._n_root
        result[:, :k] = self._root.rates(q[:, :k], v[:, : self._root.nv])
        for joint, column in self._pairs:
            result[:, column] = v[:, self.model.joints[joint].idx_v]
        if self._mimics:
            who = self.robot.following
            result[:, who.columns] = who.multipliers * result[:, who.leaders]
        return result[0] if single else result

    @property
    def _n_root(self) -> int:
        """How many coordinates the root stands for: x, y and theta, or none."""
        return 3 if self.robot.platform.coordinates else 0

    def _root_layout(self) -> RootLayout:
        robot, model = self.robot, self.model
        name = {0: "fixed", 3: "chain"}.get(self._head) or kind(model.joints[1]).lower()
        if not self._n_root or name == "fixed":
            if self._n_root or name != "fixed":
                base = "of a fixed base" if not self._n_root else "on a platform"
                raise InputError(f"{robot.name} is {base}, the model has a {name} root")
            return ChainRoot(np.zeros(4), count=0)
        theirs = {
            f.name: f for f in model.frames if f.parentJoint == self._head and f.type == pin.FrameType.BODY
        }
        offset = pin.SE3.Identity()
        for frame in robot.model.frames:
            if frame.type == pin.FrameType.BODY and frame.parentJoint == 3 and frame.name in theirs:
                offset = frame.placement * theirs[frame.name].placement.inverse()
                break
        if not robot.model.jointPlacements[1].isApprox(model.jointPlacements[1], 1e-9):
            raise InputError(f"{robot.name}: the model's root joint stands elsewhere in the world")
        if offset.rotation[2, 2] < 1.0 - 1e-9:
            raise InputError(f"{robot.name}: the model's root is tilted against the platform's")
        yaw = np.arctan2(offset.rotation[1, 0], offset.rotation[0, 0])
        return ROOTS[name](np.array([*offset.translation, yaw]))

    def _matched(self) -> tuple[list[tuple[int, int]], dict[int, float]]:
        """Joints of the model with the columns of q, and those that stand at a value."""
        robot, model = self.robot, self.model
        held = robot.locked
        standing = {name for wheel in robot.wheels for name in wheel.joints}
        own = list(robot.q_names[self._n_root :])
        following = [one.joint for one in robot.followers]
        pairs, still = [], {}
        for joint in range(self._head + 1, model.njoints):
            name = str(model.names[joint])
            if is_mimic(model.joints[joint]) and name in (*held, *following):
                own = [other for other in own if other != name]
                continue
            if not is_simple(model.joints[joint]):
                raise InputError(f"joint {name} of the model has more than one degree of freedom")
            if name in own:
                pairs.append((joint, robot.coordinate(name)))
            elif name in held:
                still[joint] = float(held[name])
            elif name not in standing:
                raise InputError(unknown("joint", name, own, f"the model, of robot {robot.name}"))
        names = {str(model.names[joint]) for joint, _ in pairs}
        missing = [name for name in own if name not in names]
        if missing:
            steered = [wheel.swivel for wheel in robot.wheels if wheel.swivel in model.names]
            own = [name for name in missing if name in robot.platform.coordinates and steered]
            why = f": {own[0]} is nmm's own, and {', '.join(steered)} follow it" if own else ""
            hint = "; give a root (planar, freeflyer, chain) for a model made here" if own else ""
            raise InputError(f"{robot.name}: the model has no joint {', '.join(missing)}{why}{hint}")
        return pairs, still

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


def _rows(value: ArrayLike, length: int, name: str) -> tuple[Array, bool]:
    """N rows of `length` numbers, and whether one was given without the list."""
    rows = array(value, name)
    if rows.ndim not in (1, 2) or rows.shape[-1] != length:
        raise InputError(f"{name}: expected {length} numbers, or rows of them, got shape {rows.shape}")
    return rows.reshape(-1, length), rows.ndim == 1


def _same_length(rows: Array, others: Array, name: str) -> None:
    if len(rows) != len(others):
        raise InputError(f"{name}: expected {len(rows)} rows, got {len(others)}")


def _wrapped(difference: Array, angle: bool) -> Array:
    return (difference + np.pi) % (2.0 * np.pi) - np.pi if angle else difference
