"""A robot's frames and auxiliary quantities while the rows of a task are derived."""

from __future__ import annotations

from dataclasses import dataclass, field

from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.geometry import Geometry
from nmm.analysis.formulas.kinematics import position, steps_to
from nmm.analysis.formulas.row import Auxiliary
from nmm.analysis.formulas.turning import Vector
from nmm.robots.robot import Robot


@dataclass(eq=False)
class Frames:
    """Positions of a robot's frames, each made once, and what the auxiliary symbols mean."""

    robot: Robot
    geometry: Geometry
    auxiliaries: list[Auxiliary] = field(default_factory=list)
    _matrices: int = 0
    _made: dict[tuple[str, str | None], Vector] = field(default_factory=dict)

    def position(self, frame: str, seen_from: str | None = None) -> Vector:
        """A frame's origin, in world axes or as another frame sees it."""
        key = frame, seen_from
        if key not in self._made:
            self._made[key] = position(steps_to(self.robot, frame, seen_from), self.geometry)
        return self._made[key]

    def gradient(self, value: Expansion) -> list[Expansion]:
        """Derivatives by the robot's coordinates."""
        ring = self.geometry.ring
        units = zip(self.robot.q_names, self.robot.q_units, strict=True)
        return [value.derivative(ring.variable(name, unit == "rad")) for name, unit in units]

    def free_names(self, *names: str) -> list[str]:
        """The names, with a number behind them when one of them is taken."""
        taken = {*self.robot.q_names, *self.geometry.ring.names}
        for number in range(1, 100):
            found = [name if number == 1 else f"{name}{number}" for name in names]
            if not taken.intersection(found):
                return found
        raise AssertionError("a hundred auxiliary quantities")

    def new_matrix(self) -> str:
        """A name for a rotation: R, R2, R3."""
        self._matrices += 1
        return "R" if self._matrices == 1 else f"R{self._matrices}"
