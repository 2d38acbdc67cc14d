"""Whether a log's counters and its reference tell of the same drive, in the units that were stated."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from nmm.base.arrays import Array, Flags
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.log_checks import MeasuredDrive
from nmm.plugins.robot.calibration.log_units import PLAIN, Unit
from nmm.plugins.robot.encoders import Encoders, JointReadings
from nmm.plugins.robot.odometry import Counters, counted_wheels

#: Both are compared over windows of so long, s, so many at most.
WINDOW, WINDOWS = 2.0, 300
#: Of windows in which either goes so far, m, or turns so far, rad, there must be so many.
MUCH, TURNS, SOME = 0.1, 0.2, 3
#: Units differ where the median of their quotients is so far from 1: neither slip nor a mounting is as large.
APART = 8.0
#: Another unit fits that brings it within so many times.
FITS = 2.0
#: No encoder has fewer ticks a turn.
COARSE = 10.0


def check_reference(
    robot: Robot, measured: MeasuredDrive, seen: Array, reference: Array, units: tuple[Unit, Unit], where: str
) -> None:
    """`InputError` where wheels and reference are so far apart that a unit must be another.

    seen (M,), reference (M, 3) or (M, 2) : as of `DriveLog`
    units : of its positions and headings, as stated
    """
    first, last = max(measured.t[0], seen[0]), min(measured.t[-1], seen[-1])
    if last - first < WINDOW:
        return
    starts = np.linspace(first, last - WINDOW, min(WINDOWS, int((last - first) / WINDOW)))
    edges = np.stack([starts, starts + WINDOW])
    saw = np.array([np.interp(edges, seen, column) for column in reference.T])
    by = saw[:, 1] - saw[:, 0]
    way = np.hypot(by[0], by[1])
    moved, farthest = _moved(robot, measured, edges)
    went = np.hypot(moved[:, 0], moved[:, 1])
    counter = next(
        unit for name, unit in measured.units.items() if measured.counters[name].group != "steering"
    )
    # On the spot wheels go on and on, and a reference beside the axle does what the axle does not.
    few, many = _quotient(farthest, way, way > MUCH), _quotient(went, way, went > MUCH)
    if few < 1.0 / APART or many > APART:
        raise _apart("go", few if few < 1.0 / APART else many, counter, ("positions", units[0]), where)
    if len(by) == 3:
        turned, turns = np.abs(moved[:, 2]), np.abs(by[2])
        few, many = _quotient(turned, turns, turns > TURNS), _quotient(turned, turns, turned > TURNS)
        if few < 1.0 / APART or many > APART:
            _expect_apart(measured, where)
            ratio = few if few < 1.0 / APART else many
            alone = (way > MUCH).sum() >= SOME  # then ways have shown that its counters' unit is right
            raise _apart("turn it", ratio, counter, ("headings", units[1]), where, alone)


def _expect_apart(measured: MeasuredDrive, where: str) -> None:
    """`InputError` where two counters are one: then nothing turns."""
    for first, second in combinations(measured.readings, 2):
        if np.array_equal(measured.readings[first], measured.readings[second]):
            columns = dict.fromkeys(measured.labels[name] for name in (first, second))
            what = f"{first} and {second} count the same ({', '.join(columns)}) while the reference turns"
            raise InputError(what, where=where, expected="a column of each")


def _quotient(wheels: Array, reference: Array, much: Flags) -> float:
    """The median quotient of the two in the windows with much motion; 1 where there are few of these."""
    least = 1e-9
    if much.sum() < SOME:
        return 1.0
    return float(np.median((wheels[much] + least) / (reference[much] + least)))


def _apart(
    verb: str, ratio: float, counter: Unit, reference: tuple[str, Unit], where: str, alone: bool = False
) -> InputError:
    column, unit = reference
    times, side = (ratio, "more") if ratio > 1.0 else (1.0 / ratio, "less")
    what = f"by their units the wheels {verb} {times:.3g} times {side} than the reference"
    fits = [f"counters in {name}" for name in _near(counter, counter.factor / ratio) if not alone]
    ticks = 2.0 * math.pi * abs(ratio / counter.factor)
    if not alone and not fits and counter.quantity == "angle" and ticks > COARSE:
        fits = [f"counters in ticks:{ticks:.2g} or so"]
    fits += [f"{column} in {name}" for name in _near(unit, unit.factor * ratio)]
    expected = f"other units than {counter.text} and {unit.text}"
    expected += f": {' or '.join(fits)} would fit" if fits else ""
    return InputError(what, where=where, expected=expected)


def _near(unit: Unit, factor: float) -> list[str]:
    """Other units of the same quantity whose factor is near one."""
    return [
        name + f"/{unit.per}" * bool(unit.per)
        for name, (kind, other) in PLAIN.items()
        if kind == unit.quantity
        and not math.isclose(other, abs(unit.factor))
        and 1.0 / FITS < other / abs(factor) < FITS
    ]


def _moved(robot: Robot, measured: MeasuredDrive, edges: Array) -> tuple[Array, Array]:
    """How counters moved the platform between times (2, K), s, along its own axes (K, 3), to first order, and
    how far the wheel went that went farthest (K,), m."""
    readings = measured.readings
    counted = [name for name in readings if measured.counters[name].group != "steering"]
    by = {name: np.diff(np.interp(edges, measured.t, readings[name]), axis=0)[0] for name in counted}
    ways = [
        np.abs(way) * measured.counters[name].radius
        for name, way in by.items()
        if measured.counters[name].group == "wheels" or measured.counters[name].quantity == "length"
    ]
    own = own_joints(robot, measured, np.vstack([edges, edges.mean(axis=0)]))
    driving = (*counted_wheels(robot), *robot.platform.inputs)
    counters = Counters(robot, {name: 0.0 for name in counted if name in driving}, "")
    counts = np.array([by[name] for name in counters.names]).T
    moved = np.zeros((edges.shape[1], 3))
    for k in range(len(moved)):
        steps = {c: float(own[1, k, c - 3] - own[0, k, c - 3]) for c in counters.steered}
        M, B = counters.matrix(own[2, k])
        moved[k] = B @ counters.solved(M, counts[k], steps)
    went = np.hypot(moved[:, 0], moved[:, 1])
    return moved, np.max(ways, axis=0) if ways else went


def own_joints(robot: Robot, measured: MeasuredDrive, times: Array) -> Array:
    """The platform's own joints at times (..., K), s: (..., K, n_p - 3); zero where nothing measures them."""
    n_p = robot.platform.n_p
    own = np.zeros((*times.shape, n_p - 3))
    if n_p == 3:
        return own
    encoders = Encoders(robot)
    known = {*robot.q_names[3:n_p], *encoders.steered}
    names = tuple(name for name in measured.readings if encoders.renamed.get(name, name) in known)
    reader = JointReadings(encoders, names, (), robot.q_names[3:])
    columns = np.array([np.interp(times.ravel(), measured.t, measured.readings[name]) for name in names])
    q = robot.rest.copy()
    for row, values in zip(own.reshape(-1, n_p - 3), columns.T.tolist(), strict=True):
        reader.write(values, q, q.copy())
        row[:] = q[3:n_p]
    return own
