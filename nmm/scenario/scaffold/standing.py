"""How hard a robot may speed up, so that it stays on its wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.dynamics.torques import Torques, torques_along
from nmm.model.robots.loading.provenance import accelerations_of
from nmm.model.robots.robot import Robot

#: Of a point of the base and of a slide, m/s²; of joints, steering and the base, rad/s².
_STRAIGHT, _TURNING = 1.0, 4.0
#: How far from the axle the point is that a turn of the base moves, m.
_BESIDE = 0.5
#: What tips the robot, divided by what it may do.
_SAFE = 2.0


@dataclass(frozen=True, eq=False)
class Standing:
    """What keeps a robot on its wheels."""

    robot: Robot
    _shifts: dict[bytes, tuple[float, Array]] = field(default_factory=dict)

    @cached_property
    def is_known(self) -> bool:
        """Whether the file tells where it tips: by masses, and three wheels or more."""
        return bool(np.isfinite(self.margin(self.robot.rest)))

    def margin(self, q: Array) -> float:
        """How far the zero-moment point is inside the wheels' polygon at rest, m; infinite where unknown."""
        return self._moved(q)[0]

    def accelerations(self, q: Array, share: float = 1.0) -> dict[str, float]:
        """Largest accelerations by input, m/s² and rad/s²: the file's or usual ones, or at q half of what
        tips the robot, each alone; times a share of 1 or less. "arm" is of all joints, slides by their own
        names aside."""
        margin, shifts = self._moved(q)
        robot, p, of_file = self.robot, self.robot.platform.p, accelerations_of(self.robot)
        joints = [_STRAIGHT if unit == "m/s" else _TURNING for unit in robot.u_units[p:]]
        usual = np.array([*self._of_platform(q), *joints])
        usual = np.array([of_file.get(name, value) for name, value in zip(robot.u_names, usual, strict=True)])
        with np.errstate(divide="ignore", invalid="ignore"):
            tipping = np.where(shifts > 0.0, max(margin, 0.0) / (_SAFE * shifts), np.inf)
        most = share * np.where(margin > 0.0, np.minimum(usual, tipping), usual)
        largest = dict(zip(robot.u_names[:p], most[:p], strict=True))
        own = [robot.u_names.index(name) for name in of_file if robot.u_names.index(name) >= p]
        turning = [j for j in range(p, robot.n_u) if robot.u_units[j] == "rad/s" and j not in own]
        if turning:
            largest["arm"] = min(most[turning])
        largest |= {robot.u_names[j]: most[j] for j in range(p, robot.n_u) if j not in turning}
        return {
            name: float(value) if of_file.get(name) == value else _rounded_down(float(value))
            for name, value in largest.items()
        }

    def _of_platform(self, q: Array) -> Array:
        """Usual accelerations of its inputs (p,): of a point of its body by 1 m/s²."""
        platform = self.robot.platform
        if not platform.n_p:
            return np.zeros(0)
        moved = platform.G(q[: platform.n_p])
        speeds = np.maximum(np.hypot(*moved[:2]), _BESIDE * np.abs(moved[2]))
        with np.errstate(divide="ignore"):
            return np.asarray(np.where(speeds > 1e-6, _STRAIGHT / speeds, _TURNING))

    def _moved(self, q: Array) -> tuple[float, Array]:
        """The margin at rest, m, and how far an acceleration of 1 of each input moves the zero-moment point,
        (m,) m; infinity and zeros where the file does not tell."""
        key = q.tobytes()
        if key not in self._shifts:
            self._shifts[key] = self._measured(q)
        return self._shifts[key]

    def _measured(self, q: Array) -> tuple[float, Array]:
        robot = self.robot
        m = robot.n_u
        still, u_dot = np.zeros((m + 1, m)), np.vstack([np.zeros(m), np.eye(m)])
        try:
            torques = torques_along(robot, np.zeros(m + 1), np.tile(q, (m + 1, 1)), still, u_dot=u_dot)
        except InputError:  # no link has a mass
            return np.inf, np.zeros(m)
        margin = float(torques.margins[0])
        if not np.isfinite(margin):
            return margin, np.zeros(m)
        shifts = np.linalg.norm(torques.zero_moment[1:] - torques.zero_moment[0], axis=1)
        return margin, np.where(np.isfinite(shifts), shifts, 0.0)


def _rounded_down(value: float) -> float:
    """To two digits."""
    digits = 1 - math.floor(math.log10(value))
    return float(f"{math.floor(value * 10.0**digits + 1e-9) / 10.0**digits:.2g}")


def tipping(torques: Torques) -> Mapping[str, float] | None:
    """Where a run tips, by its `tips` finding: t, s; None where it does not."""
    return next((finding.where for finding in torques.findings if finding.code == "tips"), None)
