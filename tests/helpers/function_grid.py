"""Every kind of function of nmm over the grid of its options, for the tests that go through all of them.

A new function is tested by a new entry in `ENTRIES`; `test_derivatives.py` notices when one is missing.
"""

from __future__ import annotations

import importlib
import inspect
import itertools
import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy import pi
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from nmm.control.functions.function import Evaluation, Function
from nmm.control.functions.objectives import (
    Alignment,
    CallableObjective,
    DirectionalManipulability,
    InverseCondition,
    JointRange,
    LimitBarrier,
    Manipulability,
    Objective,
    PotentialEnergy,
    PreferredPosture,
    Quadratic,
    QuadraticTerm,
    WeightedManipulability,
    WeightedSum,
)
from nmm.control.functions.objectives.base import WeightedFunction
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import (
    Bearing,
    CallableReference,
    Circle,
    Constant,
    Line,
    LiveTarget,
    PiecewisePolynomial,
    Polynomial,
    PoseReference,
    Slerp,
    Spline,
    SteadyTurn,
    VelocityOf,
)
from nmm.control.functions.references.live_target import Displaced
from nmm.control.functions.tasks import (
    CallableFunction,
    CenterOfMass,
    Distance,
    Heading,
    ImageLine,
    ImageMoments,
    ImagePoints,
    LinearCoordinates,
    LogDepth,
    MeasuredPoints,
    Orientation,
    Pointing,
    Pose,
    Position,
    Posture,
)
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

BOTH = ("unicycle_2r", "unicycle_3r")
SPATIAL = ("unicycle_3r",)
#: For what depends on the inputs and the limits, a robot with a joint that follows another, too.
FOLDING = ("unicycle_3r_folding",)


@dataclass(frozen=True)
class Entry:
    name: str
    function: Function
    robots: tuple[str, ...] = BOTH


#: Instants before, in, between the breaks of, and after the references below; none within 0.01 s of a break.
TIMES = (-0.4, 0.37, 1.61, 2.9, 7.3)
_BREAKS = np.array([0.0, 0.8, 2.0, 3.1, 4.4, 6.0])
_POINTS = np.array([[0.3, 5.0], [1.0, 4.0], [0.2, 3.0], [-1.0, 3.5], [-0.5, 4.5], [0.3, 5.0]])
_TARGET = (6.0, 2.0)


def _hand(configuration: Configuration) -> Array:
    """A function of the configuration that nmm does not have: a point and an angle made of several things."""
    p = configuration.placement("ee").translation
    q = configuration.q
    return np.array([p[0] * p[1], np.sin(q[3]) * p[0] + q[2] ** 2])


def _hand_jacobian(configuration: Configuration) -> Array:
    p, q = configuration.placement("ee").translation, configuration.q
    x, y = configuration.jacobian("ee")[:2]
    jacobian = np.vstack([p[0] * y + p[1] * x, np.sin(q[3]) * x])
    jacobian[1, 3] += np.cos(q[3]) * p[0]
    jacobian[1, 2] += 2 * q[2]
    return jacobian


def _moving(t: float, configuration: Configuration) -> Array:
    return np.array([np.sin(2 * t), t**2]) * _hand(configuration)


def _moving_rate(t: float, configuration: Configuration) -> Array:
    return np.array([2 * np.cos(2 * t), 2 * t]) * _hand(configuration)


def _moving_jacobian(t: float, configuration: Configuration) -> Array:
    return np.array([[np.sin(2 * t)], [t**2]]) * _hand_jacobian(configuration)


def _height(configuration: Configuration) -> float:
    return float(np.cos(_hand(configuration)[0]) + configuration.q[4] ** 3)


def _height_gradient(configuration: Configuration) -> Array:
    gradient: Array = -np.sin(_hand(configuration)[0]) * _hand_jacobian(configuration)[0]
    gradient[4] += 3 * configuration.q[4] ** 2
    return gradient


def _tasks() -> Iterator[Entry]:
    for axes in ("x", "y", "z", "xy", "yx", "xz", "zyx", "xyz"):
        yield Entry(f"position {axes}", Position("ee", axes))
    for frame in ("link1", "link2"):
        yield Entry(f"position of {frame}", Position(frame, ("x", "y")))
    for direction, about in itertools.product(("x", "y", "z", (0.6, -0.3, 0.7)), "xyz"):
        vertical = direction == "z" and about == "z"  # undefined for links that stay horizontal
        robots = SPATIAL if vertical else BOTH
        yield Entry(f"heading of {direction} about {about}", Heading("ee", direction, about), robots)
    yield Entry("heading of link1", Heading("link1"))
    yield Entry("coordinate", LinearCoordinates("q2"))
    yield Entry("combinations", LinearCoordinates("y", {"theta": 1, "q1": 1, "q2": -2.5}, {"x": 3.0}))
    yield Entry("posture", Posture(), (*BOTH, *FOLDING))
    yield Entry("posture of two", Posture("q2", "x"))
    yield Entry("callable function", CallableFunction(_hand, ["a", "b"]))
    yield Entry("callable function, jacobian", CallableFunction(_hand, ["a", "b"], jacobian=_hand_jacobian))
    yield Entry("callable angle", CallableFunction(lambda c: c.q[2] + c.q[3], ["a"], angular=[True]))


def _spatial_tasks() -> Iterator[Entry]:
    """What the other entries leave out: frames that another frame sees, orientations, points in space."""
    for frame, other in (("ee", "link1"), ("link1", "ee")):
        yield Entry(f"position of {frame} in {other}", Position(frame, "zxy", other))
        yield Entry(f"orientation of {frame} in {other}", Orientation(frame, other))
        yield Entry(f"pose of {frame} in {other}", Pose(frame, other))
    yield Entry("orientation", Orientation("ee"))
    yield Entry("pose", Pose("ee"))
    moving = Circle([2, -1, 0.5], 0.7, -1.3, 0.4, "yz")
    callback = CallableReference(lambda t, c: [*_moving(t, c), 2.0 + t], 3, of_configuration=True)
    for axis in ("x", "y", "z", (0.6, -0.3, 0.7), (-1, 0, 0)):
        yield Entry(f"pointing of {axis} at a point", Pointing("ee", [6, 2, 1], axis))
    yield Entry("pointing at a moving point", Pointing("ee", moving))
    yield Entry("pointing at a frame", Pointing("link1", "ee", "x"))
    yield Entry("pointing at the centre of mass", Pointing("ee", CenterOfMass(), (0.1, 1, 1)))
    yield Entry("pointing at a callable", Pointing("ee", callback))
    yield Entry("distance from a point", Distance("ee", [1, 2, 3]))
    yield Entry("distance from a moving point", Distance("ee", moving))
    yield Entry("distance between frames", Distance("base_footprint", "ee"))
    for axes in ("xyz", "zx"):
        yield Entry(f"centre of mass {axes}", CenterOfMass(axes))
        yield Entry(f"centre of mass {axes} in a frame", CenterOfMass(axes, "link1"))


def _seen() -> Iterator[Entry]:
    """The z axes of these frames are upright, or the point is ahead of the frame wherever that is."""
    above = Circle([2, -1, 60], 3.0, -1.3, 0.4)
    ahead = CallableReference(
        lambda t, c: c.placement("ee").act(np.array([0.3 * np.sin(t), -0.2, 2.0 + 0.1 * t])),
        3,
        of_configuration=True,
    )
    pixels = [500, 520, 320, 240]
    yield Entry("image point", ImagePoints([[6, 2, 50]], "link1"))
    yield Entry(
        "image points, px", ImagePoints([[6, 2, 50], above, "ee"], "base_footprint", pixels), BOTH[:1]
    )
    yield Entry("image of what goes along", ImagePoints([ahead, ahead], "ee"), SPATIAL)
    yield Entry("image line", ImageLine([above, [6, 2, 40]], "link1"))
    yield Entry("image line, px", ImageLine([[-6, 2, 50], [6, 2, 40]], "base_footprint", pixels))
    yield Entry("image moments", ImageMoments([above, [6, 2, 40], [3, 3, 50]], "link1"))
    yield Entry("age of a picture", MeasuredPoints([above], "link1").age())
    yield Entry("depth", LogDepth(above, "link1"))
    yield Entry("depth of what goes along", LogDepth(ahead, "ee"), SPATIAL)


def _references() -> Iterator[Entry]:
    yield Entry("circle", Circle([2, 2], 3, 0.08 * pi, 5 / 4 * pi))
    for plane in ("xy", "yz", "zx"):
        yield Entry(f"circle in {plane}", Circle([2, -1, 0.5], 0.7, -1.3, 0.4, plane))
    yield Entry("circle with a run-up", Circle([2, 2], 3, 0.5, run_up=2.4))
    yield Entry("constant", Constant([1.0, -2.0]))
    yield Entry("constant number", Constant(0.7, "rad"))
    for profile in ("constant", "smooth"):
        yield Entry(f"line, {profile}", Line([0, 1, 2], [3, -1, 2.5], 3.5, profile))
    yield Entry("polynomial", Polynomial([[1, 2], [0.5, -1], [0.1, 0.3], [-0.2, 0.01]], 5.0))
    yield Entry("polynomial through points", Polynomial.through(_BREAKS[:4], _POINTS[:4]))
    pieces = PPoly(np.sin(np.arange(24.0)).reshape(4, 3, 2), [0.1, 1.0, 2.0, 5.0])
    yield Entry("piecewise polynomial", PiecewisePolynomial(pieces.x, pieces.c))
    for degree, ends in ((3, "rest"), (3, "natural"), (3, "periodic"), (5, "rest"), (5, "natural")):
        yield Entry(f"spline of degree {degree}, {ends}", Spline(_BREAKS, _POINTS, degree, ends))
    yield Entry("bearing of a circle", Bearing(Circle([2, 2], 3, 0.08 * pi, 5 / 4 * pi), _TARGET))
    yield Entry("bearing of a circle in space", Bearing(Circle([2, 2, 1], 3, 0.5, plane="zx"), (6, 2, 9)))
    yield Entry("bearing of a spline", Bearing(Spline(_BREAKS, _POINTS), _TARGET))
    yield Entry("bearing of a link", Bearing(Position("link2", "xy"), _TARGET))
    yield Entry("bearing of the end-effector", Bearing(Position("ee", "xyz"), _TARGET))
    yield Entry(
        "bearing of a callable", Bearing(CallableReference(_moving, 2, of_configuration=True), _TARGET)
    )
    yield Entry("velocity of a circle", VelocityOf(Circle([2, -1, 0.5], 0.7, -1.3, 0.4, "yz")))
    for name, way in (("constant", Constant([1, 2])), ("line", Line([0, 1], [3, -1], 3.5))):
        yield Entry(f"velocity of a {name}", VelocityOf(way))
    yield Entry("velocity of a spline", VelocityOf(Spline(_BREAKS, _POINTS, 5)))
    yield Entry("velocity of a round spline", VelocityOf(Spline(_BREAKS, _POINTS, ends="periodic")))
    yield Entry("callable of time", CallableReference(lambda t: [np.sin(3 * t), t**3], 2))
    yield Entry(
        "callable of time, rate",
        CallableReference(lambda t: np.sin(3 * t), 1, rate=lambda t: 3 * np.cos(3 * t), unit="rad"),
    )
    yield Entry("callable of both", CallableReference(_moving, 2, of_configuration=True))
    yield Entry(
        "callable of both, derivatives",
        CallableReference(_moving, 2, rate=_moving_rate, jacobian=_moving_jacobian, of_configuration=True),
    )


def _signals() -> Iterator[Entry]:
    moved = LiveTarget([0.0, 0.0, 9.0])
    moved.set([1.2, -0.7, 0.4], rate=[0.3, -0.2, 0.9], t=0.8)
    turned = LiveTarget([0.1, -0.4, 0.3], "rad")
    yield Entry("signal", LiveTarget([1.0, -2.0]))
    yield Entry("signal that moves on", moved)
    yield Entry("displaced", Displaced(LinearCoordinates("x", "y", "theta"), moved))
    yield Entry("bearing of a signal", Bearing(moved, _TARGET))
    yield Entry("pointing at a signal", Pointing("ee", moved))
    yield Entry("distance from a signal", Distance("ee", moved))
    yield Entry("pose of signals", PoseReference(moved, turned))


def _pose_references() -> Iterator[Entry]:
    yield Entry("turn", SteadyTurn([0.2, -0.3, 0.9], 0.4, [0.3, 0.1, -0.5]))
    for profile in ("constant", "smooth"):
        yield Entry(f"slerp, {profile}", Slerp([0.1, -0.4, 0.3], [-1.2, 0.8, 1.1], 3.5, profile))
    circle = Circle([2, -1, 0.5], 0.7, -1.3, 0.4)
    yield Entry("pose at rest", PoseReference([1, 2, 3], [0.1, -0.2, 0.3]))
    yield Entry("pose that moves", PoseReference(circle, SteadyTurn([0, 1, 1], 0.3)))
    yield Entry("pose of a frame", PoseReference(Position("link1"), Orientation("link1")))
    held = PoseReference([1, 2, 3], CallableReference(lambda t: [np.sin(t), 0.2, t / 9], 3, unit="rad"))
    yield Entry("pose of a callable", held)


def _objectives() -> Iterator[Entry]:
    h1 = Quadratic(QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}, pi / 2), QuadraticTerm("q1", pi / 4))
    yield Entry("quadratic", h1)
    yield Entry(
        "quadratic, weights",
        Quadratic(QuadraticTerm({"x": 1, "q2": -3}, 0.2, 4.0), QuadraticTerm("theta", -1, 0.1)),
    )
    yield Entry("joint range", JointRange(["q1", "q2"], [-1, -2], [2, 3]))
    for of, rows, robots in (
        ("robot", "x", BOTH),
        ("robot", "xy", BOTH),
        ("robot", ("y", "rz"), BOTH),
        ("robot", ("x", "y", "rz"), BOTH),
        ("robot", "xyz", SPATIAL),
        ("robot", ("x", "y", "z", "rx"), SPATIAL),
        ("robot", ("x", "y", "z", "rx", "rz"), SPATIAL),
        ("arm", "y", BOTH),
        ("arm", "xy", BOTH),
        ("arm", ("rz",), BOTH),
        ("arm", "xyz", SPATIAL),
        ("arm", ("rx", "ry", "rz"), SPATIAL),
    ):
        # Two joints of its arm are moved by inputs, and the platform's two.
        folding = FOLDING if len(rows) <= (2 if of == "arm" else 4) else ()
        function = Manipulability("ee", rows, of)
        yield Entry(f"manipulability of the {of}, {' '.join(rows)}", function, (*robots, *folding))
    yield Entry("manipulability of a link", Manipulability("link2", "xy"), (*BOTH, *FOLDING))
    yield from _of_the_jacobian()
    yield from _of_coordinates()
    yield Entry("callable objective", CallableObjective(_height))
    yield Entry("callable objective, gradient", CallableObjective(_height, _height_gradient))
    yield Entry(
        "sum",
        WeightedSum((2.0, h1), (-0.5, Manipulability("ee", "xy")), (1.0, LinearCoordinates("x"))),
        (*BOTH, *FOLDING),
    )
    yield Entry("sum of sums", WeightedSum((3.0, h1 + CallableObjective(_height)), (-2.0, h1 - 0.5 * h1)))
    yield Entry("negative", -Manipulability("ee", "xy", "arm"))
    yield Entry("difference", 2.0 * h1 - Manipulability("ee", "xy") * 0.3)


def _of_the_jacobian() -> Iterator[Entry]:
    everywhere, heavy = (*BOTH, *FOLDING), {"platform": 4.0, "q1": 0.5}
    turning = VelocityOf(Circle([0, 0], 2.0, 0.3, 0.4))
    yield Entry("manipulability of the platform", Manipulability("ee", ("x", "rz"), "platform"), everywhere)
    yield Entry("manipulability, weights", Manipulability("ee", "xy", weights=heavy), everywhere)
    yield Entry("manipulability, weighed", WeightedManipulability("ee", "xy", 0.3, heavy), everywhere)
    for of, rows, robots in (
        ("robot", "xy", everywhere),
        ("robot", ("x", "y", "rz"), everywhere),
        ("arm", "xy", everywhere),
        ("robot", ("x", "y", "z", "rx"), SPATIAL),
    ):
        condition = InverseCondition("ee", rows, of, heavy, 0.3 if of == "arm" else None)
        yield Entry(f"inverse condition of the {of}, {' '.join(rows)}", condition, robots)
    for of, direction, rows, robots in (
        ("robot", [1.0, -2.0], "xy", everywhere),
        ("arm", [0.3, 0.4], "xy", everywhere),
        ("robot", [2.0], "y", everywhere),
        ("robot", [1, 2, -3], "xyz", SPATIAL),
        ("robot", turning, "xy", everywhere),
        ("robot", Position("link1", "xy"), "xy", everywhere),
    ):
        directional = DirectionalManipulability("ee", direction, rows, of, heavy)
        name = type(direction).__name__ if isinstance(direction, Function) else direction
        yield Entry(f"directional manipulability of the {of} along {name}", directional, robots)


def _of_coordinates() -> Iterator[Entry]:
    everywhere = (*BOTH, *FOLDING)
    line, spline = Line([0.2], [1.4], 3.5, "smooth"), Spline(_BREAKS, _POINTS[:, 0])
    circle = Circle([2, 2], 3, 0.8, 5 / 4 * pi)
    bent = Quadratic(
        QuadraticTerm("q1", line, 2.0), QuadraticTerm({"theta": 1, "q2": -1}, 0.3), QuadraticTerm("x", spline)
    )
    yield Entry("quadratic, moving targets", bent, everywhere)
    yield Entry(
        "quadratic, targets of the robot",
        Quadratic(QuadraticTerm("q1", Heading("link2")), QuadraticTerm("q2", 1)),
    )
    prefers = PreferredPosture({"q1": 0.4, "theta": line, "x": Constant(2.0)}, {"q1": 3.0})
    yield Entry("preferred posture", prefers, everywhere)
    yield Entry("barrier", LimitBarrier(["q1", "x"], [-7, -6], [8, 7], margin=0.2), everywhere)
    yield Entry("potential energy", PotentialEnergy(), everywhere)
    yield Entry("potential energy, tilted", PotentialEnergy([1.0, 2.0, -9.0]), everywhere)
    for name, one in (
        ("an angle", Alignment(0.4)),
        ("an angle that moves", Alignment(line, offset=0.3)),
        ("a direction", Alignment([-1.0, 2.0], of={"theta": 1, "q1": -2})),
        ("a motion", Alignment(VelocityOf(circle), offset=pi)),
        ("a direction of the robot", Alignment(Position("ee", "xyz"))),
        ("a bearing", Alignment(Bearing(circle, _TARGET))),
        ("a point", Alignment(at=[6.0, 2.0])),
        ("a point that moves", Alignment(at=circle)),
        ("a frame", Alignment(at="ee")),
    ):
        yield Entry(f"alignment with {name}", one, everywhere)
    w = Manipulability("ee", "xy")
    yield Entry("product", WeightedFunction(w, line), everywhere)
    yield Entry(
        "product with a pose's function", WeightedFunction(PreferredPosture({"q1": line}), Heading("link1"))
    )
    yield Entry("weights that change", line * w + spline * (bent - 2.0 * w), everywhere)


ENTRIES = (
    *_tasks(),
    *_spatial_tasks(),
    *_seen(),
    *_references(),
    *_signals(),
    *_pose_references(),
    *_objectives(),
)


def evaluated(function: Function, t: float, configuration: Configuration) -> Evaluation:
    """Value and derivatives, of an objective too (a sum is evaluated by its terms)."""
    if isinstance(function, Objective):
        value, rate = function.value(configuration, t), function.rate(configuration, t)
        return Evaluation(np.array([value]), np.array([rate]), function.gradient(configuration, t)[None])
    return evaluate(function, t, configuration)


def random_configuration(robot: Robot, rng: np.random.Generator) -> Array:
    """Within 5 m of the origin, theta in several turns, arm joints in one turn to either side."""
    q = rng.uniform(-2 * pi, 2 * pi, robot.n)
    q[:2] = rng.uniform(-5, 5, 2)
    q[2] = rng.uniform(-25, 25)
    return q


KINDS = ("tasks", "references", "objectives")


def modules() -> list[ModuleType]:
    """All modules of the mathematics."""
    loose = ("control.step.equations", "control.functions.program", "control.functions.function")
    loose += ("control.controller", "control.integrators")
    names = [f"nmm.{name}" for name in loose]
    functions = (f"control.functions.{kind}" for kind in KINDS)
    for package in ("model.platforms", *functions, "control.resolvers"):
        found = importlib.import_module(f"nmm.{package}")
        names += [info.name for info in pkgutil.walk_packages(found.__path__, f"nmm.{package}.")]
    return [importlib.import_module(name) for name in names]


def concrete_subclasses(base: type) -> set[type]:
    """All classes of nmm below `base` that can be made."""
    modules()
    found: set[type] = set()
    waiting = [base]
    while waiting:
        for kind in waiting.pop().__subclasses__():
            waiting.append(kind)
            if kind.__module__.startswith("nmm.") and not inspect.isabstract(kind):
                found.add(kind)
    return found
