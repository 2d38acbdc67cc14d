"""A robot's rigid-body dynamics on its wheels, in the coordinates of its inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, positive, vector
from nmm.base.errors import InputError, expect, no_such
from nmm.model.dynamics.actuators import Actuators
from nmm.model.robots.robot import Robot, frame_index
from nmm.model.robots.wheel_rates import (
    following,
    following_dot,
    moved_by,
    rolling_dot,
    steered_by,
    wheel_rates,
    wheel_shares,
)

#: A mass, kg, or one with its place in the frame, m.
Payload = Mapping[str, "float | tuple[float, ArrayLike]"]


class Dynamics:
    """M(q) u_dot + h(q, u) = f: rigid-body dynamics reduced by the rolling of the wheels.

    With Q all joints of the robot's file, wheels included, Q_dot = T(q) S(q) u, and with Pinocchio's mass
    matrix and inverse dynamics,

        M = (T S)ᵀ M_Q T S,   f = (T S)ᵀ rnea(Q, Q_dot, Q_ddot),   h = f at u_dot = 0.

    f_j u_j is a power: f is in N for inputs in m/s, in N m for those in rad/s. A joint that others follow
    carries them. Left out are friction and the scrub of tyres, the inertia of motors, and the joints in
    `left_out`, casters mostly: they are held at zero, with their masses.

    Parameters
    ----------
    robot : whose file has masses and inertias
    payload : masses carried, kg, by the frame that carries them; or (mass, place), (3,) m in the frame

    Attributes
    ----------
    robot : the robot
    actuators : its motors: driven wheels, steering, the arm's joints
    left_out : names of the display model's joints that are held at zero

    Raises
    ------
    InputError : an unknown frame, a mass that is not above zero, a robot without any mass

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> dynamics = nmm.Dynamics(robot, payload={"ee": 0.5})
    >>> u, u_dot = [0.5, 0.2, 0.0, 0.1, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]
    >>> f = dynamics.inverse(robot.rest, u, u_dot)
    >>> np.allclose(f, dynamics.M(robot.rest) @ u_dot + dynamics.h(robot.rest, u))
    True
    """

    def __init__(self, robot: Robot, payload: Payload | None = None) -> None:
        self.robot = robot
        self.model = _loaded(robot, payload or {})
        if not sum(inertia.mass for inertia in self.model.inertias) > 0.0:
            raise InputError("no link has a mass", where=f"{robot.name}: dynamics")
        self._data = self.model.createData()
        names, self._wheels = wheel_rates(robot)
        self._at_q, self._at_wheels = self._places(robot.q_names), self._places(names)
        swivels = {wheel.joint: wheel.swivel for wheel in robot.wheels}
        # Both wheels on a swivel would give it the same angle.
        knuckles = {swivels[name]: k for k, name in enumerate(names) if swivels[name]}
        self._at_knuckles, self._knuckles = self._places(knuckles), np.array([*knuckles.values()], dtype=int)
        self._turns = np.array([_upright(self.model, name) for name in knuckles])
        moved = {*robot.q_names, *names, *knuckles}
        self.left_out = tuple(name for name in list(self.model.names)[1:] if name not in moved)
        efforts = np.array(self.model.upperEffortLimit)
        efforts = np.where((efforts > 0.0) & (efforts < 1e5), efforts, np.inf)
        self.actuators = Actuators(robot, names, self._wheels, efforts[self._at_wheels], efforts[self._at_q])

    def _places(self, names: Mapping[str, int] | tuple[str, ...]) -> Array:
        model = self.model
        return np.array([model.joints[model.getJointId(name)].idx_v for name in names], dtype=int)

    def inverse(self, q: ArrayLike, u: ArrayLike, u_dot: ArrayLike) -> Array:
        """The forces f (n_u,), or (N, n_u), that accelerate inputs u by u_dot at q: of one sample or of N."""
        return self.forces(*self._checked(q, u, u_dot))[0].reshape(np.shape(u))

    def M(self, q: ArrayLike) -> Array:
        """The mass matrix (n_u, n_u) at q (n,): kg, kg m and kg m², as the inputs' units are."""
        q = self.robot.q(q)
        TS = self._through(q[np.newaxis])[0] @ self.robot.S(q)
        M = np.triu(pin.crba(self.model, self._data, self._configuration(q[np.newaxis])[0]))
        return np.asarray(TS.T @ (M + np.triu(M, 1).T) @ TS)

    def h(self, q: ArrayLike, u: ArrayLike) -> Array:
        """Forces of gravity and of motion at constant inputs, (n_u,) at q (n,) and u (n_u,)."""
        return self.inverse(q, u, np.zeros(self.robot.n_u))

    def forces(self, q: Array, u: Array, u_dot: Array) -> tuple[Array, Array]:
        """f (N, n_u), and what the ground does to the robot, (N, 6): a force and its moment about the world's
        origin, N and N m; zeros where nothing rolls. Of N samples that were checked."""
        robot = self.robot
        p, n_p, following = robot.platform.p, robot.platform.n_p, robot.following
        motions = self.motions(q, u, u_dot)
        torques, ground = np.empty_like(motions[0]), np.zeros((len(q), 6))
        for k, (Q, Q_dot, Q_ddot) in enumerate(zip(*motions, strict=True)):
            torques[k] = pin.rnea(self.model, self._data, Q, Q_dot, Q_ddot)
            if n_p:
                ground[k] = self._data.f[1].vector
        ground[:, 3:] += np.cross(q[:, [0]] * np.eye(3)[0] if n_p else np.zeros(3), ground[:, :3])
        of_q = np.einsum("kji,kj->ki", self._through(q), torques)
        np.add.at(of_q.T, following.leaders, (following.multipliers * of_q[:, following.columns]).T)
        f = np.zeros((len(q), robot.n_u))
        G, _ = robot.platform.velocity_maps(q[:, :n_p])
        f[:, :p] = np.einsum("ki,kij->kj", of_q[:, :n_p], G)
        f[:, p:] = of_q[:, robot.arm_coordinates]
        return f, ground

    def motions(self, q: Array, u: Array, u_dot: Array) -> tuple[Array, Array, Array]:
        """All joints of the display model at N samples: angles, rates, accelerations, (N, joints)."""
        q_dot, q_ddot = self._rates(q, u, u_dot)
        T, T_dot = self._through(q), self._through_dot(q, q_dot)
        Q_dot = np.einsum("kij,kj->ki", T, q_dot)
        Q_ddot = np.einsum("kij,kj->ki", T, q_ddot) + np.einsum("kij,kj->ki", T_dot, q_dot)
        return self._configuration(q), Q_dot, Q_ddot

    def _rates(self, q: Array, u: Array, u_dot: Array) -> tuple[Array, Array]:
        """q_dot and q_ddot (N, n): S u, and S u_dot + S_dot u."""
        robot, platform = self.robot, self.robot.platform
        p, n_p, following = platform.p, platform.n_p, robot.following
        q_dot, q_ddot = np.zeros_like(q), np.zeros_like(q)
        G, G_q = platform.velocity_maps(q[:, :n_p])
        q_dot[:, :n_p] = np.einsum("kij,kj->ki", G, u[:, :p])
        q_ddot[:, :n_p] = np.einsum("kij,kj->ki", G, u_dot[:, :p])
        q_ddot[:, :n_p] += np.einsum("kijl,kl,kj->ki", G_q, q_dot[:, :n_p], u[:, :p])
        for rates, inputs in ((q_dot, u), (q_ddot, u_dot)):
            rates[:, robot.arm_coordinates] = inputs[:, p:]
            rates[:, following.columns] = following.multipliers * rates[:, following.leaders]
        return q_dot, q_ddot

    def _configuration(self, q: Array) -> Array:
        Q = np.tile(pin.neutral(self.model), (len(q), 1))
        Q[:, self._at_q] = q
        for at, k, turn in zip(self._at_knuckles, self._knuckles, self._turns, strict=True):
            wheel = self._wheels[k]
            cosine, sine, _ = following(wheel, q[:, int(wheel[4])])
            Q[:, at] = turn * np.arctan2(sine, cosine)
        return Q

    def _through(self, q: Array) -> Array:
        """T (N, joints, n) at q (N, n): Q_dot = T q_dot."""
        T = np.zeros((len(q), self.model.nv, self.robot.n))
        T[:, self._at_q, range(self.robot.n)] = 1.0
        T[:, self._at_wheels] = wheel_shares(self._wheels, q)
        for at, k, turn in zip(self._at_knuckles, self._knuckles, self._turns, strict=True):
            wheel = self._wheels[k]
            T[:, at, int(wheel[4])] = turn * following(wheel, q[:, int(wheel[4])])[2]
        return T

    def _through_dot(self, q: Array, q_dot: Array) -> Array:
        """T's rate (N, joints, n) at q and q_dot (N, n)."""
        T_dot = np.zeros((len(q), self.model.nv, self.robot.n))
        for at, wheel in zip(self._at_wheels, self._wheels, strict=True):
            delta, delta_dot = steered_by(wheel, q), steered_by(wheel, q_dot)
            rates = rolling_dot(wheel, q[:, 2], delta, q_dot[:, 2], delta_dot)
            for i, rate in zip(moved_by(wheel), rates, strict=False):
                T_dot[:, at, i] = rate
        for at, k, turn in zip(self._at_knuckles, self._knuckles, self._turns, strict=True):
            wheel, steer = self._wheels[k], int(self._wheels[k][4])
            T_dot[:, at, steer] = turn * following_dot(wheel, q[:, steer], q_dot[:, steer])
        return T_dot

    def _checked(self, q: ArrayLike, u: ArrayLike, u_dot: ArrayLike) -> tuple[Array, Array, Array]:
        arrays = [np.atleast_2d(array(x, name)) for x, name in ((q, "q"), (u, "u"), (u_dot, "u_dot"))]
        n, n_u = self.robot.n, self.robot.n_u
        for x, name, size in zip(arrays, ("q", "u", "u_dot"), (n, n_u, n_u), strict=True):
            shape = (len(arrays[0]), size)
            expect(x.shape == shape, name, f"{size} numbers, or a matrix of shape {shape}", x)
        return arrays[0], arrays[1], arrays[2]


def _loaded(robot: Robot, payload: Payload) -> pin.Model:
    """The display model with masses in frames."""
    model = robot.display_model.copy() if payload else robot.display_model
    for name, load in payload.items():
        where = f"payload: {name}"
        mass, place = load if isinstance(load, tuple | list) and len(load) == 2 else (load, np.zeros(3))
        if name not in robot.frames or not model.existFrame(name):
            raise no_such("frame", name, robot.frames, "payload")
        frame = model.frames[frame_index(model, name)]
        lever = frame.placement.act(vector(place, 3, f"{where}: place"))
        inertia = pin.Inertia(positive(mass, f"{where}: mass, kg"), lever, np.zeros((3, 3)))
        model.inertias[frame.parentJoint] = model.inertias[frame.parentJoint] + inertia
    return model


def _upright(model: pin.Model, name: str) -> float:
    """-1 where a joint's axis points down, else 1."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    joint = model.getJointId(name)
    J = pin.getJointJacobian(model, data, joint, pin.WORLD)
    return 1.0 if model.jointPlacements[1].rotation[:, 2] @ J[3:, model.joints[joint].idx_v] > 0.0 else -1.0
