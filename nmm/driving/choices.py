"""What a driver may change while the robot moves: resolver, gains, weights, limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from nmm.errors import InputError, expect_known


@dataclass(frozen=True)
class Choice:
    """One control of the page.

    Attributes
    ----------
    key : of the scenario, as `--set` takes it
    text : what people call it
    group : under which heading it stands
    value : the present one: a word of `options`, True or False, or a number from `least` to `most`
    unit : of a number

    Examples
    --------
    >>> choice = nmm.driving.Choice("task.gain", "gain", "task", 2.0, least=0.0, most=10.0, unit="1/s")
    >>> choice.checked(3)
    3.0
    """

    key: str
    text: str
    group: str
    value: str | bool | float
    options: tuple[str, ...] = ()
    least: float = 0.0
    most: float = 0.0
    unit: str = ""

    def told(self) -> dict[str, Any]:
        """For the page."""
        return asdict(self)

    def checked(self, value: object) -> str | bool | float:
        """A value that somebody chose.

        Raises
        ------
        InputError : one of another kind or out of range
        """
        if isinstance(self.value, bool):
            if not isinstance(value, bool):
                raise InputError(f"{self.key}: expected true or false, got {type(value).__name__}")
            return value
        if isinstance(self.value, str):
            expect_known(self.key, str(value)[:40], self.options, "drive")
            return str(value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{self.key}: expected a number, got {type(value).__name__}")
        if not self.least <= value <= self.most:
            raise InputError(f"{self.key}: expected a number from {self.least:g} to {self.most:g}")
        return float(value)


def number(key: str, text: str, group: str, value: float, unit: str = "") -> Choice:
    """A number above zero, over two decades about where it begins."""
    return Choice(key, text, group, float(value), (), value / 20.0, value * 20.0, unit)


def named(choices: Sequence[Choice], key: str) -> Choice:
    """The choice with that key; `InputError` where there is none."""
    known = {choice.key: choice for choice in choices}
    expect_known("choice", key[:80], known, "drive")
    return known[key]
