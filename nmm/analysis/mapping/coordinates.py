"""Maps of singularity and manipulability over two coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.jacobians import Subject
from nmm.analysis.mapping.evaluation import Evaluator, Progress, Smallness, between
from nmm.analysis.mapping.result import About, Map
from nmm.analysis.mapping.singular_set import SingularSet, singular_set
from nmm.analysis.parts import WHOLE
from nmm.arrays import Array, vector
from nmm.errors import InputError, unknown
from nmm.resolvers.weights import Weights
from nmm.robot import Robot

#: How far to both sides a coordinate without limits is mapped when no range is given, m.
SIDE = 1.0


def singularity_map(
    subject: Subject,
    over: Sequence[str] = ("q1", "q2"),
    *,
    ranges: Mapping[str, Sequence[float]] | None = None,
    samples: int | Sequence[int] = (200, 200),
    measures: str | Sequence[str] = ("sigma_min",),
    part: str = WHOLE,
    at: ArrayLike | Mapping[str, float] | None = None,
    t: float = 0.0,
    alpha: float = 0.5,
    weights: Weights | None = None,
    length: float | None = None,
    sizes: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Map:
    """Measures of J over two coordinates, the others held, and where J and the arm's part of it lose rank.

    Parameters
    ----------
    subject : a controller, or (robot, task)
    over : two coordinates, along the columns and along the rows
    ranges : (lower, upper) of either, m or rad, both ends included; without, the limits, of an angle not
        more than one turn: -π to π where it may; of a length without limits 1 m to both sides
    samples : how many along each, or (along the first, along the second); at least 2
    measures : some of sigma_min, condition, manipulability, arm_manipulability, platform_manipulability,
        weighted, eccentricity (`nmm.analysis.mapping.measures.MEASURES`)
    part : whose columns of J: "robot", "platform", "arm" or an arm's name
    at : the coordinates held, (n,) or by name; without, the configuration nearest to zero
    t : s
    alpha : the arm's share in "weighted", in [0, 1]
    weights : W > 0 of the inputs, by input or group ("platform", "arm"): the measures are of J W^(-1/2)
    length, sizes : as `analyse`; an input's limit as its size makes its top speed count as 1
    progress : called with the fraction done

    Raises
    ------
    InputError : an unknown coordinate, measure or part, a coordinate given twice, an empty range, fewer than
        two samples, a task of more rows than inputs
    """
    evaluator = Evaluator(
        subject,
        t=t,
        measures=measures,
        part=part,
        alpha=alpha,
        weights=weights,
        length=length,
        sizes=sizes,
    )
    robot = evaluator.robot
    held = robot.rest if at is None else robot.q(at)
    names, columns = coordinates(over, robot)
    axes = grid_axes(robot, names, held, ranges, sample_counts(samples))
    shape = len(axes[1]), len(axes[0])

    def placed(points: Array) -> Array:
        q = np.tile(held, (len(points), 1))
        q[:, columns] = points
        return q

    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    found = evaluator(placed(points), between(progress, 0.0, 0.8), arm=evaluator.arm_beside)
    full = len(evaluator.jacobians.rows)

    def singular(name: str, those: Smallness, report: Progress | None) -> SingularSet:
        J_of = evaluator.part_of(name)
        smallness = (those.sigma.reshape(shape), those.volume.reshape(shape))
        rank = those.rank.reshape(shape)
        return singular_set(lambda x: J_of(placed(x)), smallness, rank, full, axes, report)

    whole = singular(part, found.own, between(progress, 0.8, 0.1))
    arm = None if found.arm is None else singular("arm", found.arm, between(progress, 0.9, 0.1))
    if progress is not None:
        progress(1.0)
    return Map(
        kind="coordinates",
        about=About.of(evaluator, length, sizes),
        names=names,
        units=(robot.q_units[columns[0]], robot.q_units[columns[1]]),
        axes=axes,
        values={name: values.reshape(shape) for name, values in found.values.items()},
        rank=found.own.rank.reshape(shape),
        singular=whole,
        arm_singular=arm,
        q=held,
    )


def coordinates(over: Sequence[str], robot: Robot) -> tuple[tuple[str, str], list[int]]:
    """Two coordinates and their places in q."""
    given = [over] if isinstance(over, str) else list(over)
    if len(given) != 2:
        raise InputError(f"over: expected two coordinates, as in ('q1', 'q2'), got {over!r}")
    columns = [robot.coordinate(name) for name in given]
    if columns[0] == columns[1]:
        raise InputError(f"over: expected two different coordinates, got {given[0]} twice")
    return (given[0], given[1]), columns


def sample_counts(samples: int | Sequence[int]) -> tuple[int, int]:
    """How many along the first and the second axis."""
    given = list(samples) if isinstance(samples, Sequence) else [samples, samples]
    whole = len(given) == 2 and all(
        isinstance(n, int | np.integer) and not isinstance(n, bool) for n in given
    )
    if not whole or min(given) < 2:
        raise InputError(f"samples: expected a whole number, or two, of at least 2, got {samples!r}")
    return int(given[0]), int(given[1])


def grid_axes(
    robot: Robot,
    names: tuple[str, str],
    held: Array,
    ranges: Mapping[str, Sequence[float]] | None,
    counts: tuple[int, int],
) -> tuple[Array, Array]:
    """The coordinates of columns and rows."""
    given = dict(ranges or {})
    for name in given:
        if name not in names:
            raise InputError(unknown("coordinate", name, names, "ranges"))
    first, second = (
        np.linspace(
            *(checked_range(given[name], name) if name in given else usual_range(robot, name, held)), count
        )
        for name, count in zip(names, counts, strict=True)
    )
    return first, second


def checked_range(given: Sequence[float], name: str) -> tuple[float, float]:
    """(lower, upper) with room between them."""
    lower, upper = vector(given, 2, f"range of {name}")
    if not lower < upper:
        raise InputError(f"range of {name}: expected lower below upper, got {lower:g} to {upper:g}")
    return float(lower), float(upper)


def usual_range(robot: Robot, name: str, held: Array) -> tuple[float, float]:
    """The limits; of an angle at most one turn, of a length without limits `SIDE` to both sides."""
    index = robot.coordinate(name)
    lower, upper = robot.q_limits[index]
    if robot.q_units[index] == "m":
        middle = held[index]
        lower = lower if np.isfinite(lower) else middle - SIDE
        return float(lower), float(upper if np.isfinite(upper) else max(middle, lower) + SIDE)
    if upper - lower <= 2.0 * np.pi:
        # A joint that cannot move has a range all the same: the value that it is held at, with some room.
        return (float(lower), float(upper)) if lower < upper else (lower - 0.5, lower + 0.5)
    start = min(max(lower, -np.pi), upper - 2.0 * np.pi)
    return float(start), float(start + 2.0 * np.pi)
