"""Maps of singularity and manipulability over two coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.maps.measures import Evaluator, Judged, Smallness
from nmm.analysis.maps.result import About, Map
from nmm.analysis.maps.singular_set import SingularSet, singular_set
from nmm.analysis.singular.jacobians import Subject
from nmm.base.arrays import Array, counted, vector
from nmm.base.errors import InputError, expect
from nmm.base.progress import Progress, between
from nmm.model.robots.robot import Robot

#: Most nodes of a map in all; for more there is no picture, and soon no memory.
MOST_NODES = 4000 * 4000
#: Beyond it, m or rad, the digits of a sine or a position are lost.
FARTHEST = 1e6
#: How far to both sides a coordinate without limits is mapped when no range is given, m.
SIDE = 1.0


def singularity_map(
    subject: Subject,
    over: Sequence[str] = ("q1", "q2"),
    *,
    ranges: Mapping[str, Sequence[float]] | None = None,
    samples: int | Sequence[int] = (200, 200),
    at: ArrayLike | Mapping[str, float] | None = None,
    progress: Progress | None = None,
    **judged: Unpack[Judged],
) -> Map:
    """Measures of J over two coordinates, the others held, and where J and the arm's part of it lose rank.

    Parameters
    ----------
    subject : a controller, or (robot, task)
    over : two coordinates, along the columns and along the rows
    ranges : (lower, upper) of either, m or rad, both ends included; without, the limits, of an angle not
        more than one turn: -π to π where it may; of a length without limits 1 m to both sides
    samples : how many along each, or (along the first, along the second); at least 2
    at : the coordinates held, (n,) or by name; without, the configuration nearest to zero
    progress : called with the fraction done
    measures : some of sigma_min (without, this), inverse_condition, manipulability, arm_manipulability,
        platform_manipulability, weighted, eccentricity (`nmm.analysis.maps.measures.MEASURES`)
    part : whose columns of J: "robot" (without, this), "platform", "arm" or an arm's name
    t, alpha : s, without 0; the arm's share in "weighted", in [0, 1], without 0.5
    weights : W > 0 of the inputs, by input or group ("platform", "arm"): the measures are of J W^(-1/2)
    length, sizes : as `analyse`; an input's limit as its size makes its top speed count as 1

    Raises
    ------
    InputError : an unknown coordinate, measure or part, a part without inputs, a coordinate given twice, a
        range of one that is not mapped, a value of one that is, an empty range, fewer than two samples or
        more than `MOST_NODES` in all, a task of more rows than inputs

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> result = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), ("q1", "q2"), samples=20)
    >>> result.rank.shape, sorted(result.values)
    ((20, 20), ['sigma_min'])
    """
    evaluator = Evaluator(subject, **judged)
    robot = evaluator.robot
    held = robot.rest if at is None else robot.q(at)
    robot.check_followers(held)
    names, columns = coordinates(over, robot)
    if isinstance(at, Mapping):
        check_held(at, names, "at")
    axes = grid_axes(robot, names, held, ranges, sample_counts(samples))
    shape = len(axes[1]), len(axes[0])

    def placed(points: Array) -> Array:
        q = np.tile(held, (len(points), 1))
        q[:, columns] = points
        return robot.following.placed(q)

    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    evaluated = evaluator(placed(points), between(progress, 0.0, 0.8), arm=evaluator.arm_beside)
    full = len(evaluator.jacobians.rows)

    def singular(name: str, nodes: Smallness, report: Progress | None) -> SingularSet:
        J_of = evaluator.part_of(name)
        smallness = (nodes.sigma.reshape(shape), nodes.volume.reshape(shape))
        rank = nodes.rank.reshape(shape)
        return singular_set(lambda x: J_of(placed(x)), smallness, rank, full, axes, report)

    whole = singular(evaluator.part, evaluated.own, between(progress, 0.8, 0.1))
    arm = None if evaluated.arm is None else singular("arm", evaluated.arm, between(progress, 0.9, 0.1))
    if progress is not None:
        progress(1.0)
    return Map(
        kind="coordinates",
        robot=robot,
        about=About.of(evaluator),
        names=names,
        units=(robot.q_units[columns[0]], robot.q_units[columns[1]]),
        axes=axes,
        values={name: values.reshape(shape) for name, values in evaluated.values.items()},
        rank=evaluated.own.rank.reshape(shape),
        singular=whole,
        arm_singular=arm,
        q=held,
    )


def coordinates(over: Sequence[str], robot: Robot) -> tuple[tuple[str, str], list[int]]:
    names = [over] if isinstance(over, str) else list(over)
    expect(len(names) == 2, "over", "two coordinates, as in ('q1', 'q2')", over)
    columns = [robot.independent(name) for name in names]
    expect(columns[0] != columns[1], "over", f"two different coordinates, got {names[0]} twice")
    return (names[0], names[1]), columns


def check_held(
    fixed: Iterable[str], varied: Sequence[str], what: str, how: str = "on an axis of the map"
) -> None:
    """`InputError` for a coordinate that is both fixed and varied: its value would not count."""
    for name in fixed:
        if name in varied:
            raise InputError(f"{name} is {how} ({', '.join(varied)})", where=what)


def sample_counts(samples: int | Sequence[int]) -> tuple[int, int]:
    if isinstance(samples, str) or not isinstance(samples, Sequence):
        samples = [samples, samples]
    expect(len(samples) == 2, "samples", "a whole number, or two", samples)
    columns, rows = counted(samples[0], "samples", 2), counted(samples[1], "samples", 2)
    most = f"at most {MOST_NODES} in all, as in 4000 x 4000, got {columns} x {rows}"
    expect(columns * rows <= MOST_NODES, "samples", most)
    return columns, rows


def grid_axes(
    robot: Robot,
    names: tuple[str, str],
    held: Array,
    ranges: Mapping[str, Sequence[float]] | None,
    counts: tuple[int, int],
) -> tuple[Array, Array]:
    spans = dict(ranges or {})
    for name in spans:
        if name not in names:
            robot.coordinate(name)  # names the ones there are
            raise InputError(f"{name} is not on an axis of the map ({', '.join(names)})", where="ranges")
    ends = [
        checked_range(spans[name], name) if name in spans else usual_range(robot, name, held)
        for name in names
    ]
    return np.linspace(*ends[0], counts[0]), np.linspace(*ends[1], counts[1])


def checked_range(span: Sequence[float], name: str) -> tuple[float, float]:
    """A range (lower, upper), checked: lower < upper, neither too far."""
    lower, upper = vector(span, 2, f"range of {name}")
    where, got = f"range of {name}", f"got {lower:g} to {upper:g}"
    expect(lower < upper, where, f"lower below upper, {got}")
    expect(max(-lower, upper) <= FARTHEST, where, f"no more than {FARTHEST:g} to either side, {got}")
    return float(lower), float(upper)


def usual_range(robot: Robot, name: str, held: Array) -> tuple[float, float]:
    """The limits; of an angle at most one turn, of a length without limits `SIDE` to both sides."""
    index = robot.coordinate(name)
    lower, upper = robot.q_limits[index]
    if robot.q_units[index] == "m":
        from_lower, to_upper = robot.limited[index]
        lower = lower if from_lower else min(held[index], upper) - SIDE
        upper = upper if to_upper else max(held[index], lower) + SIDE
    if robot.q_units[index] == "m" or upper - lower <= 2.0 * np.pi:
        # A joint that cannot move has a range all the same: the value that it is held at, with some room.
        return (float(lower), float(upper)) if lower < upper else (lower - 0.5, lower + 0.5)
    start = min(max(lower, -np.pi), upper - 2.0 * np.pi)
    return float(start), float(start + 2.0 * np.pi)
