"""Base and hand that are jogged: which way, how fast, and how it stops; without a browser."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest
from live_loop import Loop, scenario
from platform_grid import EXAMPLES
from ports import wait_for
from wheeled_examples import EXAMPLES as WHEELED

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError, RunError
from nmm.model.platforms import Platform
from nmm.model.robots.configuration import Configuration
from nmm.plugins.live.driving.base_axes import base_directions, base_inputs, body_map, full_speeds
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.jogging import SOONEST, VALID, Jogging
from nmm.plugins.live.driving.messages import Jog, parsed
from nmm.plugins.live.driving.session import DriveSession
from nmm.plugins.live.driving.setups import DriveSetup, RobotSetup

Axes = tuple[float, float, float, float, float, float]
AHEAD: Axes = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NONE: Axes = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def along(axis: str, share: float = 1.0) -> Axes:
    shares = [0.0] * 6
    shares[("x", "y", "z", "rx", "ry", "rz").index(axis)] = share
    return tuple(shares)  # type: ignore[return-value]


class Held:
    """A driven robot and somebody who holds on, by a clock that goes on with the robot's own steps."""

    def __init__(self, setup: DriveSetup, **speeds: float) -> None:
        self.now, self.page = 50.0, object()
        self.driven = Driven(setup)
        self.jogging = Jogging(self.driven, speeds, lambda: self.now)
        self.jogging._making.result()

    def say(self, jog: Jog) -> None:
        self.now += 2.0 * SOONEST
        self.jogging.hear(jog, self.page)

    def go_on(self, seconds: float, jog: Jog | None = None) -> list[Array]:
        """The inputs of the steps of so many seconds, in which somebody holds on, or lets go at once."""
        inputs = []
        self.say(jog or Jog("hand" if self.driven.targets[0].frame else "base", NONE))
        for k in range(round(seconds / self.driven.setup.dt)):
            if jog is not None:
                self.say(jog)
            if k % 4 == 0:  # a picture
                self.jogging.attend(self.jogging.wanted)
            self.jogging.prepare()
            assert self.driven.step(), self.driven.trouble
            inputs.append(self.driven.u.copy())
        self.jogging.attend(self.jogging.wanted)
        return inputs

    def hand(self, frame: str = "ee") -> pin.SE3:
        return Configuration(self.driven.robot, self.driven.q).placement(frame)


def unicycle() -> RobotSetup:
    robot = nmm.load("unicycle_3r")
    return RobotSetup(robot, [nmm.Position("ee")], robot.q({"theta": 0.7, "q1": 0.3, "q2": 0.8, "q3": 0.5}))


# the base


def bends(platform: Platform, qp: Array, up: Array) -> float:
    """By how much inputs that steer turn the way on which it drives ahead, rad."""
    ahead = base_directions(platform, qp, np.ones(platform.p))[:, 0]
    ways = [body_map(platform, qp + dt * platform.G(qp) @ up) @ ahead for dt in (0.0, 1e-3)]
    return float(np.arctan2(ways[1][2], ways[1][0]) - np.arctan2(ways[0][2], ways[0][0]))


@pytest.mark.parametrize("name", [name for name, one in EXAMPLES.items() if one.p])
def test_a_base_goes_ahead_aside_and_round_as_its_wheels_let_it(name: str) -> None:
    platform = EXAMPLES[name]
    speeds = np.linspace(0.5, 1.5, platform.p)
    qp = np.full(platform.n_p, 0.05)
    directions = base_directions(platform, qp, speeds)
    moved = body_map(platform, qp) @ directions
    assert np.all(np.abs(directions) <= speeds[:, np.newaxis] * (1.0 + 1e-12))
    assert moved[0, 0] > 0.0
    most = np.abs(directions / speeds[:, np.newaxis]).max(axis=0)
    np.testing.assert_allclose(most[most > 0.0], 1.0)
    if moved[2, 2] > 0.0:  # what turns by itself neither drives nor, where it can help it, slides
        np.testing.assert_allclose(moved[0, 2], 0.0, atol=1e-12)
        np.testing.assert_allclose(moved[2, 0], 0.0, atol=1e-12)
    elif directions[:, 2].any():
        np.testing.assert_array_equal(moved[:, 2], 0.0)
        assert bends(platform, qp, directions[:, 2]) > 0.0
    free = np.linalg.matrix_rank(body_map(platform, qp)) == 3
    assert bool(directions[:, 1].any()) is bool(free)
    if free:
        np.testing.assert_allclose(moved / np.diag(moved), np.eye(3), atol=1e-9)


@pytest.mark.parametrize("name", [name for name, one in EXAMPLES.items() if one.p and one.n_p > 3])
@pytest.mark.parametrize("angle", [0.3, 0.5 * np.pi, -0.5 * np.pi])
@pytest.mark.parametrize("other", [1.0, -1.0])
def test_however_it_is_steered_a_base_goes_where_it_is_asked_to_or_not_at_all(
    name: str, angle: float, other: float
) -> None:
    platform = EXAMPLES[name]
    qp = np.array([0.05, 0.05, 0.05, *(angle * other**k for k in range(platform.n_p - 3))])
    directions = base_directions(platform, qp, np.ones(platform.p))
    moved = body_map(platform, qp) @ directions
    for axis in range(3):
        assert moved[axis, axis] > 1e-7 or not moved[:, axis].any()


def test_a_base_whose_wheels_all_stand_aside_goes_aside() -> None:
    platform = EXAMPLES["wheeled, two steered"]
    for angles in ([0.5, 0.5], [-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5]):
        qp = np.array([0.0, 0.0, 0.0, *np.pi * np.array(angles)])
        directions = base_directions(platform, qp, np.ones(platform.p))
        moved = body_map(platform, qp) @ directions
        np.testing.assert_allclose(moved, np.diag([0.0, 1.0, 0.0]), atol=1e-12)
        assert directions[1:, 2].any()  # round is: its wheels are steered


@pytest.mark.parametrize("name", list(WHEELED))
def test_no_input_is_above_its_speed(name: str) -> None:
    platform = WHEELED[name]
    rng = np.random.default_rng(3)
    speeds = rng.uniform(0.1, 2.0, platform.p)
    for _ in range(5):
        up = base_inputs(platform, np.zeros(platform.n_p), rng.uniform(-1.0, 1.0, 3), speeds)
        assert np.all(np.abs(up) <= speeds * (1.0 + 1e-12))


def test_a_base_is_at_first_slow_or_half_as_fast_as_it_can() -> None:
    base = nmm.load("unicycle_3r")
    np.testing.assert_allclose(full_speeds(base, base.rest), [0.25, 0.5])
    slower = nmm.load("unicycle_3r", platform=nmm.Unicycle(limits={"v": 0.2}))
    np.testing.assert_allclose(full_speeds(slower, slower.rest), [0.1, 0.5])
    wheels = nmm.load("unicycle_3r", platform=nmm.DifferentialDrive(0.1, 0.5))
    # Of each wheel 2.5 rad/s: 0.25 m/s ahead.
    np.testing.assert_allclose(full_speeds(wheels, wheels.rest), [2.5, 2.5])


def test_a_base_takes_its_hand_along_and_never_slides() -> None:
    held = Held(unicycle(), v=0.4, omega=0.6)
    driven, first = held.driven, held.driven.q.copy()
    before = held.hand()
    shares = (1.0, 1.0, 1.0, 1.0, 1.0, 0.5)  # sideways, up and over are not its to do
    for up in held.go_on(1.0, Jog("base", shares)):
        np.testing.assert_allclose(up, [0.4, 0.3, 0.0, 0.0, 0.0], atol=1e-12)
    theta, radius = first[2], 0.4 / 0.3
    np.testing.assert_allclose(driven.q[2] - theta, 0.3)
    gone = radius * np.array([np.sin(theta + 0.3) - np.sin(theta), np.cos(theta) - np.cos(theta + 0.3)])
    np.testing.assert_allclose(driven.q[:2] - first[:2], gone, atol=1e-9)
    np.testing.assert_array_equal(driven.q[3:], first[3:])
    assert held.jogging.part == "base"
    np.testing.assert_allclose(held.hand().translation[2], before.translation[2])
    np.testing.assert_allclose(driven.targets[0].signal.value, held.hand().translation, atol=1e-12)


def test_a_car_drives_and_steers() -> None:
    robot = nmm.load("car_base")
    held = Held(RobotSetup(robot, [nmm.Position("base_footprint", "xy")], robot.rest))
    jog = Jog("base", (1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    inputs = held.go_on(0.5, jog)
    np.testing.assert_allclose(inputs[0][:2], [0.25, 0.5])
    assert held.driven.q[robot.coordinate("steering")] == pytest.approx(0.25)
    assert held.driven.q[2] > 0.0


def test_what_a_base_can_do_is_told_as_its_wheel_is_steered() -> None:
    robot = nmm.load("car_base", platform=nmm.FrontDriveCar(0.4, max_steering=np.pi))
    q = robot.rest.copy()
    q[robot.coordinate("steering")] = 0.5 * np.pi
    setup = RobotSetup(robot, [nmm.Position("base_footprint", "xy")], q)
    held = Held(setup)
    assert held.jogging.for_page()["base"] == ["rz"]  # across, it drives round
    held.go_on(0.5, Jog("base", along("rz")))
    assert held.jogging.base_axes == ["x", "rz"]
    with Loop(setup) as loop:
        wait_for(lambda: "base" in loop.picture())
        assert loop.picture()["base"] in (["rz"], ["x", "rz"])  # its controller may have steered meanwhile


# the hand


@pytest.mark.parametrize("frame", ["hand", "base", "world"])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_hand_goes_straight_along_an_axis_at_its_speed(frame: str, axis: str) -> None:
    """As Pinocchio has it, whatever the gain of its task."""
    held = Held(unicycle(), linear=0.1)
    held.driven.use(held.driven.with_choice("task.0.gain", 5.0))
    held.jogging.renew(held.jogging.standing(held.driven.reacting))
    before, theta = held.hand(), held.driven.q[2]
    turned = {"hand": before.rotation, "world": np.eye(3), "base": pin.exp3(np.array([0.0, 0.0, theta]))}
    way = turned[frame][:, "xyz".index(axis)]
    at = [held.hand().translation]
    held.go_on(0.005, Jog("hand", along(axis, -1.0), frame))
    first = held.hand().translation - at[0]
    np.testing.assert_allclose(first, -0.1 * 0.005 * way, atol=2e-6)
    held.go_on(0.5, Jog("hand", along(axis, -1.0), "world"))
    moved = held.hand().translation - at[0] - first
    np.testing.assert_allclose(moved, -0.05 * np.eye(3)["xyz".index(axis)], atol=2e-5)
    np.testing.assert_allclose(held.driven.targets[0].signal.value, held.hand().translation, atol=1e-3)


def test_a_hand_along_two_axes_is_no_faster() -> None:
    held = Held(unicycle(), linear=0.1)
    before = held.hand().translation
    held.go_on(0.5, Jog("hand", (1.0, 1.0, 0.0, 0.0, 0.0, 0.0), "world"))
    assert np.linalg.norm(held.hand().translation - before) == pytest.approx(0.05, rel=1e-3)


@pytest.mark.parametrize("frame", ["hand", "world"])
@pytest.mark.parametrize("axis", ["rx", "ry", "rz"])
def test_a_hand_turns_about_an_axis_and_stays(frame: str, axis: str) -> None:
    held = Held(scenario("tiago_pose"), angular=0.4)
    hand, driven = "arm_tool_link", held.driven
    driven.use(driven.with_choice("resolver.kind", "dls"))
    held.jogging.renew(held.jogging.standing(driven.reacting))
    before = held.hand(hand)
    held.go_on(0.5, Jog("hand", along(axis), frame))
    about = np.eye(3)[("rx", "ry", "rz").index(axis)]
    R = held.hand(hand).rotation
    turned = pin.log3(before.rotation.T @ R if frame == "hand" else R @ before.rotation.T)
    np.testing.assert_allclose(turned, 0.2 * about, atol=2e-3)
    np.testing.assert_allclose(held.hand(hand).translation, before.translation, atol=1e-3)


def test_a_hand_that_a_limit_holds_back_has_nothing_to_make_up_for() -> None:
    """It goes the other way at once: its target has not run ahead."""
    robot = nmm.load("unicycle_3r")
    slow = nmm.Limits({"v": 0.02, "omega": 0.02, "q1": 0.02, "q2": 0.02, "q3": 0.02})

    class Slow(RobotSetup):
        def controller(self, settings: object) -> nmm.Controller:
            return super().controller({}).with_arguments(limits=slow)

    held = Held(Slow(robot, [nmm.Position("ee")], robot.q({"q2": 0.8, "q3": 0.5})))
    held.go_on(2.0, Jog("hand", along("x"), "world"))
    before = held.hand().translation
    held.go_on(0.2, Jog("hand", along("x", -1.0), "world"))
    assert held.hand().translation[0] < before[0] - 1e-4


def test_a_hand_whose_platform_has_drifted_is_not_drawn_back() -> None:
    """Odometry is wrong by decimetres; the hand goes as that of a robot where this one is believed."""
    lost = unicycle()
    lost.disturbances = nmm.Disturbances(slip={"v": 0.5, "omega": 0.8}, odometry=True)
    held = Held(lost)
    held.go_on(2.0, Jog("base", (1.0, 0.0, 0.0, 0.0, 0.0, 1.0)))
    held.go_on(0.3)
    believed = held.driven.seen.copy()
    assert np.linalg.norm(believed[:2] - held.driven.q[:2]) > 0.1
    ideal = Held(RobotSetup(lost.robot, [nmm.Position("ee")], believed))
    jog = Jog("hand", along("y"), "world")
    np.testing.assert_allclose(held.go_on(0.005, jog), ideal.go_on(0.005, jog), atol=1e-9)


# letting go


def test_let_go_of_it_stops_along_its_limits_and_stands() -> None:
    robot = nmm.load("unicycle_3r")
    limits = nmm.Limits(acceleration={"v": 0.5, "omega": 1.0, "q1": 2.0, "q2": 2.0, "q3": 2.0})

    class Braked(RobotSetup):
        def controller(self, settings: object) -> nmm.Controller:
            return super().controller({}).with_arguments(limits=limits)

    for part, frame in (("base", "hand"), ("hand", "world")):
        held = Held(Braked(robot, [nmm.Position("ee")], robot.q({"q2": 0.8, "q3": 0.5})))
        driven, dt = held.driven, held.driven.setup.dt
        inputs = held.go_on(1.0, Jog(part, AHEAD, frame))  # type: ignore[arg-type]
        assert held.jogging.part == part
        fastest = np.abs(inputs[-1])
        u = np.array([inputs[-1], *held.go_on(1.0)])
        assert held.jogging.part == ""
        most = np.array([0.5, 1.0, 2.0, 2.0, 2.0])
        assert np.all(np.abs(np.diff(u, axis=0)) <= most * dt * (1.0 + 1e-6))
        assert np.all(np.diff(np.abs(u), axis=0) <= 1e-12)  # nothing but brakes
        brakes = np.ceil(fastest / (most * dt) - 1e-6).max()
        np.testing.assert_allclose(u[int(brakes) + 1 :], 0.0, atol=1e-12)
        assert brakes > 0
        q = driven.q.copy()
        held.go_on(1.0)
        np.testing.assert_array_equal(driven.q, q)
        # Its target is where it stands.
        np.testing.assert_allclose(driven.targets[0].signal.value, held.hand().translation, atol=1e-6)


def test_it_stands_though_its_objective_would_move_it_until_somebody_aims() -> None:
    held = Held(scenario())
    driven = held.driven
    held.go_on(0.5, Jog("hand", along("x"), "world"))
    held.go_on(0.1)
    q = driven.q.copy()
    held.go_on(1.0)
    np.testing.assert_array_equal(driven.q, q)
    held.jogging.leave()
    driven.aim(0, held.hand().translation + 0.1)
    for _ in range(10):
        assert driven.step()
    assert np.abs(driven.q - q).max() > 1e-4


def test_what_was_said_holds_for_a_quarter_of_a_second() -> None:
    held = Held(unicycle())
    held.go_on(0.1, Jog("base", AHEAD))
    q = held.driven.q.copy()
    held.now += 0.9 * VALID
    held.jogging.prepare()
    assert held.driven.step()
    assert held.driven.q[0] > q[0]
    held.now += 0.2 * VALID
    q = held.driven.q.copy()
    held.jogging.prepare()
    assert held.driven.step()
    np.testing.assert_array_equal(held.driven.q, q)
    assert held.jogging.part == ""


def test_one_page_moves_it_and_another_does_not_take_over() -> None:
    held, other = Held(unicycle()), object()
    held.go_on(0.1, Jog("base", AHEAD))
    for axes in (NONE, along("x", -1.0)):
        held.jogging.hear(Jog("base", axes), other)
        assert held.jogging.wanted == Jog("base", AHEAD)
    held.jogging.gone(other)
    assert held.jogging.wanted is not None
    held.jogging.gone(held.page)
    assert held.jogging.wanted is None
    held.jogging.hear(Jog("base", along("x", -1.0)), other)
    assert held.jogging.wanted == Jog("base", along("x", -1.0))


def test_a_flood_is_thinned_and_a_stop_is_always_heard() -> None:
    held = Held(unicycle())
    held.say(Jog("base", AHEAD))
    held.now += 0.5 * SOONEST
    held.jogging.hear(Jog("base", along("x", -1.0)), held.page)
    assert held.jogging.wanted == Jog("base", AHEAD)
    held.jogging.hear(Jog("base", NONE), held.page)
    assert held.jogging.wanted is None


def test_nothing_moves_while_it_is_paused() -> None:
    held = Held(unicycle())
    held.go_on(0.1, Jog("base", AHEAD))
    held.jogging.paused = True
    held.say(Jog("base", AHEAD))
    held.jogging.attend(held.jogging.wanted)
    assert held.jogging.part == ""


def test_another_controller_goes_on_with_what_is_held() -> None:
    held = Held(unicycle())
    held.go_on(0.1, Jog("base", AHEAD))
    made = held.driven.with_choice("task.0.gain", 4.0)
    held.driven.use(made)
    held.jogging.renew(held.jogging.standing(made.controller))
    (up, *_) = held.go_on(0.1, Jog("base", AHEAD))
    np.testing.assert_allclose(up, [0.25, 0.0, 0.0, 0.0, 0.0], atol=1e-12)
    held.go_on(0.1)
    q = held.driven.q.copy()
    held.driven.use(made)
    held.jogging.renew(held.jogging.standing(made.controller))
    held.go_on(0.1)
    np.testing.assert_array_equal(held.driven.q, q)


def test_what_cannot_stand_at_first_is_jogged_later(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise RunError("its distances cannot be kept here")

    with monkeypatch.context() as at_first:
        at_first.setattr(nmm.Controller, "step", fails)
        held = Held(unicycle())
    q = held.driven.q.copy()
    held.go_on(0.1, Jog("base", AHEAD))
    assert held.driven.q[0] > q[0]


# speeds


def test_a_speed_is_chosen_within_its_limits() -> None:
    held = Held(unicycle(), v=0.5)
    assert {choice.key: choice.unit for choice in held.jogging.choices} == {
        "jog.linear": "m/s", "jog.v": "m/s", "jog.omega": "rad/s"
    }  # fmt: skip
    held.jogging.choose("jog.v", 0.125)
    (up, *_) = held.go_on(0.1, Jog("base", AHEAD))
    np.testing.assert_allclose(up[0], 0.125)
    for key, value in (
        ("jog.v", 1e9),
        ("jog.v", "fast"),
        ("jog.v", float("nan")),
        ("jog.w", 0.1),
        ("task.0.gain", 1.0),
    ):
        with pytest.raises(InputError):
            held.jogging.choose(key, value)
    slow = nmm.load("unicycle_3r", platform=nmm.Unicycle(limits={"v": 0.2}))
    setup = RobotSetup(slow, [nmm.Position("ee")], slow.rest)
    for speeds in ({"v": 0.3}, {"v": 0.0}, {"v": float("inf")}, {"w": 0.1}, {"angular": 0.1}):
        with pytest.raises(InputError, match="jog speed"):
            Jogging(Driven(setup), speeds)


def test_what_cannot_be_moved_is_told_and_refused() -> None:
    robot = nmm.load("unicycle_3r", platform="fixed")
    held = Held(RobotSetup(robot, [nmm.Posture("q1"), nmm.Position("ee")], robot.rest))
    assert held.jogging.for_page() == {
        "hands": [{"task": 1, "name": "ee", "axes": ["x", "y", "z"]}],
        "base": [],
    }
    for jog in (Jog("base", AHEAD), Jog("hand", AHEAD), Jog("hand", AHEAD, task=7)):
        with pytest.raises(InputError):
            held.jogging.hear(jog, held.page)


# the loop


def message(axes: str = "[1,0,0,0,0,0]", part: str = "hand", more: str = "") -> str:
    return f'{{"type":"jog","part":"{part}","axes":{axes}{more}}}'


HOSTILE = [
    '{"type":"jog"}', message("[1,0,0,0,0]"), message("[1,0,0,0,0,0,0]"), message("null"),
    message("[1.01,0,0,0,0,0]"), message("[NaN,0,0,0,0,0]"), message("[Infinity,0,0,0,0,0]"),
    message('["1",0,0,0,0,0]'), message("[true,0,0,0,0,0]"), message(part="arm"),
    message(more=',"frame":"tool"'), message(more=',"task":-1'), message(more=',"speed":9'),
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_other_messages_are_refused(text: str) -> None:
    with pytest.raises(InputError):
        parsed(text)


def test_a_message_is_read() -> None:
    text = '{"type":"jog","part":"hand","frame":"world","task":1,"axes":[1,-0.5,0,0,0,0]}'
    assert parsed(text) == Jog("hand", (1.0, -0.5, 0.0, 0.0, 0.0, 0.0), "world", 1)


def jogged(loop: Loop, jog: Jog, page: object = None) -> None:
    """What a page says as long as it is held."""
    axes = list(jog.axes)
    message = {"type": "jog", "part": jog.part, "frame": jog.frame, "task": jog.task, "axes": axes}
    loop.session.receive(json.dumps(message), page)


def test_who_holds_on_takes_over_from_a_plan_and_gives_back_to_who_aims(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with Loop(scenario("behind_the_wall")) as loop:
        loop.session.receive('{"type":"order","what":"plan"}')
        wait_for(lambda: loop.picture()["plans"] is True)
        for text in HOSTILE:
            loop.session.receive(text)

        def moves() -> bool:
            jogged(loop, Jog("base", along("rz")))
            return loop.picture()["jogs"] == "base"

        with monkeypatch.context() as patient:
            patient.setattr("nmm.plugins.live.driving.jogging.VALID", 1e6)
            wait_for(moves)
            assert loop.picture()["plans"] is False
            assert "the base moves" in str(loop.picture()["told"])
        wait_for(lambda: loop.picture()["jogs"] == "")  # nothing more is said
        wait_for(lambda: "stands where it was let go of" in str(loop.picture()["told"]))
        loop.session.receive('{"type":"order","what":"here"}')
        wait_for(lambda: "stands" not in str(loop.picture()["told"]))


def test_an_aim_that_is_refused_does_not_end_the_stand() -> None:
    with Loop(scenario()) as loop:

        def stands() -> bool:
            return "stands where it was let go of" in str(loop.picture()["told"])

        def moves() -> bool:
            jogged(loop, Jog("base", along("rz")))
            return loop.picture()["jogs"] == "base"

        wait_for(moves)
        jogged(loop, Jog("base", NONE))
        wait_for(stands)
        for aim in ('"task":999,"value":[1]', '"task":0,"value":[1,1,1,1,1]'):
            loop.session.receive(f'{{"type":"aim",{aim},"number":7}}')
        number = loop.session._choices[0]
        loop.session.receive('{"type":"pick","key":"jog.v","value":0.125}')  # heard after them
        wait_for(lambda: loop.session._choices[0] > number)
        count = loop.session._count
        wait_for(lambda: loop.session._count > count + 1)
        assert stands()
        assert loop.picture()["heard"] == [7]  # no page waits for what is refused


def test_a_page_that_is_gone_holds_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it said last."""
    monkeypatch.setattr("nmm.plugins.live.driving.jogging.VALID", 1e6)
    with Loop(scenario()) as loop:
        page = loop.session._visit()
        text = json.dumps({"type": "jog", "part": "base", "axes": AHEAD})

        def moves() -> bool:
            page.heard(text)
            return loop.picture()["jogs"] == "base"

        wait_for(moves)
        page.gone()
        wait_for(lambda: loop.picture()["jogs"] == "")


def test_a_speed_that_a_page_picks_is_shown_to_all() -> None:
    with Loop(scenario()) as loop:

        def shown() -> float:
            return {choice.key: choice.value for choice in loop.session._choices[1]}["jog.v"]  # type: ignore[return-value]

        number = loop.session._choices[0]
        loop.session.receive('{"type":"pick","key":"jog.v","value":1e9}')
        wait_for(lambda: loop.session._choices[0] > number)
        assert shown() == 0.25
        loop.session.receive('{"type":"pick","key":"jog.v","value":0.125}')
        wait_for(lambda: shown() == 0.125)


@pytest.mark.parametrize("name", ["attend", "prepare", "words"])
def test_what_goes_wrong_with_it_does_not_end_the_loop(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    def raises(*_: object) -> None:
        raise ValueError("it went wrong")

    with Loop(scenario()) as loop:
        wait_for(lambda: loop.picture()["t"] > 0.1)
        with monkeypatch.context() as meanwhile:
            meanwhile.setattr(Jogging, name, raises)
            wait_for(lambda: "it went wrong" in str(loop.picture()["told"]))
        loop.session.receive('{"type":"order","what":"restart"}')
        wait_for(lambda: "it went wrong" not in str(loop.picture()["told"]))
        t = loop.picture()["t"]
        wait_for(lambda: loop.picture()["t"] > t)


def test_its_speeds_are_checked_before_anything_is_shown() -> None:
    with pytest.raises(InputError, match="unknown speed 'lin'"):
        DriveSession(Driven(scenario()), {"lin": 1.0})
