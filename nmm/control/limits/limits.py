"""Limits that a controller keeps: of inputs, coordinates, wheels and any function's values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError, expect_kind, expect_known, one_or_several
from nmm.control.functions.tasks.linear_coordinates import LinearCoordinates
from nmm.control.limits.bounds import SAMPLE, LimitNumbers
from nmm.control.limits.limit import Limit, RowLimit, checked_stage
from nmm.control.limits.limited_function import Bound
from nmm.model.robots.coordinates import UNLIMITED
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_rates

#: A number for both signs, or [lower, upper].
Range: TypeAlias = float | Sequence[float]
#: The limits of the robot's file (True), none (False), or the file's with other numbers for some names.
Named: TypeAlias = bool | Mapping[str, Range]

#: Speed of the return from beyond a limit, m/s or rad/s.
RECOVERY = 0.1


class Limits:
    """The limits that a controller keeps; by default the robot's own limits of velocity and position.

    Parameters
    ----------
    velocity : of inputs, m/s, rad/s: True for the robot's, False for none, or others by input, group
        ("platform", "arm") or mimic joint: a number for both signs or [lower, upper]
    position : of coordinates, in the same way: [lower, upper]; m, rad
    acceleration : of inputs, m/s², rad/s²: a number for both signs or [lower, upper] of what an input changes
        by per second; for all, or by input or group; None for none
    wheels : largest rolling rates, rad/s: by joint, or one for all but casters; None for the robot's, unless
        velocity=False
    bounds : limits of functions (`Bound`), and limits of other kinds: `HandSpeed`, `TipOver`
    recovery : speed at which a coordinate returns from beyond its limit, m/s or rad/s

    Limits of position and acceleration are kept from sample to sample, so they need the controller's dt.

    Raises
    ------
    InputError : lower above upper, an acceleration that does not let inputs both fall and rise, a recovery
        that is not above 0, no numbers

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> limits = nmm.Limits(velocity={"v": 0.5, "arm": 1.0}, acceleration=2.0)
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 1.0])
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
    >>> run = nmm.simulate(controller, robot.q({"q2": 0.5}), 3.0, 0.01)
    >>> np.abs(run.u[:, :1]).max(axis=0).round(3)
    array([0.5])
    """

    def __init__(
        self,
        velocity: Named = True,
        position: Named = True,
        acceleration: Range | Mapping[str, Range] | None = None,
        wheels: float | Mapping[str, float] | None = None,
        bounds: Sequence[Bound | Limit] | Bound | Limit = (),
        recovery: float = RECOVERY,
    ) -> None:
        self.velocity = _named(velocity, "velocity")
        self.position = _named(position, "position")
        self.acceleration = _changes(acceleration)
        self.wheels = _sizes(wheels, "wheels")
        expected = "a Bound or another Limit, or several"
        self.bounds: tuple[Bound | Limit, ...] = one_or_several(bounds, Bound | Limit, "bounds", expected)
        self.recovery = positive(recovery, "recovery")

    def on(self, robot: Robot) -> LimitsOn:
        """These limits as numbers for one robot; `InputError` for names that it lacks."""
        return LimitsOn(self, robot)


class LimitsOn:
    """A robot's limits in numbers.

    Attributes
    ----------
    inputs (m, 2), coordinates (n, 2) : lower and upper limits; infinite for none
    changes (m, 2) : how fast inputs may fall (below 0) and rise per second; infinite for none
    accelerations (m,) : the size of the smaller of both
    bounded : names of coordinates with limits
    functions : whose values are limited; braking (f,) : of their components
    wheels (w, 9), spin (w,) : rows of `nmm.model.robots.wheel_rates`, and the wheels' largest rates, the
        first of `rows`, rad/s
    row_limits : the limited quantities, whose values are recorded: first wheels, then functions' components,
        then those of limits with a kernel of their own
    rows : the names of the rows on the inputs, in the same order, where a limit may have more than it has
        quantities; rate_units : by name, what a row's product with the inputs is in
    stages, counts : of the limits with a kernel of their own, and how many quantities each has
    first_own : where their rows, and quantities, begin
    sizes, losses : by name, of `LimitStage`
    priorities : of these, None for those that are kept before any task
    needs_dt : whether there are limits that are kept from sample to sample
    """

    def __init__(self, limits: Limits, robot: Robot) -> None:
        self.inputs = _velocities(limits.velocity, robot)
        self.coordinates = _positions(limits.position, robot)
        ends = zip(robot.q_names, self.coordinates, strict=True)
        self.bounded = tuple(name for name, span in ends if np.any(np.isfinite(span)))
        self.changes = _changes_on(limits.acceleration, robot)
        self.accelerations = np.abs(self.changes).min(axis=1)
        self.recovery = limits.recovery
        self._moved = robot.rate_coordinates
        wheels, self.wheels, self.spin = _wheel_limits(limits, robot)
        held = [
            Bound(LinearCoordinates(robot.q_names[i]), *self.coordinates[i])
            for i in robot.following.independent
            if i not in self._moved and np.any(np.isfinite(self.coordinates[i]))
        ]
        bounds = (*held, *(bound for bound in limits.bounds if isinstance(bound, Bound)))
        own = [limit for limit in limits.bounds if isinstance(limit, Limit)]
        self.functions = tuple(bound.function for bound in bounds)
        each = [bound.rows(robot) for bound in bounds]
        bound_rows = [(bound, row) for bound, rows in zip(bounds, each, strict=True) for row in rows]
        self._lengths = tuple(map(len, each))
        self._ends = np.array([row[2:] for _, row in bound_rows]).reshape(-1, 2)
        self.braking = np.array(
            [np.nan if bound.braking is None else bound.braking for bound, _ in bound_rows]
        )
        self.stages = tuple(checked_stage(limit, robot) for limit in own)
        quantities = [tuple(limit.rows(robot)) for limit in own]
        own_rows = list(zip(self.stages, quantities, strict=True))
        self.counts = tuple(map(len, quantities))
        self.row_limits = (
            *(
                RowLimit(name, "rad/s", -spin, spin)
                for name, spin in zip(wheels, self.spin.tolist(), strict=True)
            ),
            *(row for _, row in bound_rows),
        )
        self.first_own = len(self.row_limits)
        names = [row.name for row in self.row_limits]
        units = [*("rad/s" for _ in wheels), *(f"{row.unit.removesuffix('/s')}/s" for _, row in bound_rows)]
        self.priorities: tuple[int | None, ...] = (
            *(None for _ in wheels),
            *(bound.priority for bound, _ in bound_rows),
        )
        for limit, stage, limited in zip(own, self.stages, quantities, strict=True):
            names += [limited[min(i, len(limited) - 1)].name for i in range(stage.rows)]
            units += [stage.unit] * stage.rows
            self.priorities += (limit.priority,) * stage.rows
            self.row_limits += limited
        self.sizes = {
            row.name: size
            for stage, limited in own_rows
            for row, size in zip(limited, stage.sizes, strict=False)
        }
        self.losses = {
            row.name: loss
            for stage, limited in own_rows
            for row, loss in zip(limited, stage.losses, strict=False)
        }
        self.rows = tuple(names)
        self.rate_units = dict(zip(names, units, strict=True))
        self.needs_dt = bool(
            np.any(np.isfinite(self.accelerations))
            or np.any(np.isfinite(self.coordinates[self._moved[self._moved >= 0]]))
            or bound_rows
            or own
        )

    def numbers(self, first_rows: Sequence[int]) -> LimitNumbers:
        """The record that a control step reads; first_rows: the program's first row of each function."""
        rows = [
            first + i for first, count in zip(first_rows, self._lengths, strict=True) for i in range(count)
        ]
        positions = self.coordinates[np.maximum(self._moved, 0)]
        positions[self._moved < 0] = [-np.inf, np.inf]
        return LimitNumbers(
            *(self.inputs[:, 0].copy(), self.inputs[:, 1].copy()),
            *(-self.changes[:, 0], self.changes[:, 1].copy()),
            self._moved,
            *(positions[:, 0].copy(), positions[:, 1].copy(), np.array(self.recovery)),
            *(self.wheels, self.spin),
            np.array(rows, dtype=np.int64),
            *(self._ends[:, 0].copy(), self._ends[:, 1].copy(), self.braking),
            elapsed=np.array(np.nan),
            mode=np.array(SAMPLE, dtype=np.int64),
        )


def _velocities(requested: Named, robot: Robot) -> Array:
    largest = robot.u_limits
    limits = np.column_stack([-largest, largest]) if requested is not False else _none(robot.n_u)
    if isinstance(requested, Mapping):
        mimic_joints = {mimic.joint: mimic for mimic in robot.mimic_joints}
        for name, inputs in _inputs(requested, robot, "velocity", [*mimic_joints]):
            lower, upper = _ends(requested[name], f"velocity: {name}", symmetric=True)
            if name not in mimic_joints:
                limits[inputs] = lower, upper
            elif mimic_joints[name].multiplier:
                (j,) = inputs
                ends = np.sort(np.array([lower, upper]) / mimic_joints[name].multiplier)
                limits[j] = max(limits[j, 0], ends[0]), min(limits[j, 1], ends[1])
                if limits[j, 0] > limits[j, 1]:
                    raise InputError(
                        f"[{lower:g}, {upper:g}] leaves {robot.u_names[j]}, which it follows, no velocity "
                        "within its own limits",
                        where=f"velocity: {name}",
                    )
    return limits


def _positions(requested: Named, robot: Robot) -> Array:
    limits = (
        np.where(robot.limited, robot.q_limits, [-np.inf, np.inf])
        if requested is not False
        else _none(robot.n)
    )
    if isinstance(requested, Mapping):
        for name, value in requested.items():
            try:
                i = robot.independent(name)
            except InputError as error:
                raise error.at("position") from None
            limits[i] = _ends(value, f"position: {name}", symmetric=False)
    limits[np.abs(limits) >= UNLIMITED] *= np.inf
    return np.asarray(limits)


def _changes_on(requested: Range | Mapping[str, Range] | None, robot: Robot) -> Array:
    changes = _none(robot.n_u)
    if isinstance(requested, Mapping):
        for name, inputs in _inputs(requested, robot, "acceleration"):
            changes[inputs] = _change(requested[name], name)
    elif requested is not None:
        changes[:] = _change(requested, "acceleration")
    return changes


def _inputs(
    requested: Mapping[str, object], robot: Robot, what: str, mimic_joints: Sequence[str] = ()
) -> list[tuple[str, list[int]]]:
    """The inputs of each name: groups first, then inputs, then mimic joints, so that later ones override."""
    leaders = {mimic.joint: mimic.leader for mimic in robot.mimic_joints if mimic.joint in mimic_joints}
    known = [*robot.groups, *robot.u_names, *leaders]
    for name in requested:
        robot.expect_unlocked(name)
        expect_known(f"input{', joint that follows another' if leaders else ''} or group", name, known, what)
    by_name = []
    for name in sorted(requested, key=lambda name: (name not in robot.groups, name in leaders)):
        of = robot.groups.get(name, (leaders.get(name, name),))
        by_name.append((name, [robot.input(member) for member in of]))
    return by_name


def _wheel_limits(limits: Limits, robot: Robot) -> tuple[tuple[str, ...], Array, Array]:
    requested = limits.wheels
    names, rows = wheel_rates(robot)
    if requested is not None and not names:
        raise InputError(f"{robot.name} has none on its main body whose rates are known", where="wheels")
    own = {wheel.joint: wheel.velocity for wheel in robot.wheels}
    speeds = np.array([np.inf if limits.velocity is False else own[name] for name in names])
    if isinstance(requested, Mapping):
        for name, speed in requested.items():
            expect_known("wheel", name, names, "wheels")
            speeds[names.index(name)] = speed
    elif requested is not None:
        speeds[:] = requested
    limited = np.flatnonzero(np.isfinite(speeds))
    return tuple(names[i] for i in limited), rows[limited], speeds[limited]


def _none(count: int) -> Array:
    return np.tile([-np.inf, np.inf], (count, 1))


def _ends(value: Range, name: str, *, symmetric: bool) -> tuple[float, float]:
    """[lower, upper], or ±number for one number."""
    try:
        ends = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        ends = np.array(np.nan)
    if symmetric and ends.shape == () and ends > 0.0:
        return -float(ends), float(ends)
    if ends.shape != (2,) or np.any(np.isnan(ends)):
        wanted = "a number above 0 or [lower, upper]" if symmetric else "[lower, upper]"
        raise InputError(where=name, expected=wanted, got=value)
    if ends[0] > ends[1]:
        raise InputError(where=name, expected="lower below upper", got=ends)
    return float(ends[0]), float(ends[1])


def _named(value: Named, name: str) -> Named:
    if isinstance(value, bool):
        return value
    expect_kind(value, Mapping, name, "true, false, or numbers by name")
    for key, item in value.items():
        _ends(item, f"{name}: {key}", symmetric=name == "velocity")
    return dict(value)


def _changes(value: Range | Mapping[str, Range] | None) -> Range | Mapping[str, Range] | None:
    if isinstance(value, Mapping):
        changes = {key: _change(item, f"acceleration: {key}") for key, item in value.items()}
        return {key: _as_given(*ends) for key, ends in changes.items()}
    return None if value is None else _as_given(*_change(value, "acceleration"))


def _change(value: Range, name: str) -> tuple[float, float]:
    """Bounds of an input's change per second; it can fall and rise, as it could not come back otherwise."""
    if isinstance(value, bool) or np.ndim(value) == 0:
        size = positive(value, name)
        return -size, size
    lower, upper = _ends(value, name, symmetric=True)
    if not lower < 0.0 < upper:
        raise InputError(where=name, expected="a number above 0 or [lower, upper] about 0", got=value)
    return lower, upper


def _as_given(lower: float, upper: float) -> Range:
    return upper if lower == -upper else [lower, upper]


def _sizes(value: float | Mapping[str, float] | None, name: str) -> float | Mapping[str, float] | None:
    if value is None:
        return None
    if isinstance(value, bool):
        raise InputError(where=name, expected="a number, or numbers by name", got=value)
    if isinstance(value, Mapping):
        return {key: positive(item, f"{name}: {key}") for key, item in value.items()}
    return positive(value, name)
