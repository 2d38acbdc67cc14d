"""Whether what a log counts may be a robot's, in the units that were stated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, few
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.log_units import PLAIN, Counter, Unit
from nmm.plugins.robot.odometry import counted_wheels

#: No robot's wheels roll faster, m/s; nor do they turn so many times faster than the file says; nor does a
#: joint that steers, rad/s.
FASTEST, BEYOND, STEERS = 60.0, 5.0, 50.0
#: A joint may be measured so far outside its limits, rad.
OUTSIDE = 0.5
#: Such a share of the steps in which a counter moves tells a unit; fewer are leaps.
OFTEN = 0.1
#: A log whose wheels went less, m, stands still.
STILL = 0.02
#: Readings farther apart than this, s, are no log of a drive.
SELDOM = 5.0


@dataclass
class MeasuredDrive:
    """Counters in rad or m, with what a file says of them: the label of their column and their unit."""

    t: Array
    readings: dict[str, Array]
    counters: dict[str, Counter]
    units: dict[str, Unit]
    labels: dict[str, str]


def expect_forward(t: Array, where: str, at: Sequence[Any] | None = None, row: str = "row") -> None:
    """`InputError` for times, s, that do not increase: by how much they go back, and where: of `at` what the
    row is called there."""
    steps = np.diff(t)
    if (steps > 0.0).all():
        return
    k = int(np.argmax(steps <= 0.0))
    place = f"{row} {k + 1 if at is None else at[k + 1]}"
    if steps[k] < 0.0:
        raise InputError(
            f"stamps go back by {-steps[k]:.3g} s at {place}", where=where, expected="times that increase"
        )
    raise InputError(
        f"the stamp of {place} comes twice", where=where, expected="times that increase", got=float(t[k])
    )


def check_times(t: Array, unit: Unit, where: str) -> None:
    """`InputError` for readings that are days apart, or a log of microseconds: another unit of time fits."""
    between = float(np.median(np.diff(t)))
    if between <= SELDOM and between >= 1e-5:
        return
    raw = between / unit.factor
    fitting = [
        name for name, (kind, factor) in PLAIN.items() if kind == "time" and 1e-4 <= raw * factor <= 1.0
    ]
    fits = f"; {' or '.join(fitting)} would fit" if fitting else ""
    what = f"readings are {between:.3g} s apart, were their times in {unit.text}{fits}"
    raise InputError(what, where=where, expected=f"at most {SELDOM:g} s and no less than 10 µs")


def check_rates(measured: MeasuredDrive, where: str) -> list[Finding]:
    """`InputError` for counters that turn faster than any, or steer farther; leaps of a few are told."""
    found, lasts = list[Finding](), np.diff(measured.t)
    for name, values in measured.readings.items():
        counter, unit, label = measured.counters[name], measured.units[name], measured.labels[name]
        if counter.group == "steering":
            _check_steering(values, counter, unit, label, where)
        radius = counter.radius if counter.group == "wheels" else 1.0
        most = STEERS if counter.quantity == "angle" else FASTEST
        if counter.group == "wheels":
            most = min(FASTEST / radius, BEYOND * counter.fastest)
        rates = np.abs(np.diff(values)) / lasts
        moving, beyond = rates > 0.0, rates > most
        if not beyond.any():
            continue
        if beyond.sum() > OFTEN * moving.sum():
            rate = float(np.median(rates[beyond]))
            what = (
                f"{label} goes at {rate:.3g} {'rad' if counter.quantity == 'angle' else 'm'}/s, were it in "
            )
            what += unit.text + _fitting(unit, most / rate)
            raise InputError(what, where=where, expected=f"at most {most:.3g}, or another unit")
        k = int(np.argmax(beyond))
        by, t = float(values[k + 1] - values[k]), float(measured.t[k + 1])
        found.append(
            Finding("counter_leaps", {"name": label, "count": int(beyond.sum()), "by": by}, {"t": t})
        )
    return found


def _check_steering(values: Array, counter: Counter, unit: Unit, label: str, where: str) -> None:
    farthest, reach = float(np.abs(values).max()), counter.reach + OUTSIDE
    if farthest > reach:
        what = (
            f"{label} steers to {farthest:.3g} rad, were it in {unit.text}{_fitting(unit, reach / farthest)}"
        )
        raise InputError(what, where=where, expected=f"at most {reach:.3g} rad, or another unit")


def _fitting(unit: Unit, share: float) -> str:
    """Which other unit brings a number down to a share of it, at most, as words."""
    fitting = [
        name
        for name, (kind, factor) in PLAIN.items()
        if kind == unit.quantity
        and not unit.counts
        and factor / abs(unit.factor) <= share
        and factor < unit.factor
    ]
    least = (
        f"ticks:COUNTS of at least {abs(unit.turn or 0.0) / share:.3g}" if unit.quantity == "angle" else ""
    )
    names = [name + f"/{unit.per}" * bool(unit.per) for name in fitting] + [least] * bool(least)
    return f"; {' or '.join(names)} would fit" if names else ""


def check_determined(
    robot: Robot, readings: Mapping[str, Array], where: str, available: Sequence[str] | None = None
) -> None:
    """`InputError` where counters do not determine the robot's inputs: what else there is that may count."""
    try:
        robot.odometry(robot.rest, reading_at(robot, readings, 0), wrapped=False)
    except InputError as error:
        absent = [name for name in counted_wheels(robot) if name not in readings]
        if not absent or "determine" not in error.what:
            raise error.at(where) from None
        expected = f"readings of {few(absent)} too"
        got = few([*readings])
        raise InputError(error.what, where=where, expected=expected, got=got, available=available) from None


def reading_at(robot: Robot, readings: Mapping[str, Array], k: int) -> dict[str, float]:
    """What an odometry is told of the k-th row: its arm, at which it does not look, stands at zero."""
    arm = [robot.q_names[i] for i in robot.arm_coordinates]
    in_file = {name: file_name for file_name, name in robot.renamed.items()}
    row = {in_file.get(name, name): 0.0 for name in arm}
    return row | {name: float(values[k]) for name, values in readings.items()}


def check_moves(
    robot: Robot, readings: Mapping[str, Array], counters: Mapping[str, Counter], where: str
) -> None:
    """`InputError` for a log that stands still: how far its wheels went."""
    ways = {
        name: float(np.abs(np.diff(values)).sum()) * counters[name].radius
        for name, values in readings.items()
        if counters[name].group != "steering"
    }
    name, way = max(ways.items(), key=lambda pair: pair[1])
    if way < STILL:
        unit = "m" if counters[name].group == "wheels" or counters[name].quantity == "length" else "rad"
        what = f"it stands still: of its counters {name} went farthest, {way:.3g} {unit}"
        raise InputError(what, where=where, expected=f"at least {STILL:g}")
