"""Where a robot stands: the zero-moment point, and how far it is inside the polygon of the wheels."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.convex_hull import convex_corners
from nmm.model.robots.loading.ground import GroundContacts
from nmm.model.robots.robot import Robot


class Support:
    """The polygon of a robot's wheels on the ground.

    A caster touches the ground on its swivel's axis here: its trail is left out. A robot on fewer than three
    wheels has no polygon: it keeps its balance by what its file does not say. Nor has one whose main body has
    no mass: where that is decides.

    Attributes
    ----------
    names : of the K wheels that touch the ground
    height : the ground's over the platform's reference point, m
    """

    def __init__(self, robot: Robot) -> None:
        ground = GroundContacts.of(robot)
        self.robot, self.height = robot, 0.0 if ground is None else ground.z
        known = len(robot.wheels) >= 3 and robot.platform.n_p >= 3 and _main_mass(robot) > 0.0
        self._wheels = robot.wheels if known else ()
        self.names = tuple(wheel.joint for wheel in self._wheels)
        self._data = robot.model.createData()
        #: Whether all of them are on the main body, where the polygon is the same at every q.
        self._rigid = all(wheel.carrier == "theta" for wheel in self._wheels)

    def points(self, q: Array) -> Array:
        """Where the wheels touch the ground at q (n,), in the world's level axes, (K, 2) m."""
        model, data = self.robot.model, self._data
        pin.forwardKinematics(model, data, q)
        ground = pin.SE3(model.jointPlacements[1])
        at = [wheel.pivot if wheel.swivel else wheel.center for wheel in self._wheels]
        joints = [model.getJointId(wheel.carrier) for wheel in self._wheels]
        places = [ground.actInv(data.oMi[k].act(point)) for k, point in zip(joints, at, strict=True)]
        return np.array(places).reshape(-1, 3)[:, :2]

    def zero_moment(self, forces: Array) -> Array:
        """Where the ground's force (N, 6), about the world's origin, acts on the ground, (N, 2) m; not a
        number where it would have to pull."""
        F, M = forces[:, :3], forces[:, 3:]
        x = self.height * F[:, 0] - M[:, 1]
        y = M[:, 0] + self.height * F[:, 1]
        return np.stack([x, y], axis=1) / np.where(F[:, [2]] > 0.0, F[:, [2]], np.nan)

    def margins(self, q: Array, points: Array) -> tuple[Array, list[tuple[str, str]]]:
        """How far points (N, 2) are inside the polygon at q (N, n), (N,) m, below 0 outside it; and the
        wheels between which the nearest edge runs. Infinite without a polygon, minus that for a point that is
        not a number."""
        if not self.names:
            return np.full(len(q), np.inf), [("", "")] * len(q)
        if self._rigid:  # as seen from the main body
            home = np.concatenate([np.zeros(3), q[0, 3:]])
            cosine, sine = np.cos(q[:, 2]), np.sin(q[:, 2])
            x, y = (points - q[:, :2]).T
            seen = np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)
            return self._inside(home, seen)
        results = [self._inside(row, point[np.newaxis]) for row, point in zip(q, points, strict=True)]
        return np.concatenate([margins for margins, _ in results]), [edges[0] for _, edges in results]

    def _inside(self, q: Array, points: Array) -> tuple[Array, list[tuple[str, str]]]:
        """Of points (N, 2) at one q (n,)."""
        wheels = self.points(q)
        corners = convex_corners(wheels, least=1e-12)
        begins = wheels[corners]
        along = np.roll(begins, -1, axis=0) - begins
        off = points[:, np.newaxis] - begins
        inside = (along[:, 0] * off[..., 1] - along[:, 1] * off[..., 0]) / np.hypot(*along.T)
        inside = np.where(np.isnan(inside), -np.inf, inside)
        least = inside.argmin(axis=1)
        ends = [(self.names[a], self.names[b]) for a, b in zip(corners, np.roll(corners, -1), strict=True)]
        return inside[range(len(points)), least], [ends[k] for k in least]


def _main_mass(robot: Robot) -> float:
    """The mass of the body that the platform moves, without its wheels, kg."""
    model = robot.display_model
    return float(model.inertias[model.getJointId(robot.q_names[2])].mass)
