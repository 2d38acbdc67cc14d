"""A robot at a configuration: holding one proves that its kinematics were computed there."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.arrays import Array, unwritable
from nmm.errors import NmmError
from nmm.robots.robot import CENTER_OF_MASS, Robot

#: Velocity of the frame's origin, in world axes.
JACOBIAN_FRAME = pin.LOCAL_WORLD_ALIGNED

#: Pinocchio's data of configurations that nobody holds any more, for the next ones of the same robot.
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
        """For each coordinate, a step (m, rad) ahead and behind along it; the same until forgotten.

        All functions whose derivatives are differences take these: their kinematics are computed once.
        """
        if not self._neighbours:
            for j in range(self.robot.n):
                ahead, behind = self.q.copy(), self.q.copy()
                ahead[j] += step
                behind[j] -= step
                self._neighbours.append((self._elsewhere(ahead), self._elsewhere(behind)))
        return self._neighbours

    def forget_neighbours(self) -> None:
        """Let go of them: someone may keep the configuration."""
        self._neighbours = []

    def _elsewhere(self, q: Array) -> Configuration:
        """The robot at q (n,), taken as it is: nobody typed it in."""
        found = object.__new__(Configuration)
        found._compute(self.robot, q, self._spare)
        return found

    def __del__(self) -> None:
        # Nobody holds it, so nobody reads Pinocchio's data any more: making them anew is three quarters of
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
        """H[i, j, k] = d jacobian[i, j] / dq[k], shape (6, n, n).

        Pinocchio returns the array with the wrong memory order; it is put right here.
        """
        if not self._hessians_computed:
            pin.computeJointKinematicHessians(self.robot.model, self._data)
            self._hessians_computed = True
        frame_id = self.robot.frame_id(frame)
        pin.updateFramePlacement(self.robot.model, self._data, frame_id)
        hessian = pin.getFrameKinematicHessian(self.robot.model, self._data, frame_id, JACOBIAN_FRAME)
        return frame_hessian(hessian)


def frame_hessian(raw: Array) -> Array:
    """Pinocchio's kinematic Hessian with its memory order put right (see `Configuration.hessian`)."""
    return np.ascontiguousarray(raw.ravel().reshape(raw.shape, order="F"))


def kinematics_updater(
    robot: Robot, frames: tuple[str, ...], placements: Array, jacobians: Array, hessians: Array
) -> Callable[[float, Array], None]:
    """What a control loop uses where a `Configuration` would allocate.

    The function returned, `update(t, q)`, computes the kinematics of k frames at q (n,), float64,
    in world axes: `placements` (k, 3, 4) = [R | p], `jacobians` (k, 6, n) and, if it is not empty,
    `hessians` (k, 6, n, n). The time is not read. The frame `CENTER_OF_MASS` is the point, with world axes.
    """
    if CENTER_OF_MASS in frames:
        return _with_center_of_mass(robot, frames, placements, jacobians, hessians)
    model, data = robot.model, robot.model.createData()
    compute_jacobians, update_placement = pin.computeJointJacobians, pin.updateFramePlacement
    frame_jacobian, axes = pin.getFrameJacobian, JACOBIAN_FRAME
    ids = [robot.frame_id(name) for name in frames]
    work = [
        (frame_id, placements[slot], _matrix_view(data.oMf[frame_id]), jacobians[slot])
        for slot, frame_id in enumerate(ids)
    ]

    if model.nv == 1:  # Pinocchio's Jacobian is then a vector
        jacobians = jacobians[:, :, 0]
        work = [(*item[:3], jacobians[slot]) for slot, item in enumerate(work)]

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
        for hessian, frame_id in zip(hessians, ids, strict=True):
            hessian[...] = frame_hessian(pin.getFrameKinematicHessian(model, data, frame_id, axes))

    return update_with_hessians if hessians.size else update


def _center_of_mass(robot: Robot, data: pin.Data) -> Callable[[Array], tuple[Array, Array]]:
    """com(q) -> centre of mass (3,) and its Jacobian (3, n), with what stands still.

    Pinocchio leaves out the mass on the universe, the root link's of a fixed base.
    """
    model = robot.model
    standing = model.inertias[0]
    moving = pin.computeTotalMass(model, data)
    share = moving / (moving + standing.mass)
    fixed_part = (1.0 - share) * np.array(standing.lever)

    def at(q: Array) -> tuple[Array, Array]:
        jacobian = np.array(pin.jacobianCenterOfMass(model, data, q, False), order="C").reshape(3, model.nv)
        if share == 0.0:
            return fixed_part, np.zeros_like(jacobian)
        return share * np.array(data.com[0]) + fixed_part, share * jacobian

    return at


def _with_center_of_mass(
    robot: Robot, frames: tuple[str, ...], placements: Array, jacobians: Array, hessians: Array
) -> Callable[[float, Array], None]:
    """`kinematics_updater` for frames among which the centre of mass is: that one's slot apart."""
    slot = frames.index(CENTER_OF_MASS)
    others = [k for k in range(len(frames)) if k != slot]
    other_placements, other_jacobians = placements[others], jacobians[others]
    other_hessians = hessians[others] if hessians.size else hessians
    update_others = kinematics_updater(
        robot, tuple(frames[k] for k in others), other_placements, other_jacobians, other_hessians
    )
    center_of_mass = _center_of_mass(robot, robot.model.createData())
    placements[slot, :, :3] = np.eye(3)

    def update(t: float, q: Array) -> None:
        update_others(t, q)
        placements[others], jacobians[others] = other_placements, other_jacobians
        if hessians.size:
            hessians[others] = other_hessians  # no function asks for that of the centre of mass
        placements[slot, :, 3], jacobians[slot, :3] = center_of_mass(q)

    return update


def _matrix_view(placement: pin.SE3) -> Array:
    """[R | p] as a (3, 4) view of Pinocchio's own memory, which follows updateFramePlacement at no cost.

    Pinocchio keeps R (column by column) and p next to each other; should that ever change, this
    raises instead of reading something else.
    """
    rotation, translation = placement.rotation, placement.translation
    start = rotation.__array_interface__["data"][0]
    adjacent = translation.__array_interface__["data"][0] == start + 9 * rotation.itemsize
    if not (adjacent and rotation.flags.f_contiguous):
        raise NmmError("this version of Pinocchio keeps placements in another way than nmm expects")
    return np.lib.stride_tricks.as_strided(rotation, (3, 4), (8, 24))
