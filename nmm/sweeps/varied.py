"""What a sweep varies: a key of a scenario over a range, or over values that are listed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.scenario.numbers import evaluate, number, shown
from nmm.words import split_outside_brackets

EXPECTED = "expected LOWER:UPPER, LOWER:UPPER:COUNT or VALUE,VALUE,..., as in -pi:pi or rg,pg"
#: The most values of one key that are written down one by one.
MOST_VALUES = 100_000


@dataclass(frozen=True)
class Range:
    """A key that is sampled between two numbers, in the unit that the scenario has there.

    Attributes
    ----------
    key : dotted, as for `Scenario.override`
    lower, upper : bounds, lower < upper
    """

    key: str
    lower: float
    upper: float

    @property
    def numeric(self) -> bool:
        """Whether each value is a number."""
        return True

    def at(self, shares: Array) -> Array:
        """Values (N,) at shares of the range in [0, 1)."""
        return self.lower + (self.upper - self.lower) * shares

    def plain(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"key": self.key, "lower": self.lower, "upper": self.upper}


@dataclass(frozen=True)
class Listed:
    """A key that takes each of several values, with all values of the others.

    Attributes
    ----------
    key : dotted, as for `Scenario.override`
    values : as a scenario takes them: numbers, text as in a file, plain data
    """

    key: str
    values: tuple[Any, ...]

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The values, where each of them is a number or arithmetic."""
        try:
            return tuple(number(value) for value in self.values)
        except ValueError:
            return None

    @property
    def numeric(self) -> bool:
        """Whether each value is a number."""
        return self.numbers is not None

    @property
    def told(self) -> tuple[float | str, ...]:
        """The values as a table holds them: numbers where all of them are, otherwise text."""
        return self.numbers or tuple(
            value if isinstance(value, str) else json.dumps(value) for value in self.values
        )

    def plain(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"key": self.key, "values": list(self.values)}


Varied = Range | Listed


def varied(key: str, given: object) -> Varied:
    """What is given for a key.

    Parameters
    ----------
    key : dotted, as for `Scenario.override`
    given : text ("-pi:pi", "0:1:11", "rg,pg"), a tuple (lower, upper) or (lower, upper, count), or a list of
        values. A range with a count is so many values at equal distances, both bounds among them

    Raises
    ------
    InputError : none of these; bounds that are no numbers, missing, or not in order; fewer than 2 values
    """
    if not key.strip():
        raise InputError(f"vary: expected a dotted key such as q0.x or resolver.alpha, got {key!r}")
    if isinstance(given, str):
        return _from_text(key, given)
    if isinstance(given, tuple):
        return _range(key, given, shown(given))
    values = given.tolist() if hasattr(given, "tolist") else given
    if not isinstance(values, list):
        raise InputError(
            f"vary {key}: expected (lower, upper), (lower, upper, count), a list or text, got {shown(given)}"
        )
    return _listed(key, values)


def parsed(text: str) -> Varied:
    """KEY=LOWER:UPPER[:COUNT] or KEY=VALUE,VALUE,...; `InputError` as `varied`."""
    key, equals, given = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--vary: expected KEY=LOWER:UPPER or KEY=VALUE,VALUE,..., got {text!r}")
    return varied(key.strip(), given.strip())


def _from_text(key: str, text: str) -> Varied:
    values = split_outside_brackets(text, ",")
    if len(values) == 1 and len(bounds := split_outside_brackets(text, ":")) > 1:
        return _range(key, bounds, repr(text))
    if len(values) > 1 and not all(values):
        raise InputError(f"vary {key}: {EXPECTED}, got {text!r} (a value is missing)")
    return _listed(key, values)


def _range(key: str, bounds: Sequence[Any], came: str) -> Varied:
    if len(bounds) not in (2, 3):
        raise InputError(f"vary {key}: {EXPECTED}, got {came}")
    for name, bound in zip(("lower bound", "upper bound", "count"), bounds, strict=False):
        if isinstance(bound, str) and not bound:
            raise InputError(f"vary {key}: {EXPECTED}, got {came} (the {name} is missing)")
    try:
        lower, upper, *count = (evaluate(one) if isinstance(one, str) else number(one) for one in bounds)
    except ValueError as error:
        raise InputError(f"vary {key}: {error}") from None
    if not lower < upper:
        raise InputError(f"vary {key}: expected a lower bound below the upper one, got {came}")
    if not count:
        return Range(key, lower, upper)
    (many,) = count
    if many != int(many) or not 2 <= many <= MOST_VALUES:
        raise InputError(f"vary {key}: expected a count from 2 to {MOST_VALUES}, got {many:g}")
    steps = int(many) - 1
    inner = (lower + (upper - lower) * (k / steps) for k in range(steps))
    return Listed(key, (*inner, upper))


def _listed(key: str, values: Sequence[Any]) -> Listed:
    plain = [float(one) if isinstance(one, Real) and not isinstance(one, int) else one for one in values]
    if len(plain) < 2:
        raise InputError(
            f"vary {key}: {EXPECTED}, got {shown(plain[0]) if plain else 'nothing'}"
            f"{' (one value is no variation: set it)' if plain and plain[0] else ''}"
        )
    if len({json.dumps(value, default=str) for value in plain}) < len(plain):
        raise InputError(f"vary {key}: expected values that differ, got {', '.join(map(str, plain))}")
    return Listed(key, tuple(plain))
