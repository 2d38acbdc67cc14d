"""Maps over a plane of the workspace: what the arm can do best, and worst, where it puts a frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.maps.coordinates import check_held, checked_range, sample_counts
from nmm.analysis.maps.measures import Evaluator, Judged
from nmm.analysis.maps.reach import AXES, ArmReach
from nmm.analysis.maps.result import About, Map
from nmm.analysis.maps.search import PostureSearch
from nmm.analysis.maps.singular_set import SingularSet, curves_and_points, polish
from nmm.analysis.singular.jacobians import Subject
from nmm.base.arrays import Array, Integers, counted
from nmm.base.errors import InputError, expect
from nmm.base.progress import Progress, between
from nmm.model.robots.frame_path import FramePath

#: Postures drawn, and how many of them are led to a singular one each to draw these.
CONFIGURATIONS, SINGULAR_STARTS = 1 << 16, 1 << 9
#: The longest step of the search for singular postures, of a joint's range, how many of them, and how far it
#: may go in all, in such steps.
UNIT, STEPS, FARTHEST = 0.05, 20, 10.0
#: So many postures tell along which axes the frame moves: by more than this, m, or of its longest way.
EDGE_ON, FLAT = 64, 1e-6
#: To be curves, singular places are at least so many in all and so many on each, next to each other on a grid
#: of so many cells, and the middle one of three so near, in cells, to the other two's line.
FEWEST, SHORTEST, ACROSS, CROOKED = 64, 20, 40, 0.1
#: What the joints of the postures are, to one who would hold them.
VARIED = "varied over the workspace"
#: Postures of one singular place put the frame there up to so much, m: σ is found zero up to rounding.
SAME = 1e-6


def workspace_map(
    subject: Subject,
    frame: str | None = None,
    *,
    plane: str = "xy",
    height: Sequence[float] | None = None,
    samples: int = 500,
    configurations: int = CONFIGURATIONS,
    ranges: Mapping[str, Sequence[float]] | None = None,
    at: ArrayLike | Mapping[str, float] | None = None,
    progress: Progress | None = None,
    **judged: Unpack[Judged],
) -> Map:
    """The best and the worst value of each measure over the arm's postures that put a frame onto each cell.

    The platform stands at `at`. Postures are drawn over the joints' limits; from the best of a block of cells
    a step of Newton's leads to one in each smaller block, and so on down to the cells; cells that are left
    are reached from their neighbours. Each posture is brought to its cell's middle and judged there, or on
    the rim, where that is out of reach, as near as it was found to come. So each value is that of a posture
    that is kept; where the arm has more joints than the plane needs, a better one may exist. The third
    coordinate of the frame is free unless `height` holds it, and so is its orientation. The singular places
    are those of a sample of singular postures: lines where they lie on curves, else points.

    Parameters
    ----------
    subject : a controller, or (robot, task)
    frame : the frame mapped; without, that of the task's first function
    plane : two of x, y, z: along the columns, along the rows
    height : (lower, upper) of the third, m
    samples : cells along the longer side, at least 2
    configurations : postures drawn, up to the next power of 2
    ranges : of the arm's joints, (lower, upper); without, the limits, of an angle at most one turn
    at : where the platform stands, (n,) or by name, and joints that move neither frame nor task
    progress, measures, part, t, alpha, weights, length, sizes : as `singularity_map`

    Raises
    ------
    InputError : a robot without an arm, or one that moves the frame in no way, or not in both directions of
        the plane; an unknown frame, joint, measure or part; an empty range; a value of a joint that is
        varied; fewer than two samples or too many; a part without inputs, a task of more rows than inputs

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> area = nmm.analysis.workspace_map((robot, nmm.Position("ee", "xy")), samples=40, configurations=1024)
    >>> area.kind, area.names
    ('workspace', ('x', 'y'))
    """
    evaluator = Evaluator(subject, **judged)
    robot = evaluator.robot
    expect(len(robot.arm_coordinates), "workspace map", f"a robot with an arm, {robot.name} has none")
    longest, _ = sample_counts(samples)
    count = counted(configurations, "configurations", 2)
    slab = None if height is None else checked_range(height, "height")
    two = len(plane) == 2 and plane[0] != plane[1] and set(plane) <= set(AXES)
    expect(two, "plane", "two of x, y, z, as in 'xy'", plane)
    held = robot.rest if at is None else robot.q(at)
    robot.check_followers(held)
    frame = _task_frame(evaluator) if frame is None else frame
    robot.frame_id(frame)
    moving = _moving(evaluator, frame, held)
    if isinstance(at, Mapping):
        check_held(at, [robot.q_names[j] for j in moving], "at", VARIED)
    reach = ArmReach(robot, frame, plane, slab, held, moving, ranges)
    _check_plane(reach)
    # The stages' shares of the progress, as long as they take with three joints.
    shares = np.array([0.4, 0.35 if len(reach.moving) > 2 else 0.0, 0.05, 0.1, 0.05, 0.05])
    shares /= shares.sum()
    ends = zip(shares.cumsum(), shares, strict=True)
    drawing, spreading, filling, evening, ours, arms = (
        between(progress, end - share, share) for end, share in ends
    )
    search = PostureSearch(evaluator, reach, longest, 1 << (count - 1).bit_length(), drawing)
    search.spread(spreading)
    search.fill(filling)
    search.even(evening)
    whole = _singular_places(evaluator, reach, evaluator.part, ours)
    arm = _singular_places(evaluator, reach, "arm", arms) if evaluator.arm_beside else None
    if progress is not None:
        progress(1.0)
    (best, best_q), (worst, worst_q) = search.found(1.0), search.found(-1.0)
    return Map(
        kind="workspace",
        robot=robot,
        about=About.of(evaluator),
        names=(plane[0], plane[1]),
        units=("m", "m"),
        axes=search.grid.axes,
        values=best,
        rank=search.rank.reshape(search.grid.rows, -1),
        singular=whole,
        arm_singular=arm,
        q=held,
        frame=frame,
        height=slab,
        worst=worst,
        best_q=best_q,
        worst_q=worst_q,
    )


def check_given(fixed: Iterable[str], subject: Subject, frame: str | None, q: Array, what: str) -> None:
    """`InputError` for one of the coordinates `fixed`, in `what`, that `workspace_map` varies."""
    evaluator = Evaluator(subject)
    robot = evaluator.robot
    if any(robot.coordinate(name) >= robot.platform.n_p for name in fixed):
        moving = _moving(evaluator, _task_frame(evaluator) if frame is None else frame, q)
        check_held(fixed, [robot.q_names[j] for j in moving], what, VARIED)


def _task_frame(evaluator: Evaluator) -> str:
    """The frame that the task speaks of first."""
    for task in evaluator.jacobians.task:
        name = getattr(task.function, "frame", None)
        if isinstance(name, str):
            return name
    frames = ", ".join(evaluator.robot.frames)
    raise InputError(where="frame", expected=f"one, the task speaks of none; available: {frames}")


def _moving(evaluator: Evaluator, frame: str, held: Array) -> Integers:
    """The arm's joints that move the frame's origin or the task."""
    robot = evaluator.robot
    arm = robot.arm_coordinates
    q = np.tile(held, (8, 1))
    q[:, arm] += np.random.default_rng(0).uniform(-1.0, 1.0, (8, len(arm)))
    q = robot.following.placed(q)
    effect = np.abs(np.nan_to_num(evaluator.jacobians.batch(q, evaluator.t)))[:, :, robot.platform.p :]
    at_frame = np.abs(FramePath(robot, frame).jacobians(q)[1] @ np.array([robot.S(point) for point in q]))
    moved = (effect.max(axis=(0, 1)) > 1e-9) | (at_frame.max(axis=(0, 1))[robot.platform.p :] > 1e-9)
    if not moved.any():
        raise InputError(f"the arm of {robot.name} moves {frame} in no way", where="workspace map")
    return np.asarray(arm[moved], dtype=np.int64)


def _check_plane(reach: ArmReach) -> None:
    """`InputError` for an arm that moves the frame in a plane seen edge-on; it says which plane that is."""
    points = reach.positions(reach.postures(EDGE_ON))
    size = np.ptp(points, axis=0)
    flat = [axis for axis in range(3) if size[axis] <= FLAT * max(1.0, float(size.max()))]
    if not set(flat) & set(reach.in_plane) or len(flat) == 3:
        return  # the search says that nothing moves
    held = ", ".join(f"{AXES[axis]} = {points[0, axis]:.4g} m" for axis in flat)
    if len(flat) > 1:
        what = f"{reach.frame} moves along a line, {held} only; it fills no plane"
        raise InputError(what, where="workspace map")
    (across,) = (AXES[axis] for axis in flat)
    where = "a horizontal plane" if across == "z" else "a vertical plane"
    other = AXES.replace(across, "")
    raise InputError(f"{reach.frame} moves in {where}, {held} only; try --workspace {other}")


def _singular_places(
    evaluator: Evaluator, reach: ArmReach, part: str, progress: Progress | None
) -> SingularSet:
    """Positions of the frame in singular postures of the part, those nearest to some drawn postures."""
    if len(evaluator.columns[part]) < len(evaluator.jacobians.rows):
        return SingularSet(everywhere=True)
    size = reach.upper - reach.lower
    J_of = evaluator.part_of(part)

    def placed(x: Array) -> Array:
        return reach.placed(reach.lower + UNIT * size * x)

    start = (reach.postures(SINGULAR_STARTS)[:, reach.moving] - reach.lower) / (UNIT * size)
    singular = polish(lambda x: J_of(placed(x)), start, FARTHEST, STEPS, progress)
    if np.array_equal(singular, start):  # not one needed a step
        return SingularSet(everywhere=True)
    singular = singular[np.all((singular > -1e-9) & (UNIT * singular < 1.0 + 1e-9), axis=1)]
    points = reach.positions(placed(singular))
    return in_curves(points[reach.held(points)][:, reach.in_plane])


def in_curves(points: Array) -> SingularSet:
    """Curves, where all of the points lie on some; else they fill regions, and stay points."""
    _, first = np.unique(np.round(points / SAME), axis=0, return_index=True)
    points = points[np.sort(first)]
    if len(points) < FEWEST:
        return SingularSet(points=points)
    lower = points.min(axis=0)
    scale = float(np.ptp(points, axis=0).max()) / ACROSS
    lines, alone = curves_and_points((points - lower) / scale)
    # A walk from point to point of a cloud is short or crooked.
    smooth = all(len(line) >= SHORTEST and np.median(_crookedness(line)) <= CROOKED for line in lines)
    if not lines or len(alone) or not smooth:
        return SingularSet(points=points)
    return SingularSet(tuple(lower + scale * line for line in lines))


def _crookedness(line: Array) -> Array:
    """How far each point is from the straight line through those before and after it, (k - 2,)."""
    chord, offset = line[2:] - line[:-2], line[1:-1] - line[:-2]
    lengths = np.maximum(np.linalg.norm(chord, axis=1), 1e-12)
    return np.asarray(np.abs(chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0]) / lengths)
