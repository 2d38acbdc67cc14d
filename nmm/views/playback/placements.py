"""Where the display model's joints are, and how the bodies that carry wheels move over the ground."""

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.errors import RobotError
from nmm.model.robots.robot import Robot

#: Configurations at which an input may move a body: a steered body stands still at some.
_PROBES = 4


def rolling_joints(robot: Robot) -> tuple[str, ...]:
    """Names of the D joints of the display model that are not coordinates, the wheels', then their swivels':
    the order of all arrays of wheel angles, (D,) rad."""
    swivels = dict.fromkeys(wheel.swivel for wheel in robot.wheels if wheel.swivel)
    return (*(wheel.joint for wheel in robot.wheels), *swivels)


def base_position(robot: Robot, q: Array) -> Array:
    """The platform's x and y, (..., 2) m, for q (..., n); zeros for a fixed base."""
    return q[..., :2] if robot.platform.n_p else np.zeros((*q.shape[:-1], 2))


def joint_screw(model: pin.Model, joint: int) -> tuple[Array, Array]:
    """Linear and angular velocity (3,) for a unit of a joint's rate, at zero in the joint's frame."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, pin.neutral(model))
    screw = np.array(data.S, dtype=np.float64).reshape(6)
    return screw[:3], screw[3:]


class Placements:
    """Forward kinematics of `robot.display_model`, joints 1 to njoints - 1; `RobotError` if it lacks a
    coordinate or a wheel of the robot."""

    def __init__(self, robot: Robot) -> None:
        self.model = robot.display_model
        self._data = self.model.createData()
        self._places = [self._index(robot, name) for name in (*robot.q_names, *rolling_joints(robot))]
        self._neutral = pin.neutral(self.model)

    def _index(self, robot: Robot, name: str) -> int:
        if not self.model.existJointName(name):
            raise RobotError(f"{robot.name}: expected a joint {name!r} in the display model, there is none")
        joint = self.model.joints[self.model.getJointId(name)]
        if joint.nq != 1:
            raise RobotError(f"{robot.name}: expected one number for joint {name!r}, it has {joint.nq}")
        return int(joint.idx_q)

    def configuration(self, q: Array, wheels: Array) -> Array:
        full = self._neutral.copy()
        full[self._places] = np.concatenate([q, wheels])
        return full

    def relative(self, q: Array, wheels: Array) -> Array:
        """Placement of each joint in its parent joint's frame, (joints, 4, 4)."""
        return self._matrices(q, wheels, self._data.liMi)

    def world(self, q: Array, wheels: Array) -> Array:
        """Placement of each joint in the world, (joints, 4, 4)."""
        return self._matrices(q, wheels, self._data.oMi)

    def _matrices(self, q: Array, wheels: Array, placements: Sequence[pin.SE3]) -> Array:
        pin.forwardKinematics(self.model, self._data, self.configuration(q, wheels))
        return np.array([placements[i].homogeneous for i in range(1, self.model.njoints)]).reshape(-1, 4, 4)


def position_and_quaternion(matrices: Array) -> tuple[Array, Array]:
    """Positions (…, 3) and quaternions (…, 4) in the order x, y, z, w, of placements (…, 4, 4)."""
    flat = matrices.reshape(-1, 4, 4)
    quaternions = np.array([pin.Quaternion(np.ascontiguousarray(m[:3, :3])).coeffs() for m in flat])
    shape = matrices.shape[:-2]
    return flat[:, :3, 3].reshape(*shape, 3), quaternions.reshape(*shape, 4)


class Carriers:
    """C bodies of a robot, by the joint that carries each: "theta", one of the platform's own, "universe".

    Joints between body and root are upright, so each motion is a planar twist: the velocity of the joint's
    origin along the body's two level axes, and its turning about the vertical. A twist is in the frame `axes`
    (C, 3, 3), whose columns are these axes and the vertical in the joint's frame.
    """

    def __init__(self, robot: Robot, names: Sequence[str]) -> None:
        model = robot.model
        self.robot = robot
        self.names = tuple(dict.fromkeys(names))
        self._ids = [self._joint(name) for name in self.names]
        self._data = model.createData()
        pin.forwardKinematics(model, self._data, np.zeros(model.nq))
        # The ground's frame: a root away from the world's origin keeps its place.
        self._ground = pin.SE3(model.jointPlacements[1]) if robot.platform.n_p else pin.SE3.Identity()
        placements = [self._data.oMi[joint] for joint in self._ids]
        self.axes = np.array([_level_axes(self._ground.rotation.T @ p.rotation) for p in placements])
        self.axes = self.axes.reshape(-1, 3, 3)
        # Heading at zero, and dψ/dq (n,) of it: ±1 for the upright joints above the body.
        forward = [
            self._ground.rotation.T @ placement.rotation @ axes[:, 0]
            for placement, axes in zip(placements, self.axes, strict=True)
        ]
        self._heading = np.array([np.arctan2(x[1], x[0]) for x in forward])
        pin.computeJointJacobians(model, self._data, np.zeros(model.nq))
        jacobians = [self._of(joint, pin.getJointJacobian, pin.WORLD) for joint in self._ids]
        up = self._ground.rotation[:, 2]
        self._turning = np.array([np.round(up @ J[3:]) for J in jacobians]).reshape(-1, robot.n)

    def _joint(self, name: str) -> int:
        if not self.robot.model.existJointName(name):
            raise RobotError(
                f"{self.robot.name}: expected a joint {name!r} that carries wheels, there is none"
            )
        return int(self.robot.model.getJointId(name))

    def _of(self, joint: int, matrix: Callable[..., Array], axes: pin.ReferenceFrame = pin.LOCAL) -> Array:
        """A joint's Jacobian or its rate (6, n), as Pinocchio computed it; zeros for the universe."""
        model = self.robot.model
        return np.asarray(matrix(model, self._data, joint, axes)) if joint else np.zeros((6, model.nv))

    def planar(self, carrier: int, vector: Array) -> Array:
        """Components (2,), along the body's level axes, of a vector (3,) in the joint's frame."""
        return np.asarray(self.axes[carrier].T[:2] @ vector)

    def twists(self, q: Array, q_dot: Array) -> Array:
        """Twists (C, 3) at q (n,) with velocity q_dot (n,)."""
        pin.computeJointJacobians(self.robot.model, self._data, q)
        return self._level([self._of(joint, pin.getJointJacobian) @ q_dot for joint in self._ids])

    def twist_rates(self, q: Array, q_dot: Array, g: Array, g_dot: Array) -> Array:
        """Rates (C, 3) of the twists of g (n,), which changes by g_dot, while the robot moves with q_dot."""
        pin.computeJointJacobiansTimeVariation(self.robot.model, self._data, q, q_dot)
        return self._level(
            [
                self._of(joint, pin.getJointJacobian) @ g_dot
                + self._of(joint, pin.getJointJacobianTimeVariation) @ g
                for joint in self._ids
            ]
        )

    def _level(self, motions: list[Array]) -> Array:
        """Twists (C, 3) of the joints' motions (6,), in their frames."""
        levels = [
            [*(axes.T[:2] @ motion[:3]), axes.T[2] @ motion[3:]]
            for axes, motion in zip(self.axes, motions, strict=True)
        ]
        return np.array(levels).reshape(-1, 3)

    def steps(self, q: Array) -> Array:
        """Twists (N - 1, C, 3) that take each configuration of q (N, n) to the next in 1 s along an arc:
        exact where bodies move along arcs, third order in the step otherwise."""
        places = np.array([self._places(joint, q) for joint in self._ids]).reshape(-1, len(q), 2)
        places = places.transpose(1, 0, 2)
        headings = self._heading + q @ self._turning.T
        turns = np.diff(headings, axis=0)
        # The chord of an arc is shorter than the arc by this factor. A turn of more than half a revolution
        # between two samples does not determine the arc, so the chord is taken as it is.
        shorter = np.where(np.abs(turns) < np.pi, np.sinc(turns / (2.0 * np.pi)), 1.0)
        moved = np.diff(places, axis=0) / shorter[..., np.newaxis]
        middle = headings[:-1] + 0.5 * turns
        cosine, sine = np.cos(middle), np.sin(middle)
        along = cosine * moved[..., 0] + sine * moved[..., 1]
        across = cosine * moved[..., 1] - sine * moved[..., 0]
        return np.stack([along, across, turns], axis=-1)

    def _places(self, joint: int, q: Array) -> Array:
        """A joint's origin on the ground, (N, 2), for q (N, n), all samples at once."""
        model, data = self.robot.model, self._data
        pin.computeJointJacobians(model, data, np.zeros(model.nq))
        place, turned = np.zeros((len(q), 2)), np.zeros(len(q))
        before = np.zeros(2)
        for above in list(model.supports[joint])[1:]:
            at = self._ground.actInv(data.oMi[above].translation)[:2]
            columns = pin.getJointJacobian(model, data, above, pin.LOCAL_WORLD_ALIGNED)
            column = model.joints[above].idx_v
            slide = self._ground.rotation.T @ columns[:3, column]
            turn = self._ground.rotation[:, 2] @ columns[3:, column]
            offset = (at - before) + slide[:2] * q[:, [column]]
            cosine, sine = np.cos(turned), np.sin(turned)
            place[:, 0] += cosine * offset[:, 0] - sine * offset[:, 1]
            place[:, 1] += sine * offset[:, 0] + cosine * offset[:, 1]
            turned = turned + np.round(turn) * q[:, column]
            before = at
        return place

    def moving_inputs(self, carrier: int, point: Array) -> list[int]:
        """Inputs that move a body's point (2,), along its level axes, at some configuration."""
        random = np.random.default_rng(0)
        moving = np.zeros(self.robot.n_u, dtype=bool)
        for _ in range(_PROBES):
            q = random.uniform(-0.5, 0.5, self.robot.n)
            for j, column in enumerate(self.robot.S(q).T):
                velocity = at_point(self.twists(q, column)[carrier], point)
                moving[j] |= bool(np.linalg.norm(velocity) > 1e-9)
        return [int(j) for j in np.flatnonzero(moving)]


def at_point(twist: Array, point: Array) -> Array:
    """Velocity (…, 2) of a body's point (2,) for its twist (…, 3)."""
    turn = twist[..., 2]
    return np.stack([twist[..., 0] - turn * point[1], twist[..., 1] + turn * point[0]], axis=-1)


def _level_axes(rotation: Array) -> Array:
    """Columns: two level axes and the vertical, in the axes of a body with this orientation (3, 3)."""
    up = rotation[2]
    # The body's own x axis, or y where x is upright.
    first = np.eye(3)[0 if abs(up[0]) < 0.9 else 1]
    first = first - up * (up @ first)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(up, first), up])
