"""What the columns of a log count, and in which units: asked for, never guessed."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from nmm.base.errors import InputError, expect, few, no_such
from nmm.base.text_format import listed, quoted
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import steered_wheels

#: Plain units: what they measure, in rad, m and s.
PLAIN = {
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180.0),
    "rev": ("angle", 2.0 * math.pi),
    "m": ("length", 1.0),
    "cm": ("length", 1e-2),
    "mm": ("length", 1e-3),
    "s": ("time", 1.0),
    "ms": ("time", 1e-3),
    "us": ("time", 1e-6),
    "ns": ("time", 1e-9),
}
#: Units with a number behind a colon: counts of a turn, or the radius, m, by which a way was counted.
WITH_NUMBER = {"ticks": "counts of a turn", "m": "a radius in m", "mm": "a radius in m"}
#: What a counter may be told for: a second, or the row before.
PER = ("s", "row")
SI = "SI"
#: The groups of columns that have a unit in common, each with what it measures, and its unit of SI.
GROUPS = {
    "wheels": ("angle", "rad"),
    "steering": ("angle", "rad"),
    "position": ("length", "m"),
    "heading": ("angle", "rad"),
    "time": ("time", "s"),
    "reference_time": ("time", "s"),
}


@dataclass(frozen=True)
class Unit:
    """A unit as a user writes it.

    text : it
    quantity : "angle", "length" or "time"
    factor : of it in rad, m or s
    per : "s" for a rate, "row" for what was counted since the row before, "" for what counts on
    """

    text: str
    quantity: str
    factor: float
    per: str = ""

    @property
    def turn(self) -> float | None:
        """How many of it are a turn; None for what is no angle."""
        return 2.0 * math.pi / abs(self.factor) if self.quantity == "angle" else None

    @property
    def counts(self) -> bool:
        """Whether it counts ticks."""
        return self.text.startswith("ticks")


@dataclass(frozen=True)
class Counter:
    """What a column may count.

    group : "wheels", "steering" or, of an input of the platform, ""
    quantity : of its unit
    reach : the farthest angle of a joint that does not turn on and on, rad, else infinite
    radius : of a wheel, m, else 1
    fastest : how fast it may go by the robot's file, rad/s or m/s, else infinite
    """

    group: str
    quantity: str
    reach: float = math.inf
    radius: float = 1.0
    fastest: float = math.inf


def counters_of(robot: Robot) -> dict[str, Counter]:
    """What may be counted, by the file's names: wheels, swivels, joints of the platform's own, and inputs
    that are no rates of those."""
    platform = robot.platform
    if platform.n_p < 3:
        raise InputError(where=f"robot {robot.name}", expected="a platform that moves", got=platform.name)
    found: dict[str, Counter] = {}
    in_file = {name: file_name for file_name, name in robot.renamed.items()}
    for i, name in enumerate(robot.q_names[3 : platform.n_p], 3):
        limits = robot.q_limits[i][robot.limited[i]]
        reach = math.inf if robot.endless[i] else float(abs(limits).max(initial=math.pi))
        quantity = "angle" if robot.q_units[i] == "rad" else "length"
        found[in_file.get(name, name)] = Counter("steering", quantity, reach)
    steered_by = steered_wheels(robot)
    for wheel in robot.wheels:
        found[wheel.joint] = Counter("wheels", "angle", radius=wheel.radius, fastest=wheel.velocity)
        if wheel.swivel and wheel.swivel not in found:
            reach = math.pi if wheel.swivel in steered_by else math.inf
            found[wheel.swivel] = Counter("steering", "angle", reach)
    own = {int(c) for c in robot.rate_coordinates[: platform.p]} - {0, 1, 2, -1}
    for i, (name, unit) in enumerate(zip(platform.inputs, platform.input_units, strict=True)):
        if int(robot.rate_coordinates[i]) not in own:
            found.setdefault(name, Counter("", "length" if unit.startswith("m") else "angle"))
    return found


def unit_of(text: object, quantity: str, where: str, of_wheel: bool = False, rates: bool = False) -> Unit:
    """The unit that a text names, as "deg", "ticks:2048", "m/s" or, of a wheel that counts its way by a
    radius, "m:0.1"; `InputError` for one that does not measure the quantity."""
    known = [name for name, (measured, _) in PLAIN.items() if measured == quantity]
    if quantity == "angle":
        known += ["ticks:COUNTS"] + ["m:RADIUS"] * of_wheel
    if rates:
        known += ["each with /s or /row (rad/s, ticks/row:COUNTS)"] + ["rpm"] * (quantity == "angle")
    expected = f"a unit of {'a wheel' if of_wheel else quantity}: {', '.join(known)}"
    if not isinstance(text, str):
        raise InputError(where=where, expected=expected, got=text)
    head, colon, number = text.strip().partition(":")
    name, slash, per = head.strip().partition("/")
    if name == "rpm" and rates and quantity == "angle" and not slash:
        return Unit(text, "angle", 2.0 * math.pi / 60.0, "s")
    if slash and (per not in PER or not rates):
        raise InputError(where=where, expected=expected, got=text)
    if name in WITH_NUMBER and (colon or name not in PLAIN):
        factor = _number(number, f"{where}: {text}", WITH_NUMBER[name])
        if name == "ticks" and quantity == "angle":
            return Unit(text, "angle", 2.0 * math.pi / factor, per)
        if of_wheel:
            return Unit(text, "angle", PLAIN[name][1] / factor, per)
    elif not colon and name in PLAIN and PLAIN[name][0] == quantity:
        return Unit(text, quantity, PLAIN[name][1], per)
    raise InputError(where=where, expected=expected, got=text)


def _number(text: str, where: str, what: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    expect(math.isfinite(number) and number != 0.0, where, f"{what} behind the colon: ticks:2048", text)
    return number


class Units:
    """The units of a log's columns, as a user states them: "SI", or by group or column.

    A unit of a column stands before that of its group; wheels' is no joint's that steers.
    """

    def __init__(
        self,
        stated: Mapping[str, str] | str | None,
        columns: Iterable[str],
        where: str,
        groups: Mapping[str, tuple[str, str]] = GROUPS,
    ) -> None:
        self._groups = groups
        self._where = f"{where}: units"
        self._si = stated == SI
        if not self._si and not isinstance(stated, Mapping | None):
            example = next(iter(groups))
            expected = f"{SI!r}, or by group or column, as {{{example!r}: 'ticks:2048'}}"
            raise InputError(where=self._where, expected=expected, got=stated)
        self._stated = {} if stated is None or isinstance(stated, str) else dict(stated)
        known = [*groups, *columns]
        for name in self._stated:
            if name not in known:
                raise no_such("group or column", name, known, self._where)
        self._missing: dict[str, str] = {}

    def group(self, group: str, column: str = "") -> Unit | None:
        """The unit of a column of a group; None where nobody stated it, which `expect_all` then says."""
        quantity, si = self._groups[group]
        for name in (column, group, "time" if group == "reference_time" else group):
            if name in self._stated:
                where = f"{self._where}: {name}"
                return unit_of(
                    self._stated[name], quantity, where, group == "wheels", rates=group == "wheels"
                )
        if self._si:
            return unit_of(si, quantity, self._where)
        self._missing.setdefault(group, si)
        return None

    def counter(self, name: str, counter: Counter) -> Unit | None:
        """Of a counter's column: an input's is stated by its name, since it may be a rate or its integral."""
        if counter.group:
            return self.group(counter.group, name)
        if name in self._stated:
            return unit_of(self._stated[name], counter.quantity, f"{self._where}: {name}", rates=True)
        self._missing.setdefault(name, "m/s or m" if counter.quantity == "length" else "rad/s or rad")
        return None

    def expect_all(self) -> None:
        """`InputError` that names all units which were asked for and not stated."""
        if self._missing:
            what = f"the unit{'s' * (len(self._missing) > 1)} of {listed([*self._missing])} must be stated"
            example = ", ".join(f"{name!r}: {unit.split(' ')[0]!r}" for name, unit in self._missing.items())
            raise InputError(what, where=self._where, expected=f"as units={{{example}}}")


def near_names(missing: Collection[str], header: Iterable[str], where: str) -> InputError:
    """The error for counters that no column has."""
    first = next(iter(missing))
    return InputError(
        f"no column of {few([*missing])}",
        where=where,
        expected=f"each in a column of its name, or columns={{{quoted(first)}: COLUMN}}",
        available=header,
    )
