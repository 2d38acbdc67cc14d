"""What playback shows: a robot's motion in plain arrays, checked once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, Integers, array, matrix, unwritable, vector
from nmm.base.errors import expect
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import NO_SURROUNDINGS, Body, Surroundings


@dataclass(frozen=True, eq=False)
class Nearest:
    """The two points nearest to each other at each of a motion's N samples.

    Attributes
    ----------
    points (N, 6) : of the one shape, then of the other, m, world axes; not a number where nothing is near
    distance (N,) : m
    pairs (N,) : which of `names` they belong to, -1 for none
    names : "one and other" of each pair
    asked : the distance to keep, m

    Examples
    --------
    >>> points = np.array([[1.0, 0.0, 0.5, 1.0, 0.3, 0.5]])
    >>> near = nmm.playback.Nearest(points, np.array([0.3]), np.array([0]), ("link2 and ball",), asked=0.1)
    >>> near.names[near.pairs[0]], float(np.linalg.norm(points[0, :3] - points[0, 3:]))
    ('link2 and ball', 0.3)
    """

    points: Array
    distance: Array
    pairs: Integers
    names: tuple[str, ...]
    asked: float


#: Intrinsics [fx, fy, cx, cy] of normalised coordinates.
NORMALISED = (1.0, 1.0, 0.0, 0.0)
#: x and y of a picture's upper left corner and of the lower right one, where nothing is known, normalised.
PICTURE = (-0.6, -0.45, 0.6, 0.45)


@dataclass(frozen=True, eq=False)
class Camera:
    """What a camera of a robot sees of k points at each of a motion's N samples.

    Attributes
    ----------
    frame : the camera's, z ahead, x right, y down
    points (N, k, 3) : where they are, m, world axes
    goals (N, k, 2) : where they are to be in the picture, normalised; not a number where nowhere
    border : x and y of the picture's upper left corner, then of the lower right one, normalised
    bounded : whether limits keep points within the border
    intrinsics : fx, fy, cx, cy, px, in which the picture is read; 1, 1, 0, 0 for normalised coordinates
    lines : pairs of points whose line is seen

    Examples
    --------
    >>> robot = nmm.load("unicycle_pan_tilt")
    >>> ball = np.array([[[2.0, 0.5, 0.6]]])
    >>> camera = nmm.playback.Camera("camera_optical_frame", ball, np.zeros((1, 1, 2)))
    >>> camera.picture(robot, robot.rest[None]).round(3)
    array([[[-0.286,  0.057]]])
    """

    frame: str
    points: Array
    goals: Array
    border: tuple[float, float, float, float] = PICTURE
    bounded: bool = False
    intrinsics: tuple[float, float, float, float] = NORMALISED
    lines: tuple[tuple[int, int], ...] = ()

    def picture(self, robot: Robot, q: Array) -> Array:
        """Where it sees the points (N, k, 2), normalised, from q (N, n); not a number behind it."""
        data, frame = robot.model.createData(), robot.frame_id(self.frame)
        image = np.full((len(q), self.points.shape[1], 2), np.nan)
        for k, (q_k, points) in enumerate(zip(q, self.points, strict=True)):
            pin.framesForwardKinematics(robot.model, data, q_k)
            placement = data.oMf[frame]
            seen = (points - placement.translation) @ placement.rotation
            ahead = seen[:, 2] > 0.0
            image[k, ahead] = seen[ahead, :2] / seen[ahead, 2:]
        return image


@dataclass(frozen=True, eq=False)
class Motion:
    """N samples of a robot that moves, and what belongs into the picture with it.

    Attributes
    ----------
    robot : the robot
    t (N,) : times in s, ascending
    q (N, n), u (N, n_u) : coordinates and inputs, in `robot.q_units` and `robot.u_units`
    path (N, 3) : the end-effector's path, m in the world; computed from `frame` when not given
    desired (M, 3) : the desired path, m in the world
    planned (N, n) : where its plan was, if it followed one
    believed (N, n) : where it is believed to be, by its odometry or a filter
    target (3,), or (T, 3) : a fixed point to look at or to reach, or several, m in the world
    label : name in the legend, such as "RG"
    frame : the end-effector's frame
    bodies : what stands or moves beside the robot
    nearest : which points are nearest to each other, and how near
    cameras : what its cameras see
    surroundings : what it carries, what else stands there, and how a page opens

    Raises
    ------
    InputError : wrong shapes, no samples, times that do not ascend, numbers that are not finite,
        an unknown frame

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> t = np.linspace(0, 2, 41)
    >>> u = np.tile([0.5, 0.0, 0.0, 0.4], (41, 1))
    >>> q = np.column_stack([0.5 * t, 0 * t, 0 * t, 0 * t, 0.4 * t])
    >>> motion = nmm.playback.Motion(robot, t, q, u, label="by hand")
    >>> nmm.playback.write_html([motion], "by_hand.html").name
    'by_hand.html'
    """

    robot: Robot
    t: Array
    q: Array
    u: Array
    path: Array | None = None
    desired: Array | None = None
    planned: Array | None = None
    believed: Array | None = None
    target: Array | None = None
    label: str = ""
    frame: str | None = None
    bodies: tuple[Body, ...] = ()
    nearest: Nearest | None = None
    cameras: tuple[Camera, ...] = ()
    surroundings: Surroundings = NO_SURROUNDINGS

    def __post_init__(self) -> None:
        t = vector(self.t, None, "t")
        expect(t.size, "t", "at least one sample")
        expect(np.all(np.diff(t) > 0.0), "t", "ascending times")
        checked: dict[str, Array | None] = {
            "t": t,
            "q": matrix(self.q, (t.size, self.robot.n), "q"),
            "u": matrix(self.u, (t.size, self.robot.n_u), "u"),
            "path": None if self.path is None else matrix(self.path, (t.size, 3), "path"),
            "desired": None if self.desired is None else _points(self.desired, "desired"),
            "planned": None if self.planned is None else matrix(self.planned, self.q.shape, "planned"),
            "believed": None if self.believed is None else matrix(self.believed, self.q.shape, "believed"),
            "target": None if self.target is None else _target(self.target),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, None if value is None else unwritable(value))
        if self.frame is not None:
            self.robot.frame_id(self.frame)
        for body in self.bodies:
            expected = f"placements of shape ({t.size}, 4, 4) or (1, 4, 4)"
            shape = body.places.shape
            expect(shape in ((t.size, 4, 4), (1, 4, 4)), f"bodies: {body.name}", expected, shape)
        for carried in self.surroundings.carried:
            with_place = f"surroundings: {carried.name}: place"
            self.robot.frame_id(carried.frame)
            expect(carried.place.shape == (4, 4), with_place, "a matrix of shape (4, 4)", carried.place.shape)
        for thing in self.surroundings.scenery:
            shape = thing.places.shape
            expect(shape == (1, 4, 4), f"surroundings: {thing.name}", "a placement of shape (1, 4, 4)", shape)
        if self.nearest is not None:
            matrix(np.nan_to_num(self.nearest.points), (t.size, 6), "nearest: points")
        for camera in self.cameras:
            self.robot.frame_id(camera.frame)
            shapes, count = (camera.points.shape, camera.goals.shape), camera.points.shape[1:2]
            expected = f"points and goals of shapes ({t.size}, k, 3) and ({t.size}, k, 2)"
            fits = shapes == ((t.size, *count, 3), (t.size, *count, 2))
            expect(fits, f"cameras: {camera.frame}", expected, shapes)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.t[-1] - self.t[0])

    @cached_property
    def driven(self) -> Array | None:
        """Path that the end-effector drove, (N, 3) m; None when neither `path` nor `frame` is given."""
        if self.path is not None or self.frame is None:
            return self.path
        model = self.robot.model
        data, frame = model.createData(), self.robot.frame_id(self.frame)
        path = np.empty((len(self.t), 3))
        for k, q in enumerate(self.q):
            pin.framesForwardKinematics(model, data, q)
            path[k] = data.oMf[frame].translation
        return path


def _points(value: Array, name: str) -> Array:
    points = array(value, name)
    expect(points.ndim == 2 and points.shape[1] == 3, name, "points of shape (M, 3)", points)
    return points


def _target(value: Array) -> Array:
    return vector(value, 3, "target") if np.ndim(value) < 2 else _points(value, "target")
