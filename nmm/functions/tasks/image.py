"""What a camera sees: points and lines in its picture, and how far ahead a point is."""

from __future__ import annotations

import math
from collections.abc import Sequence, Sized
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.errors import InputError, expect, few
from nmm.functions.function import Function, Row, Shown, Sight, Stage, stacked
from nmm.functions.program import evaluate
from nmm.functions.tasks.position import as_point, check_point
from nmm.kernels.compiled import compiled, kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.kernels.rotations import transposed_times3
from nmm.robots.configuration import Configuration
from nmm.robots.motion import NORMALISED
from nmm.robots.robot import Robot

#: Points that a camera sees: each as three numbers, a frame's name or a function; or `MeasuredPoints`.
Points: TypeAlias = Function | Sequence[Function | str | ArrayLike]
#: What the names of frames have that look along their z axis, with x to the right and y down (REP-103).
OPTICAL = "optical"


@compiled
def look_at(at: At, frames: Frames, rows: Rows, point: int) -> None:
    """A point in world axes, the rows 3 point to 3 point + 2, becomes P, as the frame sees it, in place:
    P = Rᵀ (p - c), Ṗ = Rᵀ (ṗ - ċ - ω × (p - c))."""
    slot, first = frames.slots[0], 3 * point
    frame = frames.placements[slot]
    d, x, seen = scratch(3), scratch(3), scratch(3)
    for i in range(3):
        d[i] = rows.value[first + i] - frame[i, 3]
    for column in range(-1, at.q.shape[0]):  # -1: the time
        if column < 0:
            for i in range(3):
                x[i] = rows.value_t[first + i]
        else:
            j = frames.jacobians[slot]
            wx, wy, wz = j[3, column], j[4, column], j[5, column]
            x[0] = rows.value_q[first, column] - j[0, column] - (wy * d[2] - wz * d[1])
            x[1] = rows.value_q[first + 1, column] - j[1, column] - (wz * d[0] - wx * d[2])
            x[2] = rows.value_q[first + 2, column] - j[2, column] - (wx * d[1] - wy * d[0])
        transposed_times3(frame, x, seen)
        for i in range(3):
            if column < 0:
                rows.value_t[first + i] = seen[i]
            else:
                rows.value_q[first + i, column] = seen[i]
    transposed_times3(frame, d, seen)
    for i in range(3):
        rows.value[first + i] = seen[i]


@kernel(FUNCTION)
def image_points(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """(fx X/Z + cx, fy Y/Z + cy) of each point, by the chain rule, in place: three rows a point become two;
    numbers = [fx, fy, cx, cy]. Behind the camera there is no picture: the values are not numbers."""
    for point in range(rows.value.shape[0] // 3):
        look_at(at, frames, rows, point)
        first, two = 3 * point, 2 * point
        Z = rows.value[first + 2]
        ahead = 1.0 / Z if Z > 0.0 else math.nan
        x, y = ahead * rows.value[first], ahead * rows.value[first + 1]
        fx, fy = numbers[0], numbers[1]
        dX, dY, dZ = rows.value_t[first], rows.value_t[first + 1], rows.value_t[first + 2]
        rows.value_t[two] = fx * (ahead * (dX - x * dZ))
        rows.value_t[two + 1] = fy * (ahead * (dY - y * dZ))
        for k in range(at.q.shape[0]):
            dX, dY, dZ = rows.value_q[first, k], rows.value_q[first + 1, k], rows.value_q[first + 2, k]
            rows.value_q[two, k] = fx * (ahead * (dX - x * dZ))
            rows.value_q[two + 1, k] = fy * (ahead * (dY - y * dZ))
        rows.value[two] = fx * x + numbers[2]
        rows.value[two + 1] = fy * y + numbers[3]


@kernel(FUNCTION)
def image_moments(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The mean (x, y) of k points, of which two rows each are there, and log a, a² the mean square of their
    distance from it, by the chain rule, in place."""
    k = rows.value.shape[0] // 2
    mean, d = scratch(2), scratch(2)
    for i in range(2):
        mean[i] = 0.0
        for point in range(k):
            mean[i] += rows.value[2 * point + i] / k
    square = 0.0
    for row in range(2 * k):
        rows.value[row] -= mean[row % 2]
        square += rows.value[row] * rows.value[row] / k
    spread = square if square > 0.0 else math.nan  # points that coincide have no size
    for column in range(-1, at.q.shape[0]):  # -1: the time
        d[0], d[1], growth = 0.0, 0.0, 0.0
        for row in range(2 * k):
            rate = rows.value_t[row] if column < 0 else rows.value_q[row, column]
            d[row % 2] += rate / k
            growth += rows.value[row] * rate / (k * spread)
        if column < 0:
            rows.value_t[0], rows.value_t[1], rows.value_t[2] = d[0], d[1], growth
        else:
            rows.value_q[0, column], rows.value_q[1, column], rows.value_q[2, column] = d[0], d[1], growth
    rows.value[0], rows.value[1], rows.value[2] = mean[0], mean[1], 0.5 * math.log(spread)


@kernel(FUNCTION)
def log_depth(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """log Z, by the chain rule, in place: the first three rows hold the point."""
    look_at(at, frames, rows, 0)
    Z = rows.value[2]
    ahead = 1.0 / Z if Z > 0.0 else math.nan
    rows.value_t[0] = ahead * rows.value_t[2]
    for k in range(at.q.shape[0]):
        rows.value_q[0, k] = ahead * rows.value_q[2, k]
    rows.value[0] = math.log(Z) if Z > 0.0 else math.nan


@compiled
def picture(X: float, Y: float, Z: float, numbers: Array) -> tuple[float, float]:
    """The first two homogeneous coordinates of a point's picture; the third is Z."""
    return numbers[0] * X + numbers[2] * Z, numbers[1] * Y + numbers[3] * Z


@kernel(FUNCTION)
def image_line(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """(ρ, θ) of the line x cos θ + y sin θ = ρ through two points, by the chain rule, in place: six rows
    become two; numbers = [fx, fy, cx, cy]. With n = a × b of the points' homogeneous pictures, θ =
    atan2(n_y, n_x) and ρ = -n_z / |(n_x, n_y)|."""
    look_at(at, frames, rows, 0)
    look_at(at, frames, rows, 1)
    a3, b3 = rows.value[2], rows.value[5]
    a1, a2 = picture(rows.value[0], rows.value[1], a3, numbers)
    b1, b2 = picture(rows.value[3], rows.value[4], b3, numbers)
    n1, n2, n3 = a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1
    square = n1 * n1 + n2 * n2
    seen = (a3 > 0.0 or b3 > 0.0) and square > 0.0
    size = math.sqrt(square) if seen else math.nan
    for k in range(-1, at.q.shape[0]):  # -1: the time
        d = scratch(6)
        for i in range(6):
            d[i] = rows.value_t[i] if k < 0 else rows.value_q[i, k]
        da3, db3 = d[2], d[5]
        da1, da2 = picture(d[0], d[1], da3, numbers)
        db1, db2 = picture(d[3], d[4], db3, numbers)
        dn1 = da2 * b3 + a2 * db3 - da3 * b2 - a3 * db2
        dn2 = da3 * b1 + a3 * db1 - da1 * b3 - a1 * db3
        dn3 = da1 * b2 + a1 * db2 - da2 * b1 - a2 * db1
        along = (n1 * dn1 + n2 * dn2) / size
        d_rho = (n3 * along / size - dn3) / size
        d_theta = (n1 * dn2 - n2 * dn1) / (size * size)
        if k < 0:
            rows.value_t[0], rows.value_t[1] = d_rho, d_theta
        else:
            rows.value_q[0, k], rows.value_q[1, k] = d_rho, d_theta
    rows.value[0] = -n3 / size
    rows.value[1] = math.atan2(n2, n1)


def optical_frame(camera: str, robot: Robot) -> str:
    """The frame of a camera: the one of this name, or, without one, the only one that is called optical."""
    if camera:
        robot.frame_id(camera)
        return camera
    found = [name for name in robot.frames if OPTICAL in name]
    if len(found) != 1:
        got = few(found) if found else "none is called optical"
        raise InputError(where="camera", expected="the name of a camera's frame", got=got)
    return found[0]


class Seen(Function):
    """A function of what a camera sees of points. Its frame has z ahead, x to the right, y down (REP-103)."""

    camera: str
    points: tuple[Function, ...]
    intrinsics: Array
    _line = False
    #: How many points it takes.
    _least, _most = 1, math.inf

    def __init__(
        self,
        points: Points,
        camera: str | None = None,
        intrinsics: ArrayLike | None = None,
    ) -> None:
        self._see(camera, points)
        self._measured_by(intrinsics)

    @property
    def _rows(self) -> tuple[tuple[int, int], ...]:
        """Its rows that are x and y of each point."""
        return ()

    def _see(self, camera: str | None, points: Points) -> None:
        """`points` are some, each a function of three rows, or one function of three rows a point."""
        self.camera = camera or ""
        if isinstance(points, Function):
            expect(isinstance(points, Sized), "points", "a list of points", points)
            self.points = (points,)
        else:
            expect(not isinstance(points, str), "points", "a list of points", points)
            self.points = tuple(as_point(one, "points") for one in points)
        self.count = sum(len(one) if isinstance(one, Sized) else 1 for one in self.points)
        most = "" if math.isinf(self._most) else f", at most {self._most}"
        wanted = f"a list of points, at least {self._least}{most}"
        expect(self._least <= self.count <= self._most, "points", wanted, points)
        self.intrinsics = np.array(NORMALISED)

    def _measured_by(self, intrinsics: ArrayLike | None) -> None:
        self.intrinsics = vector(NORMALISED if intrinsics is None else intrinsics, 4, "intrinsics")
        expect(bool(np.all(self.intrinsics[:2] > 0.0)), "intrinsics", "fx and fy above 0", intrinsics)
        self._unit = "1" if intrinsics is None else "px"

    def _placed(self, robot: Robot) -> str:
        """The camera's frame; `InputError` for points that it cannot see."""
        camera = optical_frame(self.camera, robot)
        for point in self.points:
            if not isinstance(point, Sized):
                check_point(point, camera, robot, "points")
        return camera

    def _row(self, camera: str, name: str) -> Row:
        size = float(max(self.intrinsics[:2]))
        return Row(f"{camera}.{name}", self._unit, scale=None if self._unit == "1" else size)

    def shown(self) -> Shown:
        fx, fy, cx, cy = self.intrinsics.tolist()
        points = tuple(one for point in self.points for one in getattr(point, "true_points", (point,)))
        return Shown(sees=Sight(self.camera, points, self._rows, (fx, fy, cx, cy), self._line))

    def undefined(self, robot: Robot, t: float, q: Array) -> str:
        here = Configuration(robot, q)
        camera = optical_frame(self.camera, robot)
        seen_by = here.placement(camera)
        points = np.concatenate([evaluate(one, t, here).value for one in self.points]).reshape(-1, 3)
        for k, point in enumerate(points):
            which = f"point {k + 1} of {self.count}" if self.count > 1 else "the point"
            if not np.isfinite(point).all():
                return f"no picture has shown {which} yet"
            Z = float(seen_by.actInv(point)[2])
            if Z <= 0.0:
                return f"{which} is behind {camera} (Z = {Z:.3g} m)"
        return ""


class ImagePoints(Seen):
    """Where a camera sees points: x and y of each, in its picture.

    Normalised coordinates x = X/Z, y = Y/Z, or pixels fx x + cx, fy y + cy with the camera's intrinsics. With
    L of the point, ẋ = L(x, y, Z) v_camera, its Jacobian is L times that of the camera's frame (Chaumette and
    Hutchinson, Visual servo control I, IEEE Robotics and Automation Magazine 13 (2006), eq. 11). As limits
    (`Bound`) they keep points in the picture. Undefined behind the camera (Z <= 0): a run ends there.

    Parameters
    ----------
    points : one or more, each as three numbers (world axes, m), the name of a frame (its origin), or a
        function with three rows, of time (circle, spline, ...) or of the configuration; or `MeasuredPoints`
    camera : its frame, z ahead, x right, y down; when not given, the only one whose name has "optical" in it
    intrinsics : fx, fy, cx, cy, px; normalised coordinates when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_pan_tilt")
    >>> here = nmm.Configuration(robot, robot.rest)
    >>> nmm.evaluate(nmm.ImagePoints([[2.0, 0.5, 0.6]]), 0.0, here).value.round(3)
    array([-0.286,  0.057])
    """

    @property
    def _rows(self) -> tuple[tuple[int, int], ...]:
        return tuple((2 * k, 2 * k + 1) for k in range(self.count))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        camera, many = self._placed(robot), self.count > 1
        return tuple(
            self._row(camera, f"{axis}{k + 1 if many else ''}") for k in range(self.count) for axis in "xy"
        )

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        camera = self._placed(robot)
        own = Stage(image_points, 3 * self.count, (camera,), self.intrinsics)
        return (*stacked(self.points, robot), own)


class ImageMoments(Seen):
    """Where a camera sees a thing that several points mark, and how large: their mean x and y, and log a.

    a² is the mean square of the points' distance from the mean in the picture. Half as far a thing is twice
    as large: log a grows by log 2 = 0.69 (F. Chaumette, Image moments, IEEE Trans. Robotics 20 (2004)). Where
    the points coincide in the picture, and where one is behind the camera (Z <= 0), it is undefined.

    Parameters
    ----------
    points : two or more, as those of `ImagePoints`
    camera, intrinsics : as of `ImagePoints`

    Examples
    --------
    >>> robot = nmm.load("unicycle_pan_tilt")
    >>> board = nmm.ImageMoments([[2.0, y, z] for y in (-0.2, 0.2) for z in (0.5, 0.9)])
    >>> nmm.evaluate(board, 0.0, nmm.Configuration(robot, robot.rest)).value.round(3)
    array([ 0.   ,  0.   , -1.822])
    """

    _least = 2

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        camera = self._placed(robot)
        return (*(self._row(camera, axis) for axis in "xy"), Row(f"{camera}.log_size", "1"))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        seen = Stage(image_points, 3 * self.count, (self._placed(robot),), self.intrinsics)
        return (*stacked(self.points, robot), seen, Stage(image_moments, 2 * self.count))


class ImageLine(Seen):
    """The line through two points in a camera's picture: ρ and θ of x cos θ + y sin θ = ρ.

    θ turns by π where the points are exchanged; ρ is in the unit of `ImagePoints`. Undefined where both
    points are behind the camera (Z <= 0).

    Parameters
    ----------
    points : two, as those of `ImagePoints`
    camera, intrinsics : as of `ImagePoints`

    Examples
    --------
    >>> robot = nmm.load("unicycle_pan_tilt")
    >>> here = nmm.Configuration(robot, robot.rest)
    >>> kerb = nmm.ImageLine([[1.0, -0.5, 0.0], [5.0, -0.5, 0.0]])
    >>> nmm.evaluate(kerb, 0.0, here).value.round(3)
    array([ 0.  , -0.62])
    """

    _line, _least, _most = True, 2, 2

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        camera = self._placed(robot)
        return (self._row(camera, "rho"), Row(f"{camera}.theta", "rad", angular=True))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        camera = self._placed(robot)
        return (*stacked(self.points, robot), Stage(image_line, 6, (camera,), self.intrinsics))


class LogDepth(Seen):
    """log Z of a point, Z (m) being how far ahead of a camera it is: relative distances are alike.

    Undefined behind the camera (Z <= 0).

    Parameters
    ----------
    point : as one of `ImagePoints`
    camera : as of `ImagePoints`

    Examples
    --------
    >>> robot = nmm.load("unicycle_pan_tilt")
    >>> here = nmm.Configuration(robot, robot.rest)
    >>> np.exp(nmm.evaluate(nmm.LogDepth([2.0, 0.5, 0.6]), 0.0, here).value).round(3)
    array([1.75])
    """

    def __init__(self, point: Function | str | ArrayLike, camera: str | None = None) -> None:
        self._see(camera, [point])

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row(f"{self._placed(robot)}.log_depth", "1"),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        camera = self._placed(robot)
        return (*self.points[0].stages(robot), Stage(log_depth, 3, (camera,)))
