"""What a camera sees: points and lines in its picture, and how far ahead a point is."""

from __future__ import annotations

import math
from collections.abc import Sequence, Sized
from copy import copy
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, vector
from nmm.base.errors import InputError, expect, few
from nmm.control.functions.function import Function, Row, Shown, Sight, Stage, stacked
from nmm.control.functions.program import evaluate
from nmm.control.functions.tasks.image_kernels import image_line, image_moments, image_points, log_depth
from nmm.control.functions.tasks.position import as_point, check_point
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.motion import NORMALISED
from nmm.model.robots.robot import Robot

#: Points that a camera sees: each as three numbers, a frame's name or a function; or `MeasuredPoints`.
Points: TypeAlias = Function | Sequence[Function | str | ArrayLike]
#: What the names of frames have that look along their z axis, with x to the right and y down (REP-103).
OPTICAL = "optical"


def optical_frame(camera: str, robot: Robot) -> str:
    """The frame of a camera: the one of this name, or, without one, the only one that is called optical."""
    if camera:
        robot.frame_id(camera)
        return camera
    optical = [name for name in robot.frames if OPTICAL in name]
    if len(optical) != 1:
        got = few(optical) if optical else "none is called optical"
        raise InputError(where="camera", expected="the name of a camera's frame", got=got)
    return optical[0]


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
            self.points = tuple(as_point(point, "points") for point in points)
        self.count = sum(len(point) if isinstance(point, Sized) else 1 for point in self.points)
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
        points = tuple(
            true_point for point in self.points for true_point in getattr(point, "true_points", (point,))
        )
        others = self._of_others if points == self.points else None  # measured ones are where pictures say
        return Shown(sees=Sight(self.camera, points, self._rows, (fx, fy, cx, cy), self._line, others))

    def _of_others(self, points: tuple[Function, ...]) -> Self:
        another = copy(self)
        another.points = points
        return another

    def undefined(self, robot: Robot, t: float, q: Array) -> str:
        configuration = Configuration(robot, q)
        camera = optical_frame(self.camera, robot)
        seen_by = configuration.placement(camera)
        points = np.concatenate(
            [evaluate(function, t, configuration).value for function in self.points]
        ).reshape(-1, 3)
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
    points : one or more points: three numbers (world axes, m), a frame's name (its origin), or a function of
        three rows; or `MeasuredPoints`
    camera : its frame, z ahead, x right, y down; by default the only one with "optical" in its name
    intrinsics : fx, fy, cx, cy, px; normalised coordinates by default

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
