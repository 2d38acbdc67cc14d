"""Points as a camera measures them: late, with noise, and without their depth."""

from __future__ import annotations

import math
import weakref
from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, counted, scalar, vector
from nmm.base.errors import InputError, expect
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.kernels.rotations import exp3
from nmm.control.functions.function import Function, LiveNumbers, Renewal, Row, Stage, move_rows
from nmm.control.functions.program import Program
from nmm.control.functions.references.live_target import signal
from nmm.control.functions.tasks.camera_faults import CameraFaults
from nmm.control.functions.tasks.depth_estimate import ALMOST_SURE, DepthEstimate, MotionEstimate
from nmm.control.functions.tasks.image import Points, Seen
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot


class MeasuredPoints(Seen):
    """Points where a camera's pictures say that they are in the world: three rows each.

    `ImagePoints(measured)` and `LogDepth(measured.point(0))` are tasks of what was measured. Between two
    pictures, and for the time that one takes to arrive, a point stands in the world while the camera moves:
    what is foretold is what the robot's own motion does to the picture. A point is put at its depth along the
    ray of its picture; the depth is given, or observed, from how the ray turns as the camera moves (it takes
    a translation across the ray to observe it).

    On a robot, `set` takes what was measured. `simulate` and `rollout` take pictures of `points` themselves;
    the first one is there when a run begins.

    Parameters
    ----------
    points : where they are, as those of `ImagePoints`, for a simulation; on a robot only their number matters
    camera, intrinsics : as of `ImagePoints`, as believed
    depth : of each point, m, as believed: a number, or one a point
    observed : whether the depth of points that stand is estimated
    moving : how fast the points' velocity changes, m/s²: their motion is then estimated and fed forward; 0
        for points that stand
    faults : of the simulation's camera, which else is perfect; its noise is also that of the estimates

    Examples
    --------
    >>> robot = nmm.load("unicycle_pan_tilt")
    >>> ball = nmm.MeasuredPoints([[2.0, 0.5, 0.6]], depth=1.0, observed=True)
    >>> middle = nmm.Task(nmm.ImagePoints(ball), [0.0, 0.0])
    >>> controller = nmm.Controller(robot, middle, nmm.ProjectedGradient())
    >>> ball.set([-0.2, 0.1], t=0.0, q=robot.rest)
    >>> controller.evaluate(0.1, robot.rest).r.round(3)
    array([-0.2,  0.1])
    """

    def __init__(
        self,
        points: Points,
        camera: str | None = None,
        intrinsics: ArrayLike | None = None,
        depth: ArrayLike = 1.0,
        observed: bool = False,
        faults: CameraFaults | None = None,
        moving: float = 0.0,
    ) -> None:
        self._see(camera, points)
        self._measured_by(intrinsics)
        k = self.count
        self.depth = each(depth, k, "depth")
        self.observed, self.faults = bool(observed), faults or CameraFaults()
        self.moving = scalar(moving, "moving", least=0.0)
        expect(not (self.observed and self.moving), "moving", "0 where the depth is observed", moving)
        self._pictures: weakref.WeakSet[Pictures] = weakref.WeakSet()
        self._robot: Robot | None = None
        self._taken: Belief | None = None
        #: What `signal` reads, as of the last picture, where a function is laid out after it.
        self._numbers = no_points(k)
        #: The time of the last picture, s, which `Age` reads.
        self._at = LiveNumbers(np.array([0.0]))

    def __len__(self) -> int:
        return self.count

    @property
    def true_points(self) -> tuple[Function, ...]:
        """What a simulation takes pictures of, and is drawn."""
        return self.points

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        camera = self._placed(robot)
        return tuple(Row(f"{camera}.point{k + 1}.{axis}", "m") for k in range(len(self)) for axis in "xyz")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        camera = self._placed(robot)
        self._robot, live = robot, Pictures(self, robot, camera)
        self._pictures.add(live)
        return (Stage(signal, 3 * len(self), (), live.numbers, live=live),)

    def point(self, k: int) -> Function:
        """One of them, from 0 on, as a point."""
        return MeasuredPoint(self, counted(k, "point", 0))

    def age(self) -> Function:
        """How old the last picture is that has all points, s: for a task's `While`."""
        return Age(self)

    def set(self, values: ArrayLike, t: float, q: ArrayLike, depth: ArrayLike | None = None) -> None:
        """What a picture shows, from the next step on.

        Parameters
        ----------
        values : (2 k,) or (k, 2), x and y of each point, in the unit of the image; not numbers for a point
            that is not in it
        t : when it was taken, s, in the controller's time
        q : (n,) the configuration then, by encoders and odometry
        depth : of each point, m, where a sensor or a model gives it: (k,) or a number

        Raises
        ------
        InputError : another number of numbers, a depth that is not above 0; no controller has these points
            yet
        """
        if self._robot is None:
            raise InputError("no controller has these points yet", where="set", expected="a controller first")
        if self._taken is None:
            self._taken = Belief(self)
        try:
            seen = np.asarray(values, dtype=np.float64).reshape(-1)
        except (TypeError, ValueError):
            raise InputError(where="values", expected=f"{2 * len(self)} numbers", got=values) from None
        expect(seen.size == 2 * len(self), "values", f"{2 * len(self)} numbers", seen.size)
        far = None if depth is None else each(depth, len(self), "depth")
        camera = self._placed(self._robot)
        placement = Configuration(self._robot, self._robot.q(q)).placement(camera)
        at = scalar(t, "t")
        numbers = self._taken.update(at, seen.reshape(-1, 2), placement.rotation, placement.translation, far)
        self._numbers = numbers
        for live in self._pictures:
            live.set(numbers)
        self._at.set(np.array([self._taken.oldest]))

    def __getstate__(self) -> dict[str, object]:
        """Copies are measured by themselves."""
        state = {**self.__dict__, "_pictures": None, "_robot": None, "_taken": None}
        return {**state, "_numbers": no_points(self.count)}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self._pictures = weakref.WeakSet()


def each(depth: ArrayLike, k: int, name: str) -> Array:
    """Depths (k,), m, given for all or one a point."""
    values = array(depth, name)
    depths = vector(np.full(k, values) if values.ndim == 0 else values, k, name)
    expect(bool(np.all(depths > 0.0)), name, "numbers above 0, m", depth)
    return depths


def no_points(k: int) -> Array:
    """The numbers of `signal` before a picture has shown k points."""
    return np.concatenate([np.zeros(2), np.full(3 * k, np.nan), np.zeros(3 * k)])


class Belief:
    """Where points are believed to be, picture by picture."""

    def __init__(self, of: MeasuredPoints) -> None:
        self._of, k = of, len(of)
        fx = float(min(of.intrinsics[:2]))
        self._noise = math.hypot(of.faults.noise, 0.3 if of.faults.whole else 0.0) / fx
        self._estimates = [DepthEstimate(float(depth), self._noise) for depth in of.depth]
        self._motions = [MotionEstimate(of.moving) for _ in of.depth]
        self._points, self._times = np.full((k, 3), np.nan), np.full(k, -np.inf)
        self._rates = np.zeros((k, 3))

    @property
    def oldest(self) -> float:
        """When the point was seen that has not been seen for longest, s."""
        return float(self._times.min())

    def update(self, t: float, seen: Array, R: Array, c: Array, depth: Array | None = None) -> Array:
        """The numbers of `signal` after a picture (k, 2) taken at t, s, from c (3,), m, in axes R."""
        fx, fy, cx, cy = self._of.intrinsics
        for k, (x, y) in enumerate((seen - [cx, cy]) / [fx, fy]):
            if not (math.isfinite(x) and math.isfinite(y)):
                continue
            self._times[k] = t
            if depth is None and self._of.observed:
                self._points[k] = self._estimates[k].update(t, x, y, R, c)
            else:
                far = self._of.depth[k] if depth is None else depth[k]
                self._points[k] = c + far * (R @ np.array([x, y, 1.0]))
                if self._of.moving:
                    noise = far * max(self._noise, ALMOST_SURE)
                    self._points[k], self._rates[k] = self._motions[k].update(t, self._points[k], noise)
        late = np.where(np.isfinite(self._times), t - self._times, 0.0)  # of points that this one lacks
        points = self._points + self._rates * late[:, np.newaxis]
        return np.concatenate([[float(self._of.moving > 0.0), t], points.ravel(), self._rates.ravel()])


class Pictures(Renewal):
    """The points' numbers along a run, whose camera takes pictures of the true points."""

    jumps = True

    def __init__(self, of: MeasuredPoints, robot: Robot, camera: str) -> None:
        self._of, self._robot, self._camera = of, robot, camera
        self._true = Program(robot, of.points)
        self._true.lay_out()
        faults = of.faults
        shift = np.zeros(6) if faults.hand_eye is None else vector(faults.hand_eye, 6, "hand_eye")
        self._moved, turned = shift[:3], np.empty((3, 3))
        exp3(shift[3:], turned)
        self._turned = turned
        super().__init__(of._numbers.copy())
        self.begin()

    def begin(self) -> None:
        self.events = []
        self._rng = np.random.default_rng(self._of.faults.seed)
        self._belief, self._next = Belief(self._of), 0
        self._waiting: deque[tuple[float, float, Array, Array, Array]] = deque()
        self._taken = self._lost = 0
        self._since, self._gap = 0.0, 0.0

    @property
    def due(self) -> float:
        arrives = self._waiting[0][0] if self._waiting else math.inf
        return min(arrives, self._next / self._of.faults.rate) - SOON

    def stays(self, times: Array, q: Array) -> int:
        return int(np.searchsorted(times, self.due))

    def renew(self, t: float, q: Array, real: Array | None = None) -> None:
        faults = self._of.faults
        if t >= self._next / faults.rate - SOON:
            self._next = math.floor((t + SOON) * faults.rate) + 1
            self._take(t, q, q if real is None else real)
        while self._waiting and self._waiting[0][0] <= t + SOON:
            _, taken, seen, R, c = self._waiting.popleft()
            self._of._numbers = self._belief.update(taken, seen, R, c)
            self.set(self._of._numbers)
            if np.isfinite(self._belief.oldest):
                self._of._at.set(np.array([self._belief.oldest]))

    def _take(self, t: float, q: Array, real: Array) -> None:
        """Take a picture where the robot is, which is believed to be at q."""
        of, faults = self._of, self._of.faults
        placement = Configuration(self._robot, q).placement(self._camera)
        true_placement = placement if real is q else Configuration(self._robot, real).placement(self._camera)
        R, c = true_placement.rotation, true_placement.translation
        P = np.array([point.value for point in self._true.evaluate(t, real)]).reshape(-1, 3)
        P = (P - (c + R @ self._moved)) @ (R @ self._turned)
        ahead = P[:, 2] > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            seen = P[:, :2] / P[:, 2:]
        seen = seen * faults.focal * of.intrinsics[:2] + of.intrinsics[2:]
        seen += faults.noise * self._rng.standard_normal(seen.shape)
        first = not self._taken
        lost = self._rng.random() < faults.dropped and not first
        if faults.whole:
            seen = np.round(seen)
        inside = np.all((seen >= 0.0) & (seen <= faults.size), axis=1) if faults.size is not None else ahead
        seen[~(ahead & inside)] = np.nan
        self._taken += 1
        whole = not lost and bool(np.isfinite(seen).all())
        self._lost += not whole
        self._gap = max(self._gap, t - self._since)
        if whole:
            self._since = t
        if not lost:
            self._waiting.append(
                (t + (0.0 if first else faults.latency), t, seen, placement.rotation, placement.translation)
            )

    def planned(self, t: Array) -> None:
        return None

    def noticed(self, end: float) -> Iterator[Finding]:
        if self._lost:
            values = {"lost": self._lost, "taken": self._taken, "gap": max(self._gap, end - self._since)}
            yield Finding("pictures_lost", values)


#: Times of samples and pictures that differ by less are equal, s.
SOON = 1e-9


class MeasuredPoint(Function):
    """One of `MeasuredPoints`: made by their `point`."""

    def __init__(self, of: MeasuredPoints, k: int) -> None:
        expect(k < len(of), "point", f"a number below {len(of)}", k)
        self.of, self.k, self.true_points = of, k, of.points[k : k + 1]

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self.of.rows(robot)[3 * self.k : 3 * self.k + 3]

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        first = Stage(move_rows, 3 * len(self.of), (), np.array([3.0 * self.k, 0.0, 3.0, 0.0]))
        return (*self.of.stages(robot), *((first,) if self.k else ()))


@kernel(FUNCTION)
def since(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """t - numbers[0]."""
    rows.value[0] = at.t - numbers[0]
    rows.value_t[0] = 1.0


class Age(Function):
    """How old the last whole picture of `MeasuredPoints` is, s: made by their `age`."""

    def __init__(self, of: MeasuredPoints) -> None:
        self.of = of

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row(f"{self.of._placed(robot)}.age", "s"),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(since, 1, (), self.of._at.numbers, live=self.of._at),)
