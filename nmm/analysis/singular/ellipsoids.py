"""Manipulability ellipsoids: how fast a frame can move in each direction, by the robot and by its parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.parts import WHOLE, columns_of
from nmm.base.arrays import Array, array, matrix, positive
from nmm.base.ellipsoid_options import EllipsoidOptions, Sizes
from nmm.base.errors import InputError, expect
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.reach import first_tip
from nmm.model.robots.robot import Robot

#: Radii that differ by less than this fraction of the largest are equal: any axes in their plane will do.
EQUAL = 1e-9

#: The rotations of a cube, (24, 3, 3): all right-handed ways to order and sign three axes.
_TURNS = np.array(
    [
        turned
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
        if np.linalg.det(turned := np.eye(3)[:, order] * signs) > 0.0
    ]
)


@dataclass(frozen=True, eq=False)
class Ellipses:
    """Projections of ellipsoids onto a plane: centre (N, 2) m, columns axes (N, 2, 2), radii (N, 2) m/s.

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> whole = nmm.analysis.ellipsoids_along(robot, "ee", robot.q({"q2": 0.8, "q3": 0.8})[None])
    >>> seen = whole.projected()
    >>> isinstance(seen, nmm.analysis.Ellipses), seen.radii.shape, seen.outline().shape
    (True, (1, 2), (1, 96, 2))
    """

    center: Array
    axes: Array
    radii: Array

    def outline(self, scale: float = 1.0, points: int = 96) -> Array:
        """Closed outlines, (N, points, 2), m, drawn with `scale` metres for each m/s."""
        angles = np.linspace(0.0, 2.0 * np.pi, points)
        circle = np.array([np.cos(angles), np.sin(angles)])
        around = np.swapaxes((self.axes * self.radii[:, None]) @ circle, 1, 2)
        return np.asarray(self.center[:, None] + scale * around)


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """{J_v u : ‖u / input_sizes‖ <= 1} at N configurations: the velocities that a frame can have.

    J_v = (∂p/∂q) S, columns of the part's inputs, is that of the frame's origin in world axes; the radii are
    the singular values of J_v diag(input_sizes), the axes its left singular vectors (Yoshikawa 1985).

    Attributes
    ----------
    frame : the frame whose origin moves; part : "robot", "arm", "platform" or an arm by its name
    inputs : names of the part's k inputs; input_sizes (k,) : how much of each counts as 1, in its unit
    center (N, 3) : the frame's origin, m
    axes (N, 3, 3) : orthonormal, right-handed columns; by falling radius at the first sample, then each as
        near as possible to the one before: radii may cross, but axes neither swap nor flip
    radii (N, 3) : m/s along each axis; 0 where the part cannot move the frame, NaN where the wheels cannot
        roll (the axes stay as they were)

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> whole = nmm.analysis.ellipsoids_along(robot, "ee", robot.q({"q2": 0.8, "q3": 0.8})[None])
    >>> whole.radii.round(2), whole.center.round(2)
    (array([[1.3 , 1.11, 0.78]]), array([[1.06, 0.  , 1.04]]))
    """

    frame: str
    part: str
    inputs: tuple[str, ...]
    input_sizes: Array
    center: Array
    axes: Array
    radii: Array

    def __len__(self) -> int:
        return len(self.center)

    @property
    def matrices(self) -> Array:
        """J_v diag(input_sizes)² J_vᵀ, (N, 3, 3), m²/s²: vᵀ M⁻¹ v <= 1 inside, where M is regular."""
        halves = self.axes * self.radii[:, None]
        return np.asarray(halves @ np.swapaxes(halves, 1, 2))

    def support(self, directions: ArrayLike) -> Array:
        """Largest velocity along each direction (k, 3), (N, k) m/s: sqrt(dᵀ M d)."""
        along = array(directions, "directions").reshape(-1, 3)
        return np.asarray(np.linalg.norm((along @ self.axes) * self.radii[:, None], axis=2))

    def half_extents(self) -> Array:
        """Half the sides of the boxes around them along the world's axes, (N, 3) m/s."""
        return self.support(np.eye(3))

    def projected(self, directions: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))) -> Ellipses:
        """Their projections onto a plane, not sections.

        Parameters
        ----------
        directions : (2, 3), orthonormal, in the plane, in world axes
        """
        plane = matrix(directions, (2, 3), "directions of a plane")
        halves = plane @ (self.axes * self.radii[:, None])
        known = np.isfinite(halves).all(axis=(1, 2))
        axes, radii = np.tile(np.eye(2), (len(self), 1, 1)), np.full((len(self), 2), np.nan)
        axes[known], radii[known], _ = np.linalg.svd(halves[known])
        return Ellipses(self.center @ plane.T, axes, radii)


def ellipsoids_along(
    robot: Robot,
    frame: str | None,
    q: ArrayLike | Mapping[str, float],
    part: str = WHOLE,
    sizes: Sizes = None,
) -> Ellipsoids:
    """Manipulability ellipsoids of a frame's origin along a motion.

    Parameters
    ----------
    frame : the frame; None for the arm's tip, or the root link without an arm
    q : (N, n) m and rad, in the order of time; (n,) or by name for a single configuration
    part : "robot", "arm", "platform", or an arm by its name: its inputs move, the others rest
    sizes : how much of an input counts as 1, by name: 1 m/s or 1 rad/s where not named; "limits" for each
        input's limit (`robot.u_limits`)

    Raises
    ------
    InputError : an unknown frame, part or input; q of another shape; a size that is not above zero; an input
        without a limit

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_3r_position").run()
    >>> arm = nmm.analysis.ellipsoids_along(run.robot, "ee", run.q[::500], part="arm")
    >>> arm.radii.shape
    (11, 3)
    """
    frame = frame_of(robot, frame)
    chosen = columns_of(robot, part)
    points = _points(robot, q)
    size = input_sizes(robot, sizes, chosen)
    center, J = velocity_jacobians(robot, frame, points)
    axes, radii = _followed(J[:, :, chosen] * size)
    names = tuple(robot.u_names[column] for column in chosen)
    return Ellipsoids(frame, part, names, size, center, axes, radii)


def velocity_jacobians(robot: Robot, frame: str, q: Array) -> tuple[Array, Array]:
    """Origin of a frame (N, 3) m and J_v = (∂p/∂q) S (N, 3, m) at q (N, n), world axes. Not a task's J, whose
    rows cannot outnumber the inputs: two wheels move a point too."""
    center, jacobians = FramePath(robot, frame).jacobians(q)
    J = np.full((len(q), 3, robot.n_u), np.nan)
    for k, point in enumerate(q):
        if robot.platform.problem(point[: robot.platform.n_p]) is None:
            J[k] = jacobians[k] @ robot.S(point)
    return center, J


def frame_of(robot: Robot, frame: str | None) -> str:
    """The frame given, or the arm's tip, or the platform's root link without an arm."""
    if frame is None:
        frame = first_tip(robot) or _root(robot)
    robot.frame_id(frame)
    return frame


def carried_frame(robot: Robot, frame: str | None) -> str:
    """A task's frame if the arm carries it, else that of `frame_of` without one: a frame of the platform
    shows nothing of the arm."""
    frame = frame_of(robot, frame)
    joint = robot.model.frames[robot.frame_id(frame)].parentJoint
    below = robot.model.names[joint] in ("universe", *robot.q_names[: robot.platform.n_p])
    return frame_of(robot, None) if below else frame


def _root(robot: Robot) -> str:
    """The root link, or what else the platform carries."""
    model, joint = robot.model, robot.model.getJointId("theta") if robot.platform.n_p else 0
    carried = [frame.name for frame in model.frames if frame.parentJoint == joint]
    return next((name for name in carried if name not in ("theta", "universe")), robot.frames[-1])


def input_sizes(robot: Robot, sizes: Sizes, columns: list[int]) -> Array:
    """How much of some inputs counts as 1, (k,), in their units; see `ellipsoids_along`."""
    if isinstance(sizes, str):
        expect(sizes == "limits", "sizes", "sizes by the inputs' names, or 'limits'", sizes)
        limits: Array = robot.u_limits[columns]
        free = [robot.u_names[j] for j in columns if not np.isfinite(robot.u_limits[j])]
        if free:
            problem = f"{robot.name} has no limits of {', '.join(free)}; give their sizes"
            raise InputError(problem, where="sizes")
        return limits
    all_sizes = np.ones(robot.n_u)
    for name, value in (sizes or {}).items():
        all_sizes[robot.input(name)] = positive(value, f"size of {name}")
    return all_sizes[columns]


def _points(robot: Robot, q: ArrayLike | Mapping[str, float]) -> Array:
    """Configurations (N, n), checked; a single one as (1, n)."""
    if isinstance(q, Mapping) or np.ndim(q) == 1:
        return robot.q(q)[np.newaxis]
    points = array(q, "q")
    expected = f"rows of {robot.n} numbers ({', '.join(robot.q_names)}), got shape {points.shape}"
    expect(points.ndim == 2 and points.shape[1] == robot.n, "q", expected)
    return points


def _followed(A: Array) -> tuple[Array, Array]:
    """Axes (N, 3, 3) and radii (N, 3) of A (N, 3, k), ordered and signed as at the sample before."""
    count, known = len(A), np.asarray(np.isfinite(A).all(axis=(1, 2)))
    axes, radii = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    if A.shape[2]:
        axes[known], values, _ = np.linalg.svd(A[known])
        radii[known, : values.shape[1]] = values
        axes[:, :, 2] *= np.sign(np.linalg.det(axes))[:, np.newaxis]
    before = None
    for k in range(count):
        if known[k]:
            before = _readable(axes[k]) if before is None else before
            axes[k] = _nearest(axes[k], radii[k], before)
            radii[k] = np.linalg.norm(axes[k].T @ A[k], axis=1)
            before = axes[k]
        else:
            radii[k] = np.nan
            axes[k] = np.eye(3) if before is None else before
    return axes, radii


def _readable(axes: Array) -> Array:
    """The same axes, the first two with their largest component positive."""
    signs = np.sign(axes[np.abs(axes).argmax(axis=0), range(3)])
    signs[2] = signs[0] * signs[1]
    return axes * signs


def _nearest(axes: Array, radii: Array, before: Array) -> Array:
    """Axes (3, 3) of the same ellipsoid nearest to those before: reordered, signed and, where radii (3,) are
    equal, turned in their plane."""
    # Radii fall: those that are equal are neighbours.
    equal = [bool(gap <= EQUAL * radii[0]) for gap in radii[:-1] - radii[1:]]
    if all(equal):
        return before
    turn = _TURNS[np.einsum("ji,jl,tli->t", before, axes, _TURNS).argmax()]
    named: Array = axes @ turn
    if any(equal):
        alone = int(np.abs(turn[2 if equal[0] else 0]).argmax())
        plane = [i for i in range(3) if i != alone]
        # The rotation R in the plane that maximizes the trace of Rᵀ X.
        X = named[:, plane].T @ before[:, plane]
        angle = np.arctan2(X[1, 0] - X[0, 1], X[0, 0] + X[1, 1])
        c, s = np.cos(angle), np.sin(angle)
        named[:, plane] = named[:, plane] @ np.array([[c, -s], [s, c]])
    return named


ARM = "arm"
NAMES = {WHOLE: "whole robot", ARM: "arm alone"}

#: The largest radius is drawn at most as this fraction of the robot's extent.
SHARE = 1.0 / 3.0


def drawn_frame(options: EllipsoidOptions, robot: Robot, frame: str | None) -> str:
    """The frame in `options`; else the motion's own if the arm carries it, or the arm's tip."""
    return carried_frame(robot, frame) if options.frame is None else frame_of(robot, options.frame)


def drawn_ellipsoids(options: EllipsoidOptions, robot: Robot, frame: str, q: Array) -> dict[str, Ellipsoids]:
    """Those of the whole robot at q (N, n) and, if a platform moves it too, of the arm alone."""
    both = robot.platform.p > 0 and robot.n_u > robot.platform.p
    parts = (WHOLE, ARM) if both else (WHOLE,)
    return {part: ellipsoids_along(robot, frame, q, part, options.sizes) for part in parts}


def drawn_scale(
    options: EllipsoidOptions, extent: float, ellipsoids: Sequence[Mapping[str, Ellipsoids]]
) -> float:
    """Metres drawn for each m/s, for robots of that extent, m."""
    largest = largest_radius(ellipsoids)
    if options.scale is not None or not largest > 0.0:
        return 1.0 if options.scale is None else float(options.scale)
    most = SHARE * extent / largest
    power = 10.0 ** np.floor(np.log10(most))
    # The largest of 1, 2, 3, 4, 5 times a power of ten that is no more.
    return float(power * max(step for step in range(1, 6) if step * power <= most * (1.0 + 1e-9)))


def largest_radius(ellipsoids: Sequence[Mapping[str, Ellipsoids]]) -> float:
    """The largest radius of all, m/s; 0 where nothing moves."""
    radii = [part.radii[np.isfinite(part.radii)] for parts in ellipsoids for part in parts.values()]
    return max((float(known.max(initial=0.0)) for known in radii), default=0.0)


def scale_text(scale: float) -> str:
    return f"1 m/s is drawn as {scale:.3g} m"
