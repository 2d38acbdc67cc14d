"""What no task feels is steered: which platforms name it, the law, its limits, its rule, paths it needs."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from findings import every, refused
from numpy.typing import NDArray

import nmm
from nmm.control.steering import Steered
from nmm.model.platforms import FixedWheel, SteeredWheel, Tractor, Trailer, WheeledPlatform
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

POSTURE = {"q2": 0.2, "q3": 1.7, "q4": 0.6}
AXLE = [FixedWheel("left", 0.1, 0.3, 0.1), FixedWheel("right", 0.1, -0.3, 0.1)]


@pytest.fixture(scope="module")
def car() -> Robot:
    return nmm.mount("car_base", "small_arm", at="arm_mount")


@pytest.fixture(scope="module")
def trailer() -> Robot:
    """The arm stands on the first trailer, which is hitched on the tractor's axle."""
    train = nmm.load("trailer_base", arguments={"hitch_offset": "0"})
    return nmm.mount(train, "small_arm", at="trailer1_mount")


@pytest.fixture(params=["car", "trailer"])
def robot(request: pytest.FixtureRequest) -> Robot:
    found: Robot = request.getfixturevalue(request.param)
    return found


def circle(robot: Robot) -> nmm.Task:
    return nmm.Task(nmm.Position("ee"), nmm.Circle([0, 0, 0.6], 2.5, 0.16), gain=1.0)


def steered(robot: Robot, **options: object) -> nmm.Controller:
    return nmm.Controller(robot, circle(robot), nmm.ProjectedGradient(), **options)  # type: ignore[arg-type]


def law(controller: nmm.Controller) -> Steered:
    assert controller.steered is not None
    return controller.steered


def test_the_law_says_what_it_is(car: Robot) -> None:
    assert repr(law(steered(car))) == "Steered(steering_rate: pursuit of ee, gain 5 1/s, spring 2 1/s)"


def configurations(robot: Robot, count: int) -> Array:
    lower, upper = np.clip(robot.q_limits.T, -1.5, 1.5)
    return np.random.default_rng(3).uniform(lower, upper, (count, robot.n))


# What platforms say


@pytest.mark.parametrize(
    "platform",
    [
        nmm.Car(0.8),
        nmm.FrontDriveCar(0.8),
        WheeledPlatform([*AXLE, SteeredWheel("front", 0.9, 0, 0.1)]),
        WheeledPlatform([*AXLE, SteeredWheel("front", 0.9, 0, 0.1, heading=math.pi, lower=-0.5, upper=0.6)]),
        WheeledPlatform(
            [*AXLE, *(SteeredWheel(n, 0.9, y, 0.1, joint=n) for n, y in [("l", 0.3), ("r", -0.3)])]
        ),
        WheeledPlatform([SteeredWheel(n, x, 0, 0.1, joint=n) for n, x in [("front", 0.5), ("back", -0.5)]]),
        WheeledPlatform([SteeredWheel(n, x, 0.2, 0.1, joint=n) for n, x in [("front", 0.5), ("back", -0.3)]]),
    ],
    ids=lambda platform: f"{platform.name} {', '.join(platform.coordinates[3:])}",
)
@pytest.mark.parametrize("curvature", [0.3, -0.4])
def test_the_pivots_angles_drive_the_axle_on_the_circle(
    platform: nmm.extending.Platform, curvature: float
) -> None:
    """By the platform's own G: the axle's middle goes along its direction, with the curvature asked for."""
    axle = platform.steered_axle("theta")
    assert axle is not None
    qp = np.zeros(platform.n_p)
    for pivot in axle.pivots:
        angle = math.atan2(curvature * pivot.x, 1.0 - curvature * pivot.y) - pivot.zero
        qp[platform.coordinates.index(pivot.coordinate)] = pivot.sign * angle
    x_dot, y_dot, turn = platform.G(followed(platform, qp))[:3, 0]
    v = complex(x_dot, y_dot) + 1j * turn * complex(axle.x, axle.y)
    assert v.imag == pytest.approx(0.0, abs=1e-12 * abs(v))
    assert turn / v.real == pytest.approx(curvature, rel=1e-12)


def followed(platform: nmm.extending.Platform, qp: Array) -> Array:
    """The right wheel of an Ackermann pair stands where the left one's circle has it."""
    if platform.coordinates[3:] == ("l", "r"):
        left = math.tan(qp[3])
        qp[4] = math.atan(left * 0.8 / (0.8 + 0.6 * left))
    return qp


@pytest.mark.parametrize("curvature", [0.3, -0.4])
def test_a_tractor_is_its_trailers_steered_wheel(curvature: float) -> None:
    platform = Tractor([Trailer(0.7)])
    axle = platform.steered_axle("hitch1")
    assert axle is not None
    (pivot,) = axle.pivots
    b = pivot.sign * math.atan(curvature * pivot.x)
    rates = platform.G([0, 0, -b, b])[:, 0]  # the trailer's heading is 0
    v = complex(rates[0], rates[1]) + 1j * (rates[2] + rates[3]) * axle.x
    assert v.imag == pytest.approx(0.0, abs=1e-12)
    assert (rates[2] + rates[3]) / v.real == pytest.approx(curvature, rel=1e-12)


@pytest.mark.parametrize(
    ("platform", "body"),
    [
        (nmm.Unicycle(), "theta"),
        (nmm.Car(0.8), "steering"),
        (Tractor([Trailer(0.7)]), "theta"),
        (Tractor([Trailer(0.7, hitch=0.2)]), "hitch1"),
        (WheeledPlatform([SteeredWheel("front", 0.5, 0, 0.1)]), "theta"),
        (WheeledPlatform(AXLE), "theta"),
    ],
)
def test_what_is_felt_or_is_not_one_speed_is_not_steered(platform: nmm.extending.Platform, body: str) -> None:
    assert platform.steered_axle(body) is None


def test_the_least_radius_is_the_wheelbases() -> None:
    axle = nmm.Car(0.8).steered_axle("theta")
    assert axle is not None
    assert axle.least_radius(((-0.5, 0.6),)) == pytest.approx(0.8 / math.tan(0.5))


# The pursuit


def test_pursuit_leads_the_axle_to_the_hand(car: Robot) -> None:
    """The circle of radius L / tan δ*, driven from the rear axle, meets the hand."""
    pursuit = law(steered(car)).pursuit
    for q in configurations(car, 20):
        at = nmm.Configuration(car, q)
        delta = nmm.evaluate(pursuit, 0.0, at).value[0]
        hand = at.placement("ee").translation[:2] - q[:2]
        ahead = math.cos(q[2]) * hand[0] + math.sin(q[2]) * hand[1]
        left = math.cos(q[2]) * hand[1] - math.sin(q[2]) * hand[0]
        angle = math.atan2(2 * 0.7 * left, ahead**2 + left**2)
        assert delta == pytest.approx(np.clip(angle, -0.6, 0.6), abs=1e-12)
        radius = 0.7 / math.tan(angle)
        assert math.hypot(ahead, left - radius) == pytest.approx(abs(radius), rel=1e-9)


def test_the_springs_gradient(robot: Robot) -> None:
    """½ β² where its slope is not held back, by central differences; the platform does not feel it."""
    pursuit = law(steered(robot)).pursuit
    numbers = pursuit.stages(robot)[0].numbers

    def seen(q: Array) -> Array:
        body, hand = (nmm.Configuration(robot, q).placement(f) for f in (pursuit.body, "ee"))
        return np.array(body.actInv(hand).translation[:2] - numbers[:2])

    def half(q: Array) -> float:
        return 0.5 * math.atan2(*seen(q)[::-1]) ** 2

    for q in configurations(robot, 5):
        found = nmm.evaluate(pursuit, 0.0, nmm.Configuration(robot, q))
        np.testing.assert_allclose(found.value_q[:, : robot.platform.n_p], 0.0, atol=1e-12)
        expected = [(half(q + h) - half(q - h)) / 2e-6 for h in 1e-6 * np.eye(robot.n)]
        square = float(np.sum(seen(q) ** 2))
        held_back = square / (square + numbers[3] ** 2)
        np.testing.assert_allclose(found.value_q[-1], held_back * np.array(expected), atol=1e-8)


def test_the_steering_goes_to_the_pursuits_angle(robot: Robot) -> None:
    """c_dot = -k (c - c*), whatever else the platform does to c; J u = rate as ever."""
    controller = steered(robot, steering=nmm.Steering(gain=3.0, spring=0.7))
    plain = steered(robot, steering=False)
    (pivot,) = law(controller).pivots
    c, j = robot.coordinate(pivot.coordinate), robot.input(pivot.input)
    others = np.arange(robot.n_u) != j
    moved = 0
    for q in configurations(robot, 10):
        step = controller.evaluate(0.3, q)
        target = nmm.evaluate(law(controller).pursuit, 0.3, nmm.Configuration(robot, q)).value[0]
        assert step.q_dot[c] == pytest.approx(-3.0 * (q[c] - target), abs=1e-9)
        np.testing.assert_allclose(step.J @ step.u, step.rate, atol=1e-9)
        assert plain.evaluate(0.3, q).u[j] == pytest.approx(0.0, abs=1e-12)
        moved += not np.allclose(step.u[others], plain.evaluate(0.3, q).u[others])
    assert moved == 10  # by the spring
    without = steered(robot, steering=nmm.Steering(spring=0.0))
    for q in configurations(robot, 3):
        np.testing.assert_array_equal(without(0.3, q)[others], plain(0.3, q)[others])


@pytest.mark.parametrize("alpha", [2.0, 8.0])
def test_the_spring_is_the_same_whatever_alpha(car: Robot, alpha: float) -> None:
    q = configurations(car, 1)[0]
    resolver = nmm.ProjectedGradient(alpha=alpha)
    u = nmm.Controller(car, circle(car), resolver)(0.0, q)
    np.testing.assert_allclose(u, steered(car)(0.0, q), atol=1e-12)


# The rule


def test_on_by_default_and_off_with_one_key(car: Robot) -> None:
    assert law(steered(car)).inputs == ("steering_rate",)
    assert steered(car, steering=False).steered is None


@pytest.mark.parametrize("square", ["steering", "theta", "x"])
def test_an_objective_that_moves_the_steering_or_not(car: Robot, square: str) -> None:
    """Also where its weight is 0 to begin with, so that pursuit would be at odds with it later."""
    square_alone = nmm.Quadratic(nmm.QuadraticTerm(square))
    for objective in (square_alone, nmm.Line([0.0], [1.0], 5.0) * square_alone):
        controller = steered(car, objective=objective)
        assert (controller.steered is None) is (square == "steering")


def test_a_task_that_feels_the_steering_keeps_it(car: Robot) -> None:
    held = nmm.Task(nmm.LinearCoordinates("steering"), [0.2])
    assert nmm.Controller(car, [circle(car), held], nmm.ProjectedGradient()).steered is None


def test_a_task_that_does_not_move_the_platform_steers_nothing(car: Robot) -> None:
    posture = nmm.Task(nmm.LinearCoordinates("q1", "q2"), [0.2, 0.3])
    assert nmm.Controller(car, posture, nmm.ProjectedGradient()).steered is None


@pytest.mark.parametrize("name", ["car_steered_by_the_null_space", "kinova_car", "unicycle_2r_position"])
def test_scenarios_that_steer_by_their_objective_stay_as_they_are(name: str) -> None:
    scenario = nmm.Scenario.load(name)
    controller = scenario.controller()
    assert controller.steered is None
    q = scenario.robot().q(scenario.parts.q0)
    without = scenario.override("steering", "false").controller()
    np.testing.assert_array_equal(controller(0.1, q), without(0.1, q))


def test_every_resolver_is_steered(car: Robot) -> None:
    """The extended Jacobian too, which then takes a row less in its added task."""
    q = car.q({"theta": 0.5, "q1": 0.6, **POSTURE})
    added = nmm.Task(nmm.LinearCoordinates("q1", "q4", "q5"), [0.3, 0.5, 0.1])
    controllers = [
        steered(car),
        nmm.Controller(car, circle(car), nmm.ReducedGradient()),
        nmm.Controller(car, circle(car), nmm.ProjectedGradient(weights={"steering_rate": 5.0, "arm": 2.0})),
        nmm.Controller(car, circle(car), nmm.CallableResolver(lambda p: np.linalg.pinv(p.J) @ p.rate)),
        nmm.Controller(car, circle(car), nmm.ExtendedJacobian(), added_task=added),
    ]
    j = car.input("steering_rate")
    rates = [controller(0.2, q)[j] for controller in controllers]
    assert abs(rates[0]) > 0.1
    np.testing.assert_allclose(rates, rates[0], atol=1e-12)
    step = controllers[-1].evaluate(0.2, q)
    np.testing.assert_allclose(step.J @ step.u, step.rate, atol=1e-9)
    ends = [car.input(name) for name in ("q1", "q4", "q5")]
    np.testing.assert_allclose(step.u[ends], [0.3 - 0.6, 0.5 - 0.6, 0.1], atol=1e-9)


def test_an_added_task_may_steer_itself(car: Robot) -> None:
    added = nmm.Task(nmm.LinearCoordinates("steering", "q1", "q4", "q5"), [0.1, 0.3, 0.5, 0.1])
    controller = nmm.Controller(car, circle(car), nmm.ExtendedJacobian(), added_task=added)
    assert controller.steered is None
    assert controller(0.2, car.q({"q1": 0.6, **POSTURE}))[car.input("steering_rate")] == pytest.approx(0.1)


# Limits


def test_limits_of_rate_stop_and_wheels_are_kept(car: Robot) -> None:
    limits = nmm.Limits(velocity={"steering_rate": 0.3}, acceleration={"steering_rate": 1.5}, wheels=20.0)
    controller = steered(car, limits=limits)
    q = car.q({"x": 2.5, "theta": 1.0, "q1": 1.0, **POSTURE})
    run = nmm.simulate(controller, q, 6.0, 0.01, "zoh")
    rate = run.u[:, car.input("steering_rate")]
    assert np.abs(rate).max() == pytest.approx(0.3, abs=1e-12)
    assert np.abs(np.diff(rate, prepend=0.0)).max() <= 1.5 * 0.01 + 1e-12
    assert np.abs(run.q[:, 3]).max() <= 0.6 + 1e-12


def test_rows_of_limits_that_hold_the_steering_hold_it(car: Robot) -> None:
    bound = nmm.Bound(nmm.LinearCoordinates("steering"), -0.1, 0.1)
    controller = steered(car, limits=nmm.Limits(False, False, bounds=bound))
    run = nmm.simulate(controller, {"x": 2.0, "y": 0.3, "theta": 1.0, "q1": 0.8, **POSTURE}, 3.0, 0.01, "zoh")
    assert np.abs(run.q[:, 3]).max() == pytest.approx(0.1, abs=1e-9)


# Runs


@pytest.mark.parametrize("heading", [1.6, 3.0])
def test_it_follows_a_circle(robot: Robot, heading: float) -> None:
    """The same start fails without: the arm is stretched as the body drives straight on."""
    posture = {"theta": heading, **POSTURE}
    hand = nmm.Configuration(robot, robot.q(posture)).placement("ee").translation
    start = robot.q({"x": 2.5 - hand[0], "y": 0.1 - hand[1], **posture})
    run = nmm.simulate(steered(robot), start, 15.0, 0.05)
    assert run.outcome is nmm.Outcome.COMPLETED
    assert run.error_norm[-1] < 1e-6 + run.error_norm[0] * math.exp(-15.0)
    idle = [name for one in every(run, "idle_inputs") for name in one.values["inputs"]]
    assert not {"omega", "steering_rate"} & {*idle}
    (pivot,) = law(steered(robot)).pivots
    c = robot.coordinate(pivot.coordinate)
    assert np.abs(run.q[:, c]).max() <= robot.q_limits[c, 1] + 1e-9
    left_alone = nmm.simulate(steered(robot, steering=False), start, 15.0, 0.05)
    assert left_alone.outcome is not nmm.Outcome.COMPLETED


def test_copies_steer_too(car: Robot) -> None:
    controller = steered(car, steering=nmm.Steering(gain=2.0))
    q = car.q({"q1": 0.5, **POSTURE})
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(controller))(0.1, q), controller(0.1, q))


# What people see


def test_the_law_is_told() -> None:
    setting = nmm.Scenario.load("kinova_car").override("objective", []).controller()
    told = law(setting).described()
    assert told[0].startswith(
        "steering_rate: no task feels it; pursuit of j2s6s200_end_effector steers, gain 5"
    )
    assert told[1] == "least turning radius 1.02 m, 0.93 times the arm's reach"


def test_geometry_that_forbids_is_said(car: Robot) -> None:
    assert "cannot turn under its own arm" in law(steered(car)).described()[1]


@pytest.mark.parametrize(("gain", "spring"), [(0.0, 1.0), (-1.0, 1.0), (1.0, -0.1), (math.nan, 1.0)])
def test_gains_are_checked(gain: float, spring: float) -> None:
    with pytest.raises(nmm.InputError):
        nmm.Steering(gain, spring)


def test_scenarios_say_it() -> None:
    scenario = nmm.Scenario.load("kinova_car").override("objective", [])
    chosen = scenario.override("steering", {"gain": 3, "spring": 0}).controller()
    assert (law(chosen).steering.gain, law(chosen).steering.spring) == (3.0, 0.0)
    assert scenario.override("steering", False).controller().steered is None
    with refused("kinova_car.yaml: set steering.gain", got=0, kind=nmm.ScenarioError):
        scenario.override("steering", {"gain": 0}).controller()


@pytest.mark.parametrize("ahead", [None, 0.0])
def test_where_the_scene_is_in_the_world_decides_nothing(ahead: float | None) -> None:
    """Robot, target and obstacle moved by one rigid motion: the same inputs near the origin and far off."""
    robot = nmm.mount("car_base", "small_arm", at="arm_mount")
    start = robot.q({"q2": 0.2, "q3": 1.7, "q4": 0.6, "steering": 0.2})
    found = []
    for x, y, turn in ((0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (-40.0, 300.0, 2.0), (1.0, -3.0, -1.0)):
        c, s = np.cos(turn), np.sin(turn)

        def placed(p: list[float], x: float = x, y: float = y, c: float = c, s: float = s) -> list[float]:
            return [c * p[0] - s * p[1] + x, s * p[0] + c * p[1] + y, *p[2:]]

        place = np.eye(4)
        place[:2, :2], place[:3, 3] = [[c, -s], [s, c]], placed([2.2, 0.3, 0.5])
        box = nmm.Obstacle(nmm.Box([0.6, 0.4, 1.0]), place, name="box")
        kept = nmm.Collisions(0.03, self_collisions=False, obstacles=[box])
        q = start.copy()
        q[:2], q[2] = placed([0.6, 0.0]), start[2] + turn
        controller = nmm.Controller(
            robot,
            nmm.Task(nmm.Position("ee"), placed([4.0, 0.2, 0.8])),
            nmm.ProjectedGradient(),
            nmm.Clearance(kept, ahead=ahead),
            limits=nmm.Limits(acceleration=2.0),
            collisions=kept,
            dt=0.02,
        )
        run = nmm.simulate(controller, q, 1.0, 0.02, "zoh")
        found.append((controller.steered is None, run.u))
    assert len({steers for steers, _ in found}) == 1
    for _, u in found[1:]:
        np.testing.assert_allclose(u, found[0][1], atol=1e-9)
