"""How the bodies that carry wheels move over the ground: in the plane, each in its own axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.errors import RobotError
from nmm.robots.robot import Robot

# Inputs move a body when they do at one of so many configurations: a steered body stands still at some.
_PROBES = 4


class Carriers:
    """C bodies of a robot, by the joint that carries each: "theta", one of the platform's own, "universe".

    Every joint between such a body and the root is upright, so that a motion is a planar twist: the velocity
    of the joint's origin along the body's two level axes, and its turning about the vertical. A twist
    is in the frame `axes` (C, 3, 3), whose columns are these axes and the vertical in the joint's frame.

    Raises
    ------
    RobotError : a name that is no joint of `robot.model`
    """

    def __init__(self, robot: Robot, names: Sequence[str]) -> None:
        model = robot.model
        self.robot = robot
        self.names = tuple(dict.fromkeys(names))
        self._ids = [self._joint(name) for name in self.names]
        self._data = model.createData()
        pin.forwardKinematics(model, self._data, np.zeros(model.nq))
        # The ground's frame: a root that is not at the world's origin keeps its place there.
        self._ground = pin.SE3(model.jointPlacements[1]) if robot.platform.n_p else pin.SE3.Identity()
        placements = [self._data.oMi[joint] for joint in self._ids]
        self.axes = np.array([_level_axes(self._ground.rotation.T @ p.rotation) for p in placements])
        self.axes = self.axes.reshape(-1, 3, 3)
        # Heading at zero, and how each coordinate turns the body.
        forward = [
            self._ground.rotation.T @ placement.rotation @ axes[:, 0]
            for placement, axes in zip(placements, self.axes, strict=True)
        ]
        self._heading = np.array([np.arctan2(x[1], x[0]) for x in forward])
        self._turning = np.array([self._turned_by(joint) for joint in self._ids]).reshape(-1, robot.n)

    def _joint(self, name: str) -> int:
        if not self.robot.model.existJointName(name):
            raise RobotError(
                f"{self.robot.name}: expected a joint {name!r} that carries wheels, there is none"
            )
        return int(self.robot.model.getJointId(name))

    def _turned_by(self, joint: int) -> Array:
        """dψ/dq of the body's heading, (n,): +-1 for the upright joints above it."""
        model = self.robot.model
        turning = np.zeros(self.robot.n)
        pin.computeJointJacobians(model, self._data, np.zeros(model.nq))
        if joint:
            jacobian = pin.getJointJacobian(model, self._data, joint, pin.WORLD)
            turning[:] = np.round(self._ground.rotation[:, 2] @ jacobian[3:])
        return turning

    def planar(self, carrier: int, vector: Array) -> Array:
        """A vector (3,) in the joint's frame along the body's level axes, (2,)."""
        return np.asarray(self.axes[carrier].T[:2] @ vector)

    def twists(self, q: Array, q_dot: Array) -> Array:
        """Twists (C, 3) at q (n,) for the velocity q_dot (n,)."""
        model, data = self.robot.model, self._data
        pin.computeJointJacobians(model, data, q)
        return self._level([_jacobian(model, data, joint) @ q_dot for joint in self._ids])

    def twist_rates(self, q: Array, q_dot: Array, g: Array, g_dot: Array) -> Array:
        """Rates of change of the twists (C, 3) of a velocity g (n,), while the robot moves with q_dot (n,)
        and g changes by g_dot (n,)."""
        model, data = self.robot.model, self._data
        pin.computeJointJacobiansTimeVariation(model, data, q, q_dot)
        motions = []
        for joint in self._ids:
            motion = _jacobian(model, data, joint) @ g_dot
            if joint:
                motion += pin.getJointJacobianTimeVariation(model, data, joint, pin.LOCAL) @ g
            motions.append(motion)
        return self._level(motions)

    def _level(self, motions: list[Array]) -> Array:
        """Twists (C, 3) of the motions (6,) of the joints, in their frames."""
        levels = [
            [*(axes.T[:2] @ motion[:3]), axes.T[2] @ motion[3:]]
            for axes, motion in zip(self.axes, motions, strict=True)
        ]
        return np.array(levels).reshape(-1, 3)

    def steps(self, q: Array) -> Array:
        """From each configuration in q (N, n) to the next: the twist, (N - 1, C, 3), that gets there in 1 s.

        The bodies are taken to move along arcs, at constant twists: exact where they do, third order in
        the step otherwise.
        """
        places = np.zeros((len(q), len(self._ids), 2))
        for k, joint in enumerate(self._ids):
            places[:, k] = self._places(joint, q)
        headings = self._heading + q @ self._turning.T
        turns = np.diff(headings, axis=0)
        # The chord of an arc is shorter than the arc by this factor. A turn of more than half a
        # revolution between two samples says nothing about the arc, so the chord is taken as it is.
        shorter = np.where(np.abs(turns) < np.pi, np.sinc(turns / (2.0 * np.pi)), 1.0)
        moved = np.diff(places, axis=0) / shorter[..., np.newaxis]
        middle = headings[:-1] + 0.5 * turns
        cosine, sine = np.cos(middle), np.sin(middle)
        along = cosine * moved[..., 0] + sine * moved[..., 1]
        across = cosine * moved[..., 1] - sine * moved[..., 0]
        return np.stack([along, across, turns], axis=-1)

    def _places(self, joint: int, q: Array) -> Array:
        """Where a joint's origin is on the ground, (N, 2), for q (N, n), all samples at once."""
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
        """The inputs that move a point (2,) of a body, along its level axes, at some configuration."""
        random = np.random.default_rng(0)
        found = np.zeros(self.robot.n_u, dtype=bool)
        for _ in range(_PROBES):
            q = random.uniform(-0.5, 0.5, self.robot.n)
            for j, column in enumerate(self.robot.S(q).T):
                velocity = at_point(self.twists(q, column)[carrier], point)
                found[j] |= bool(np.linalg.norm(velocity) > 1e-9)
        return [int(j) for j in np.flatnonzero(found)]


def at_point(twist: Array, point: Array) -> Array:
    """Velocity (…, 2) of a point (2,) of a body for its twist (…, 3)."""
    turn = twist[..., 2]
    return np.stack([twist[..., 0] - turn * point[1], twist[..., 1] + turn * point[0]], axis=-1)


def _jacobian(model: pin.Model, data: pin.Data, joint: int) -> Array:
    """Of the joint's frame, in its own axes, (6, n); the universe has none."""
    if not joint:
        return np.zeros((6, model.nv))
    return np.asarray(pin.getJointJacobian(model, data, joint, pin.LOCAL))


def _level_axes(rotation: Array) -> Array:
    """Columns: two level axes and the vertical in the axes of a body with this orientation (3, 3)."""
    up = rotation[2]
    # The body's own x axis, or y where x stands upright.
    first = np.eye(3)[0 if abs(up[0]) < 0.9 else 1]
    first = first - up * (up @ first)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(up, first), up])
