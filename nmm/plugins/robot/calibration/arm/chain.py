"""Where one frame of a robot stands in another, by its joints' readings, with slopes in its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect_known
from nmm.model.robots.joint_table import placement_rows, twist
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm.placements import carried, inverse, placed, slopes
from nmm.plugins.robot.calibration.arm.sightings import WORLD


@dataclass(frozen=True, eq=False)
class MovedChain:
    """Placements in the world at N configurations, (N, 4, 4): of joints of the model behind their motion, and
    before it, where the file puts them and they are moved to; of both frames."""

    behind: dict[int, Array]
    before: dict[int, Array]
    by: Array
    on: Array


class Chain:
    """The joints between two frames of a robot.

    by, on : the frames, "world" for the world; joints : of Pinocchio's model, from the one to the other, with
    +1 where they move `on`, -1 where they move `by`; arm : those that are the arm's
    ends : of both frames the joint of the model that carries it, and its placement there (4, 4)
    coordinates : the arm's coordinates whose readings tell where these joints stand, in order
    """

    def __init__(self, robot: Robot, by: str, on: str, where: str) -> None:
        self.robot, self.by, self.on = robot, by, on
        self.model = robot.model.copy()
        self._data = self.model.createData()
        self._rows = placement_rows(self._data.oMi)
        self._file = [placement.homogeneous for placement in robot.model.jointPlacements]
        frames = [self._frame(name, f"{where}: {side}") for name, side in ((by, "by"), (on, "on"))]
        self.ends = [
            (int(self.model.frames[i].parentJoint), self.model.frames[i].placement.homogeneous)
            for i in frames
        ]
        moves = [{*list(self.model.supports[parent])[1:]} for parent, _ in self.ends]
        self.joints = {j: 1 if j in moves[1] else -1 for j in sorted(moves[0] ^ moves[1])}
        n_p = robot.platform.n_p
        self.arm = [j for j in self.joints if self.model.joints[j].idx_q >= n_p]
        self._motion = {
            j: np.concatenate(twist(self.model.joints[j], pin.neutral(self.model))) for j in self.arm
        }
        carry = robot.following.carried
        self._carry = {int(c): carry[:, k] for k, c in enumerate(robot.following.independent)}
        own = [self.model.joints[j].idx_q for j in self.joints]
        self.coordinates = [c for c in self._carry if c >= n_p and any(self._carry[c][i] != 0.0 for i in own)]
        if not self.coordinates:
            what = f"no joint of the arm moves {on} as {by} sees it"
            raise InputError(what, where=where, expected="frames that joints move against each other")

    @property
    def on_platform(self) -> bool:
        """Whether the platform's motion is part of it."""
        return any(self.model.joints[j].idx_q < self.robot.platform.n_p for j in self.joints)

    def moved(self, q: Array, parts: Mapping[int, Array]) -> MovedChain:
        """At configurations (N, n), with joints moved by parts of a placement (6,)."""
        for joint in self.arm:
            at = self._file[joint]
            if joint in parts:
                at = at @ placed(parts[joint])
            self.model.jointPlacements[joint] = pin.SE3(at)
        at = np.zeros((len(q), self.model.njoints, 4, 4))
        at[:, :, 3, 3] = 1.0
        for k, row in enumerate(q):
            pin.forwardKinematics(self.model, self._data, row)
            at[k, :, :3] = self._rows.reshape(-1, 4, 3).swapaxes(1, 2)
        parents = {j: int(self.model.parents[j]) for j in self.arm}
        return MovedChain(
            {j: at[:, j] for j in self.arm},
            {j: at[:, parents[j]] @ self.model.jointPlacements[j].homogeneous for j in self.arm},
            *(at[:, parent] @ place for parent, place in self.ends),
        )

    def offset_twists(self, moved: MovedChain, coordinate: int) -> Array:
        """Twists (N, 6) of `on` as `by` sees it, in the axes of `on`, for a unit of a coordinate."""
        total = np.zeros((len(moved.on), 6))
        for j in self.arm:
            share = self._carry[coordinate][self.model.joints[j].idx_q]
            if share:
                own = self._motion[j][:, np.newaxis]
                total += share * self._seen(moved.behind[j], own, j, moved)[:, :, 0]
        return total

    def origin_twists(self, moved: MovedChain, joint: int, parts: Array) -> Array:
        """Twists (N, 6, 6), a column for each part of a joint's placement."""
        return self._seen(moved.before[joint], slopes(parts), joint, moved)

    def _seen(self, at: Array, twists: Array, joint: int, moved: MovedChain) -> Array:
        return self.joints[joint] * carried(inverse(moved.on) @ at, twists)

    def q(self, readings: Array, base: Array | None) -> Array:
        """Configurations (N, n) of the values of `coordinates` (N, c), and of the platform's pose (N, 3)."""
        q = np.zeros((len(readings), self.robot.n))
        q[:, self.coordinates] = readings
        if base is not None:
            q[:, :3] = base
        return self.robot.following.placed(q)

    def random(self, many: int, rng: np.random.Generator) -> Array:
        """Values (N, c) of its coordinates within their limits."""
        limits = self.robot.q_limits[self.coordinates]
        turning = np.array([self.robot.q_units[c] == "rad" for c in self.coordinates])
        reach = np.where(turning, np.pi, 0.5)
        low = np.where(np.isfinite(limits[:, 0]), np.maximum(limits[:, 0], -reach), -reach)
        high = np.where(np.isfinite(limits[:, 1]), np.minimum(limits[:, 1], reach), reach)
        return rng.uniform(np.minimum(low, high), np.maximum(low, high), (many, len(self.coordinates)))

    def length(self, joint: int) -> Array:
        """Where the file places a joint, (3,), m, in the joint's axes."""
        at: Array = self._file[joint][:3, :3].T @ self._file[joint][:3, 3]
        return at

    def names(self, coordinates: Sequence[int]) -> list[str]:
        """The names of joints in the robot's file."""
        in_file = {name: file_name for file_name, name in self.robot.renamed.items()}
        return [in_file.get(self.robot.q_names[c], self.robot.q_names[c]) for c in coordinates]

    def _frame(self, name: str, where: str) -> int:
        if name == WORLD:
            return 0
        expect_known("frame", name, (WORLD, *self.robot.frames), where)
        return self.robot.frame_id(name)
