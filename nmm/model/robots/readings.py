"""What encoders of a robot's joints read, by its coordinates."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.base.lazy_call import lazy_call


class Readings:
    """What a robot's notes and corrections say of its joints' encoders."""

    notes: tuple[Finding, ...]
    corrections: Mapping[str, tuple[float, float]]

    @cached_property
    def changed_numbers(self) -> Mapping[str, float]:
        """The numbers that are not those of its file (`nominal`, see `nmm.with_numbers`): what it has."""
        changed: Mapping[str, float] = lazy_call("nmm.model.robots.numbers:changed_numbers")(self)
        return changed

    def numbers_named(self, names: Collection[str]) -> dict[str, Any]:
        """`nmm.robot_numbers` with the frames that these numbers' names speak of, as far as it has such."""
        numbers: dict[str, Any] = lazy_call("nmm.model.robots.numbers:numbers_for")(self, names)
        return numbers

    def file_places(self, names: Collection[str]) -> dict[str, tuple[float, ...]]:
        """Where the file has those of its arm's joints and of its frames that are named: by name x, y, z,
        roll, pitch, yaw in what carries them, m and rad, and along or about what a joint moves there (9,)."""
        places: dict[str, tuple[float, ...]] = lazy_call("nmm.model.robots.origins:file_places")(self, names)
        return places

    def apart_in_file(self, places: Mapping[str, Sequence[float]]) -> dict[str, float]:
        """How far the file has joints and frames from such places: by name the largest difference, m or 1."""
        apart: dict[str, float] = lazy_call("nmm.model.robots.origins:apart_in_file")(self, places)
        return apart

    @cached_property
    def reversed_joints(self) -> tuple[str, ...]:
        """The platform's joints whose axes point down in the file: their coordinates' sign is the other."""
        reversals = (note.values["names"] for note in self.notes if note.code == "joints_reversed")
        return tuple(name for names in reversals for name in names)

    def gear(self, name: str) -> tuple[float, float]:
        """Factor (not 0) and offset, rad or m, of a coordinate: factor * reading + offset, the reading being
        that of the joint of its name, with its file's sign."""
        ratio, offset = self.corrections.get(name, (1.0, 0.0))
        return (-ratio if name in self.reversed_joints else ratio), offset

    def reading(self, name: str, value: float) -> float:
        """What a joint reads, with its file's sign, where its coordinate has a value, rad or m."""
        factor, offset = self.gear(name)
        return (value - offset) / factor

    def swivel_readings(self, q: Array, q_dot: Array) -> dict[str, tuple[float, float]]:
        """What encoders on a car's steered wheels read whose angles follow from its steering angle, at q (n,)
        and q_dot (n,): angle and rate by the swivel's joint, rad and rad/s."""
        read: dict[str, tuple[float, float]] = lazy_call("nmm.model.robots.wheel_rates:swivel_readings")(
            self, q, q_dot
        )
        return read

    @cached_property
    def _encoders(self) -> Any:
        """What reads the joints' encoders (`nmm.plugins.robot.encoders.Encoders`)."""
        return lazy_call("nmm.plugins.robot.encoders:Encoders")(self)
