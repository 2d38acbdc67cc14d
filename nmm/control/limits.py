"""Limits that a controller keeps: of inputs, of coordinates, of wheels and of any function's values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.control.bounds import SAMPLE, LimitNumbers
from nmm.errors import InputError, expect_known
from nmm.functions.function import Function
from nmm.functions.tasks.coordinates import Coordinates
from nmm.robots.coordinates import UNLIMITED
from nmm.robots.robot import Robot
from nmm.robots.wheel_rates import wheel_rates

#: A number for both signs, or [lower, upper].
Range: TypeAlias = float | Sequence[float]
#: What the robot's file says (True), nothing (False), or that with other numbers for some names.
Named: TypeAlias = bool | Mapping[str, Range]

#: Speed of the way back from beyond a limit, m/s or rad/s.
RECOVERY = 0.1


class Bound:
    """lower <= c(t, q) <= upper for the values of a function: a corridor, a height, a distance.

    Kept as a damper: c may approach a limit no faster than it can be slowed down to it. On wheels c's
    direction turns, so that it cannot always be kept with the other limits: then it is broken as little as
    can be, and the run says so.

    Parameters
    ----------
    function : c(t, q), a task's function, a frame's position, ...
    lower, upper : (rows,) or a number for all, in the units of the rows; infinite for none
    braking : deceleration to count on, units of the rows per s²; None for a quarter of what the accelerations
        of the inputs give where the robot is
    name : for messages; the function's rows when not given

    Raises
    ------
    InputError : no limit, one that is not a number, lower above upper
    """

    def __init__(
        self,
        function: Function,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
        braking: float | None = None,
        name: str = "",
    ) -> None:
        if not isinstance(function, Function):
            raise InputError(f"bound: expected a function, got {function!r}")
        self.function = function
        self.lower = _numbers(lower, "lower")
        self.upper = _numbers(upper, "upper")
        self.braking = None if braking is None else positive(braking, "braking")
        self.name = name
        if np.any(self.lower > self.upper):
            raise InputError(f"bound: lower {self.lower} is above upper {self.upper}")

    def rows(self, robot: Robot) -> list[tuple[str, float, float]]:
        """Name, lower and upper limit of each component."""
        rows = self.function.rows(robot)
        try:
            lower, upper = (np.broadcast_to(ends, (len(rows),)) for ends in (self.lower, self.upper))
        except ValueError:
            raise InputError(
                f"bound: expected a number or {len(rows)} ({', '.join(row.name for row in rows)}), "
                f"got lower {self.lower} and upper {self.upper}"
            ) from None
        names = [
            f"{self.name}.{row.name}" if self.name and len(rows) > 1 else self.name or row.name
            for row in rows
        ]
        return list(zip(names, map(float, lower), map(float, upper), strict=True))


class Limits:
    """Which limits a controller keeps: where nothing is given, the robot's own of velocity and position.

    Parameters
    ----------
    velocity : of inputs: True for the robot's, False for none, or numbers for inputs, groups ("platform",
        "arm") or joints that follow others, in place of the robot's: a number for both signs or
        [lower, upper]; m/s, rad/s
    position : of coordinates, in the same way: [lower, upper]; m, rad
    acceleration : of inputs: None for none, a number for all, or numbers for inputs or groups; m/s², rad/s²
    wheels : largest rolling rate of the driven wheels, rad/s: None for none, a number, or numbers by joint
    bounds : limits of functions
    recovery : speed at which a coordinate beyond its limit comes back, m/s or rad/s

    Limits of position and acceleration are kept from sample to sample: they need the controller's dt.

    Raises
    ------
    InputError : lower above upper, an acceleration or a recovery that is not above 0, no numbers
    """

    def __init__(
        self,
        velocity: Named = True,
        position: Named = True,
        acceleration: float | Mapping[str, float] | None = None,
        wheels: float | Mapping[str, float] | None = None,
        bounds: Sequence[Bound] | Bound = (),
        recovery: float = RECOVERY,
    ) -> None:
        self.velocity = _named(velocity, "velocity")
        self.position = _named(position, "position")
        self.acceleration = _sizes(acceleration, "acceleration")
        self.wheels = _sizes(wheels, "wheels")
        self.bounds: tuple[Bound, ...] = (bounds,) if isinstance(bounds, Bound) else tuple(bounds)
        for bound in self.bounds:
            if not isinstance(bound, Bound):
                raise InputError(f"limits: expected a Bound in bounds, got {bound!r}")
        self.recovery = positive(recovery, "recovery")

    def on(self, robot: Robot) -> LimitsOn:
        """These limits as numbers for one robot; `InputError` names what it does not have."""
        return LimitsOn(self, robot)


class Kept(NamedTuple):
    """A limited quantity: its name, its unit, and its limits."""

    name: str
    unit: str
    lower: float
    upper: float


class LimitsOn:
    """A robot's limits in numbers.

    Attributes
    ----------
    inputs (m, 2), coordinates (n, 2) : lower and upper limits; infinite for none
    accelerations (m,) : largest change of inputs per second
    functions : whose values are limited; `braking` (f,) of their components
    rows : the names of the limits that are rows on the inputs: wheels, then functions' components
    needs_dt : whether there are limits that are kept from sample to sample
    """

    def __init__(self, limits: Limits, robot: Robot) -> None:
        self.inputs = _velocities(limits.velocity, robot)
        self.coordinates = _positions(limits.position, robot)
        self.accelerations = _per_input(limits.acceleration, robot, "acceleration")
        self.recovery = limits.recovery
        self._moved = robot.rate_coordinates
        self._wheel_names, self._wheels, self._spin = _wheel_limits(limits.wheels, robot)
        held = [
            Bound(Coordinates(robot.q_names[i]), *self.coordinates[i])
            for i in robot.following.independent
            if i not in self._moved and np.any(np.isfinite(self.coordinates[i]))
        ]
        bounds = (*held, *limits.bounds)
        self.functions = tuple(bound.function for bound in bounds)
        found = [(bound, row) for bound in bounds for row in bound.rows(robot)]
        self._names = tuple(row[0] for _, row in found)
        self._ends = np.array([row[1:] for _, row in found]).reshape(-1, 2)
        self.braking = np.array([np.nan if bound.braking is None else bound.braking for bound, _ in found])
        self.rows = self._wheel_names + self._names
        self.needs_dt = bool(
            np.any(np.isfinite(self.accelerations))
            or np.any(np.isfinite(self.coordinates[self._moved[self._moved >= 0]]))
            or self._names
        )

    def numbers(self, first_rows: Sequence[int], robot: Robot) -> LimitNumbers:
        """The record that a control step reads; first_rows: where the functions' rows are in the program."""
        rows = [
            first + i
            for first, function in zip(first_rows, self.functions, strict=True)
            for i in range(len(function.rows(robot)))
        ]
        positions = self.coordinates[np.maximum(self._moved, 0)]
        positions[self._moved < 0] = [-np.inf, np.inf]
        return LimitNumbers(
            *(self.inputs[:, 0].copy(), self.inputs[:, 1].copy(), self.accelerations, self._moved),
            *(positions[:, 0].copy(), positions[:, 1].copy(), np.array(self.recovery)),
            *(self._wheels, self._spin, np.array(rows, dtype=np.int64)),
            *(self._ends[:, 0].copy(), self._ends[:, 1].copy(), self.braking),
            mode=np.array(SAMPLE, dtype=np.int64),
        )


def _velocities(given: Named, robot: Robot) -> Array:
    largest = robot.u_limits
    limits = np.column_stack([-largest, largest]) if given is not False else _none(robot.n_u)
    if isinstance(given, Mapping):
        followers = {one.joint: one for one in robot.followers}
        for name, value in given.items():
            lower, upper = _ends(value, f"velocity: {name}", symmetric=True)
            if name in followers:
                one = followers[name]
                ends = np.sort(np.array([lower, upper]) / one.multiplier) if one.multiplier else None
                if ends is not None:
                    j = robot.input(one.leader)
                    limits[j] = max(limits[j, 0], ends[0]), min(limits[j, 1], ends[1])
                continue
            for j in _inputs(name, robot, "velocity"):
                limits[j] = lower, upper
    return limits


def _positions(given: Named, robot: Robot) -> Array:
    limits = (
        np.where(robot.limited, robot.q_limits, [-np.inf, np.inf]) if given is not False else _none(robot.n)
    )
    if isinstance(given, Mapping):
        for name, value in given.items():
            limits[robot.independent(name)] = _ends(value, f"position: {name}", symmetric=False)
    limits[np.abs(limits) >= UNLIMITED] *= np.inf
    return np.asarray(limits)


def _per_input(given: float | Mapping[str, float] | None, robot: Robot, what: str) -> Array:
    if not isinstance(given, Mapping):
        return np.full(robot.n_u, np.inf if given is None else given)
    found = np.full(robot.n_u, np.inf)
    for name, value in given.items():
        found[_inputs(name, robot, what)] = value
    return found


def _inputs(name: str, robot: Robot, what: str) -> list[int]:
    if name in robot.groups:
        return [robot.input(one) for one in robot.groups[name]]
    expect_known("input or group", name, [*robot.u_names, *robot.groups], what)
    return [robot.input(name)]


def _wheel_limits(
    given: float | Mapping[str, float] | None, robot: Robot
) -> tuple[tuple[str, ...], Array, Array]:
    names, rows = wheel_rates(robot)
    if given is None:
        return (), rows[:0], np.zeros(0)
    if not names:
        raise InputError(f"wheels: robot {robot.name} has no wheels on its main body whose rates are known")
    if isinstance(given, Mapping):
        for name in given:
            expect_known("wheel", name, names, "wheels")
        chosen = [i for i, name in enumerate(names) if name in given]
        return tuple(names[i] for i in chosen), rows[chosen], np.array([given[names[i]] for i in chosen])
    return names, rows, np.full(len(names), float(given))


def _none(count: int) -> Array:
    return np.tile([-np.inf, np.inf], (count, 1))


def _numbers(value: ArrayLike, name: str) -> Array:
    found = np.atleast_1d(np.array(value, dtype=np.float64))
    if found.ndim != 1 or np.any(np.isnan(found)):
        raise InputError(f"bound: {name}: expected numbers (infinite for none), got {value!r}")
    return found


def _ends(value: Range, name: str, *, symmetric: bool) -> tuple[float, float]:
    """[lower, upper], or ±number where one number stands for both signs."""
    try:
        ends = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        ends = np.array(np.nan)
    if symmetric and ends.shape == () and ends > 0.0:
        return -float(ends), float(ends)
    if ends.shape != (2,) or np.any(np.isnan(ends)):
        wanted = "a number above 0 or [lower, upper]" if symmetric else "[lower, upper]"
        raise InputError(f"{name}: expected {wanted}, got {value!r}")
    if ends[0] > ends[1]:
        raise InputError(f"{name}: lower {ends[0]:g} is above upper {ends[1]:g}")
    return float(ends[0]), float(ends[1])


def _named(value: Named, name: str) -> Named:
    if isinstance(value, bool):
        return value
    if not isinstance(value, Mapping):
        raise InputError(f"{name}: expected true, false, or numbers by name, got {value!r}")
    for key, item in value.items():
        _ends(item, f"{name}: {key}", symmetric=name == "velocity")
    return dict(value)


def _sizes(value: float | Mapping[str, float] | None, name: str) -> float | Mapping[str, float] | None:
    if value is None:
        return None
    if isinstance(value, Mapping):
        return {key: positive(item, f"{name}: {key}") for key, item in value.items()}
    return positive(value, name)
