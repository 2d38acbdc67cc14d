"""A robot at a configuration: holding one proves that its kinematics were computed there."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, unwritable
from nmm.model.robots.joint_table import placement_rows
from nmm.model.robots.robot import CENTER_OF_MASS, Robot

#: Velocity of the frame's origin, in world axes.
JACOBIAN_FRAME = pin.LOCAL_WORLD_ALIGNED

#: Pinocchio's data of configurations that are gone, for the next ones of the same robot.
_spare_data: WeakKeyDictionary[Robot, list[pin.Data]] = WeakKeyDictionary()


class Configuration:
    """Kinematics of `robot` at `q`, in world axes (Pinocchio's LOCAL_WORLD_ALIGNED).

    Parameters
    ----------
    robot : the robot
    q : (n,) coordinates in m and rad, or a mapping from their names

    Raises
    ------
    InputError : wrong length, a number that is not finite, an unknown name

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q1": np.pi / 2}))
    >>> here.placement("ee").translation.round(3)
    array([0.3, 0.8, 0.4])
    >>> here.jacobian("ee").shape
    (6, 5)
    """

    def __init__(self, robot: Robot, q: ArrayLike) -> None:
        self._compute(robot, robot.q(q), _spare_data.setdefault(robot, []))

    def _compute(self, robot: Robot, q: Array, spare: list[pin.Data]) -> None:
        self.robot = robot
        self.q = unwritable(q)
        self._spare = spare
        try:
            self._data = spare.pop()
        except IndexError:
            self._data = robot.model.createData()
        pin.computeJointJacobians(robot.model, self._data, q)
        self._hessians_computed = False
        self._neighbours: list[tuple[Configuration, Configuration]] = []

    def neighbours(self, step: float) -> list[tuple[Configuration, Configuration]]:
        """For each coordinate, a step (m, rad) ahead and behind along it; kept until forgotten, so that all
        functions with differences for derivatives share their kinematics."""
        if not self._neighbours:
            steps = step * np.eye(self.robot.n)
            self._neighbours = [(self._elsewhere(self.q + s), self._elsewhere(self.q - s)) for s in steps]
        return self._neighbours

    def forget_neighbours(self) -> None:
        """Forget them: the configuration itself may be kept."""
        self._neighbours = []

    def _elsewhere(self, q: Array) -> Configuration:
        """The robot at q (n,), without checks: no user gave it."""
        configuration = object.__new__(Configuration)
        configuration._compute(self.robot, q, self._spare)
        return configuration

    def __del__(self) -> None:
        # Its data of Pinocchio are free for another: making them anew is three quarters of
        # what a configuration costs.
        if "_data" in self.__dict__:
            self._spare.append(self._data)

    def __copy__(self) -> Configuration:
        return self  # as values are: nothing of it changes

    def __deepcopy__(self, memo: dict[int, object]) -> Configuration:
        return self

    def __reduce__(self) -> tuple[type[Configuration], tuple[Robot, Array]]:
        return Configuration, (self.robot, self.q)

    @cached_property
    def S(self) -> Array:
        """S(q), shape (n, n_u): q_dot = S(q) u."""
        return self.robot.S(self.q)

    def placement(self, frame: str) -> pin.SE3:
        """Pose of a frame in the world."""
        return pin.SE3(pin.updateFramePlacement(self.robot.model, self._data, self.robot.frame_id(frame)))

    def jacobian(self, frame: str) -> Array:
        """dv/dq_dot of a frame, shape (6, n): linear (m) over angular (rad) rows, in world axes."""
        frame_id = self.robot.frame_id(frame)
        pin.updateFramePlacement(self.robot.model, self._data, frame_id)
        jacobian = pin.getFrameJacobian(self.robot.model, self._data, frame_id, JACOBIAN_FRAME)
        return np.array(jacobian, order="C").reshape(6, self.robot.n)

    def center_of_mass(self) -> tuple[Array, Array]:
        """Centre of mass (3,) in the world, m, and its Jacobian in the coordinates, (3, n)."""
        return _center_of_mass(self.robot, self._data)(self.q)

    def hessian(self, frame: str) -> Array:
        """H[i, j, k] = d jacobian[i, j] / dq[k], shape (6, n, n)."""
        if not self._hessians_computed:
            pin.computeJointKinematicHessians(self.robot.model, self._data)
            self._hessians_computed = True
        frame_id = self.robot.frame_id(frame)
        pin.updateFramePlacement(self.robot.model, self._data, frame_id)
        hessian = pin.getFrameKinematicHessian(self.robot.model, self._data, frame_id, JACOBIAN_FRAME)
        return frame_hessian(hessian)


def frame_hessian(raw: Array) -> Array:
    """Pinocchio's kinematic Hessian in the right memory order."""
    return np.ascontiguousarray(raw.ravel().reshape(raw.shape, order="F"))


def kinematics_updater(
    robot: Robot, frames: tuple[str, ...], placements: Array, jacobians: Array, hessians: Array
) -> Callable[[float, Array], None]:
    """update(t, q): writes the kinematics of k frames at q (n,), world axes, without allocating: `placements`
    (k, 3, 4) = [R | p], `jacobians` (k, 6, n) and, unless empty, `hessians` (k, 6, n, n). It does not read t.
    The frame `CENTER_OF_MASS` is the point, with world axes."""
    model, data = robot.model, robot.model.createData()
    compute_jacobians, update_placement = pin.computeJointJacobians, pin.updateFramePlacement
    frame_jacobian, axes = pin.getFrameJacobian, JACOBIAN_FRAME
    ids = {slot: robot.frame_id(name) for slot, name in enumerate(frames) if name != CENTER_OF_MASS}
    rows = placement_rows(data.oMf)
    # Pinocchio's Jacobian of a model with one joint is a vector.
    matrices = jacobians[:, :, 0] if model.nv == 1 else jacobians
    work = [
        (frame_id, placements[slot], rows[frame_id].reshape(4, 3).T, matrices[slot])
        for slot, frame_id in ids.items()
    ]

    # Local names, not attributes: a third of this function's own time is looking things up.
    def update(t: float, q: Array) -> None:
        compute_jacobians(model, data, q)
        for frame_id, placement, source, jacobian in work:
            update_placement(model, data, frame_id)
            placement[...] = source
            jacobian[...] = frame_jacobian(model, data, frame_id, axes)

    def update_with_hessians(t: float, q: Array) -> None:
        update(t, q)
        pin.computeJointKinematicHessians(model, data)
        for slot, frame_id in ids.items():  # no function asks for that of the centre of mass
            hessians[slot] = frame_hessian(pin.getFrameKinematicHessian(model, data, frame_id, axes))

    frames_only = update_with_hessians if hessians.size else update
    if CENTER_OF_MASS not in frames:
        return frames_only
    point = frames.index(CENTER_OF_MASS)
    center_of_mass = _center_of_mass(robot, model.createData())
    placements[point, :, :3] = np.eye(3)

    def update_all(t: float, q: Array) -> None:
        frames_only(t, q)
        placements[point, :, 3], jacobians[point, :3] = center_of_mass(q)

    return update_all


def _center_of_mass(robot: Robot, data: pin.Data) -> Callable[[Array], tuple[Array, Array]]:
    """com(q) -> centre of mass (3,) and its Jacobian (3, n), with what stands still."""
    model = robot.model
    standing = model.inertias[0]  # the root link's of a fixed base, which Pinocchio leaves out
    moving = pin.computeTotalMass(model, data)
    share = moving / (moving + standing.mass)
    fixed_part = (1.0 - share) * np.array(standing.lever)

    def at(q: Array) -> tuple[Array, Array]:
        jacobian = np.array(pin.jacobianCenterOfMass(model, data, q, False), order="C").reshape(3, model.nv)
        if share == 0.0:
            return fixed_part, np.zeros_like(jacobian)
        return share * np.array(data.com[0]) + fixed_part, share * jacobian

    return at
