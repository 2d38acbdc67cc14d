"""A robot that follows a target which somebody moves: robot, loop, messages, without a browser."""

from __future__ import annotations

import json
import re
import signal
import time
import urllib.error
import urllib.request
from base64 import b64decode
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import page_of, refused
from live_loop import Loop, scenario
from ports import MOST, listening, wait_for
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.ioloop import IOLoop
from tornado.websocket import websocket_connect

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError, RunError, ScenarioError
from nmm.base.kinds import RESOLVERS
from nmm.model.robots.configuration import Configuration
from nmm.plugins.live.driving.driven import Driven, TargetProgress
from nmm.plugins.live.driving.messages import Aim, Order, Pick, parsed
from nmm.plugins.live.driving.planning import Planning, later
from nmm.plugins.live.driving.session import DriveSession
from nmm.plugins.live.driving.setups import RobotSetup, ScenarioSetup, Settings
from nmm.views.playback.rolling import Rolling

KINDS = ("rg", "pg", "ej", "dls")


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans are looked for as long as a busy machine needs."""
    monkeypatch.setattr("nmm.plugins.live.driving.planning.SECONDS", MOST)


def ee(driven: Driven) -> np.ndarray:
    return np.array(Configuration(driven.robot, driven.q).placement("ee").translation)


def moved(driven: Driven, seconds: float) -> None:
    for _ in range(round(seconds / driven.setup.dt)):
        assert driven.step(), driven.trouble


# the robot


def test_the_end_effector_goes_where_the_target_is_put() -> None:
    driven = Driven(scenario())
    driven.aim(0, np.array([0.4, -0.6, 0.7]))
    moved(driven, 15.0)
    np.testing.assert_allclose(ee(driven), [0.4, -0.6, 0.7], atol=1e-5)
    look = driven.look()
    np.testing.assert_allclose(look.at[0], ee(driven), atol=1e-12)
    J = driven.reacting.evaluate(driven.t, driven.q).J
    assert look.sigma_min == pytest.approx(np.linalg.svd(J)[1].min(), rel=1e-12)


def test_it_rolls_as_the_platform_does() -> None:
    """The wheels' angles, picture by picture, are those of the motion as a whole."""
    driven = Driven(scenario())
    driven.look()
    wheels, q = [driven.shown.now[1]], [driven.q]
    for _ in range(60):
        moved(driven, 0.03)
        driven.look()
        wheels.append(driven.shown.now[1])
        q.append(driven.q)
    whole = Rolling(driven.robot).angles(np.array(q), start=wheels[0])
    np.testing.assert_allclose(np.array(wheels), whole, atol=1e-12)
    assert np.abs(whole[-1] - whole[0]).max() > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_a_resolver_is_changed_while_it_moves(kind: str) -> None:
    driven = Driven(scenario())
    driven.aim(0, np.array([0.4, -0.6, 0.7]))
    moved(driven, 1.0)
    before, t = driven.q, driven.t
    driven.use(driven.with_choice("resolver.kind", kind))
    np.testing.assert_array_equal(driven.q, before)
    assert driven.t == t
    assert driven.reacting.resolver.name.lower() == kind
    moved(driven, 14.0)
    np.testing.assert_allclose(ee(driven), [0.4, -0.6, 0.7], atol=1e-4)


def test_a_resolver_that_a_scenario_cannot_do_with_says_why_and_changes_nothing() -> None:
    """It is tried when somebody chooses it: the page of a large robot comes without waiting for others."""
    with Loop(scenario("unicycle_3r_spline")) as loop:
        driven = loop.session._driven
        before, choices = driven.reacting, driven.choices
        assert next(one.options for one in choices if one.key == "resolver.kind") == tuple(RESOLVERS)
        loop.session.receive('{"type":"pick","key":"resolver.kind","value":"ej"}')
        wait_for(lambda: "added_task" in str(loop.picture()["told"]))
        assert driven.reacting is before
        assert driven.choices == choices


def test_a_gain_sets_how_fast_the_error_falls() -> None:
    """Without limits, ‖e‖ of a target at rest falls as exp(-K t), whatever the resolver."""
    for gain in (1.0, 4.0):
        driven = Driven(scenario())
        driven.use(driven.with_choice("task.0.gain", gain))
        first = np.linalg.norm(driven.look().step.error)
        moved(driven, 1.0)
        share = np.linalg.norm(driven.look().step.error) / first
        assert share == pytest.approx(np.exp(-gain), rel=1e-6)


def test_what_was_chosen_stays_through_other_choices_and_a_new_beginning() -> None:
    driven = Driven(scenario())
    chosen = {"task.0.gain": 3.0, "resolver.kind": "pg", "limits": True, "resolver.alpha": 5.0}
    for key, value in chosen.items():
        driven.use(driven.with_choice(key, value))
    moved(driven, 0.5)
    driven.aim(0, np.array([9.0, 9.0, 0.5]))
    driven.restart()
    assert {choice.key: choice.value for choice in driven.choices}.items() >= chosen.items()
    assert driven.t == 0.0
    np.testing.assert_array_equal(driven.q, driven.setup.q0)
    assert driven.targets[0].signal.value[0] < 1.0


def test_limits_are_kept_and_left() -> None:
    driven = Driven(scenario("tiago_pose"))
    first = driven.targets[0].signal.value
    driven.use(driven.with_choice("task.0.gain", 20.0))  # upwards the platform is no help
    driven.aim(0, first + np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0]))
    most = driven.robot.u_limits
    least = 1.0
    for _ in range(5):
        moved(driven, 0.02)
        step = driven.look().step
        assert np.all(np.abs(step.u) <= most * (1.0 + 1e-9))
        least = min(least, step.scale.min())
    assert least < 1.0
    driven.use(driven.with_choice("limits", False))
    step = driven.look().step
    assert np.any(np.abs(step.u) > most)
    assert step.scale.min() == 1.0


def test_a_weight_is_that_of_the_input() -> None:
    driven = Driven(scenario("tiago_pose"))
    driven.use(driven.with_choice("resolver.weights.omega", 7.0))
    asked = nmm.Scenario.load("tiago_pose", {"resolver.weights": {"torso_lift_joint": 20, "omega": 7}})
    expected = asked.controller().evaluate(0.0, driven.setup.q0)
    driven.reacting.reset()
    for target, value in zip(driven.targets, [expected.r_d], strict=True):
        target.signal.set(value)
    found = driven.reacting.evaluate(0.0, driven.setup.q0)
    rate = asked.controller().task.tasks[0]
    assert rate.gain == pytest.approx(1.0)
    # The reference is at rest at t = 0: the same problem.
    np.testing.assert_allclose(found.u, expected.u, atol=1e-9)


def test_the_inputs_before_go_over_to_another_controller() -> None:
    """From which limits of acceleration count."""
    driven = Driven(scenario())
    driven.use(driven.with_choice("limits", True))
    moved(driven, 0.1)
    before = driven.reacting.solver.before.copy()
    assert np.abs(before).max() > 0.01
    driven.use(driven.with_choice("task.0.gain", 2.0))
    np.testing.assert_array_equal(driven.reacting.solver.before, before)


def test_a_robot_without_a_scenario_holds_its_arm_where_it_is() -> None:
    robot = nmm.load("unicycle_3r")
    driven = Driven(RobotSetup(robot, [nmm.Position("ee", "xyz")], robot.rest))
    here = ee(driven)
    moved(driven, 1.0)
    np.testing.assert_allclose(ee(driven), here, atol=1e-9)
    there = here + np.array([0.3, 0.2, -0.2])
    driven.aim(0, there)
    moved(driven, 12.0)
    np.testing.assert_allclose(ee(driven), there, atol=2e-3)


def test_a_target_out_of_reach_is_told_until_it_is_in_reach_again() -> None:
    """The arm's first joint stays at its height; a platform that drives reaches any place below the arm's."""
    driven = Driven(scenario())
    assert driven.look().against == ""
    first = Configuration(driven.robot, driven.q).placement("link1").translation
    stretched = Configuration(driven.robot, driven.robot.q({})).placement("ee").translation  # arm upright
    for height, far in ((stretched[2] + 0.05, True), (stretched[2] - 0.05, False), (3.0, True)):
        driven.aim(0, np.array([4.0, -3.0, height]))
        moved(driven, 0.1)
        against = driven.look().against
        assert bool(against) is far
        if far:
            assert "the target of ee is out of reach" in against
            assert f"it is {height - first[2]:.3g} m above q1" in against
    driven.aim(0, np.array([0.4, -0.6, 0.7]))
    for _ in range(30):
        moved(driven, 0.1)
        assert driven.look().against == ""
    driven.restart()
    assert driven.look().against == ""


def test_an_error_that_stands_is_told_and_one_that_falls_is_not() -> None:
    driven = Driven(scenario())
    controller, target = driven.reacting, driven.targets[0].signal.value
    step = controller.evaluate(0.0, driven.q)

    def list_texts(norms: Callable[[float], float], *, until: float = 3.0, goal: Array = target) -> list[str]:
        reaching, found = TargetProgress(), []
        for t in np.arange(0.0, until, 1.0 / 30.0):
            error = np.array([0.0, 0.6, 0.8]) * norms(t)
            found.append(reaching.words(controller, t, replace(step, error=error), goal))
        return found

    stands = list_texts(lambda t: 0.5)
    assert not any(stands[:30])  # at first nobody knows
    assert all("does not fall: ‖e‖ stays at 0.5" in words for words in stands[31:])
    assert not any(list_texts(lambda t: 0.5 * np.exp(-0.05 * t)))  # a small gain
    assert not any(list_texts(lambda t: 40.0 - 0.5 * t))  # a long way under limits
    assert not any(list_texts(lambda t: 0.004))  # it is there
    # What limits leave of the rate is told; a target that moves begins anew; a pause is no time.
    limited = TargetProgress()
    for t in (0.0, 1.1):
        words = limited.words(controller, t, replace(step, error=np.ones(3), scale=np.array([0.25])), target)
    assert words.endswith("limits leave 0.25 of the task's rate")
    for _ in range(100):
        assert limited.words(controller, 1.1, replace(step, error=np.ones(3)), target + 0.01) == ""


def test_it_stands_still_and_says_why_until_it_is_told_otherwise() -> None:
    stuck = {"robot.arguments.d": 0, "resolver.partitions": "[[v, q1]]"}
    setup = ScenarioSetup(nmm.Scenario.load("unicycle_2r_position", stuck), {"q1": np.pi / 2})
    driven = Driven(setup)
    assert not driven.step()
    assert "lost rank" in driven.trouble
    where = driven.q
    assert not driven.step()
    np.testing.assert_array_equal(driven.q, where)
    driven.use(driven.with_choice("resolver.kind", "dls"))
    assert driven.trouble == ""
    moved(driven, 0.1)


def test_tasks_that_come_and_go_have_curves_while_they_are_there() -> None:
    driven = Driven(scenario("unicycle_3r_sequence"))
    counts = [len(target.rows) for target in driven.targets]
    moved(driven, 0.1)
    look = driven.look()
    assert look.step.error.shape == look.step.r_d.shape == (sum(counts),)
    on = np.repeat(driven.reacting.schedule.moment.active, counts)
    np.testing.assert_array_equal(np.isfinite(look.step.error), on)
    assert 0 < on.sum() < len(on)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("resolver.kind", "callable"), ("resolver.kind", 3), ("task.0.gain", 1e9), ("task.0.gain", "fast"),
        ("task.0.gain", float("nan")), ("task.0.gain", True), ("limits", "yes"),
        ("robot.source", "/etc/passwd"), ("task.1.gain", 1.0), ("", 1.0),
    ],
)  # fmt: skip
def test_what_is_no_choice_is_refused(key: str, value: object) -> None:
    driven = Driven(scenario())
    with pytest.raises(InputError):
        driven.with_choice(key, value)


# messages


def test_messages_are_read() -> None:
    assert parsed('{"type":"aim","task":0,"value":[1,2.5,-3e0]}') == Aim(0, (1.0, 2.5, -3.0))
    assert parsed(b'{"type":"pick","key":"limits","value":true}') == Pick("limits", True)
    assert parsed('{"type":"order","what":"pause"}') == Order("pause")


HOSTILE = [
    "", "null", "[]", "{}", "{", "\x00", "1e999", '"aim"', b"\xff\xfe", "[" * 1500, '{"type":"eval"}',
    '{"type":"aim"}', '{"type":"aim","task":0,"value":[]}', '{"type":"aim","task":0,"value":[NaN]}',
    '{"type":"aim","task":0,"value":[Infinity]}', '{"type":"aim","task":0,"value":["1"]}',
    '{"type":"aim","task":0,"value":[true]}', '{"type":"aim","task":0,"value":[1e5]}',
    '{"type":"aim","task":-1,"value":[1]}', '{"type":"aim","task":0.5,"value":[1]}',
    '{"type":"aim","task":true,"value":[1]}', '{"type":"aim","task":0,"value":[1],"more":1}',
    '{"type":"aim","task":0,"value":[%s]}' % ("9" * 1500),
    '{"type":"aim","task":%s,"value":[1]}' % ("9" * 1500),
    '{"type":"aim","task":0,"value":[%s0]}' % ("0," * 900), '{"type":"aim","task":0,"value":{"0":1}}',
    '{"type":"pick","key":1,"value":1}', '{"type":"pick","key":"limits","value":null}',
    '{"type":"pick","key":"limits","value":[1]}', '{"type":"order","what":"stop"}',
    '{"type":"order","what":1}', '{"type":["aim"],"task":0,"value":[1]}',
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_other_messages_are_refused(text: str | bytes) -> None:
    with pytest.raises(InputError):
        parsed(text)


def test_a_huge_number_is_out_of_range_and_no_overflow() -> None:
    driven = Driven(scenario())
    pick = parsed('{"type":"pick","key":"task.0.gain","value":%s}' % ("9" * 1500))
    assert isinstance(pick, Pick)
    with pytest.raises(InputError, match="from"):
        driven.with_choice(pick.key, pick.value)


# plans


def led(driven: Driven, planning: Planning, until: Callable[[], bool]) -> list[Array]:
    """Where the robot was, from picture to picture, until something is so."""
    places = []

    def there() -> bool:
        planning.attend()
        for _ in range(25):
            driven.step()
        places.append(driven.q.copy())
        return until()

    wait_for(there)
    return places


@pytest.mark.thorough
def test_a_target_behind_a_wall_is_planned_to_and_again_when_it_moves() -> None:
    """Its inputs are the plan's, not those of the controller that follows targets; distances by Coal."""
    driven = Driven(scenario("behind_the_wall"))
    planning = Planning(driven)
    moved(driven, 2.0)
    planning.turn(True)
    places = led(driven, planning, lambda: planning.number == 1)
    assert "follows its plan" in planning.words()[0]
    places += led(driven, planning, lambda: "plan's end" in planning.words()[0])
    moved(driven, 1.0)
    assert np.linalg.norm(driven.look().step.error) < 5e-3
    assert np.linalg.norm(places[-1][:2] - places[0][:2]) > 1.5
    before = driven.q.copy()
    planning.aims(0)
    driven.aim(0, np.array([0.5, 0.5, 0.8]))
    places += led(driven, planning, lambda: planning.number == 3)  # one is gone, another there
    np.testing.assert_allclose(places[-2], before, atol=0.02)  # it stood meanwhile
    places += led(driven, planning, lambda: "plan's end" in planning.words()[0])
    assert np.linalg.norm(driven.look().step.error) < 5e-2
    scene = driven.reacting.solver.scene
    assert scene is not None
    pairs = range(len(scene.names))
    assert min(scene.queries.distances(0.0, q, pairs).min() for q in places) >= 0.03
    planning.turn(False)
    assert driven._led is driven.reacting


def test_a_plan_that_is_refused_is_said_until_the_target_moves() -> None:
    driven = Driven(scenario("behind_the_wall"))
    planning = Planning(driven)
    planning.turn(True)
    driven.aim(0, np.array([4.5, 0.5, 3.0]))
    led(driven, planning, lambda: planning.words()[1])
    q = driven.q.copy()
    moved(driven, 0.5)
    np.testing.assert_array_equal(driven.q, q)
    assert planning.words()[0].startswith("No plan: goal: no free goal posture found")
    assert planning.number == 0
    driven.aim(0, np.array([0.5, 0.5, 0.8]))
    led(driven, planning, lambda: planning.number == 1)


def test_a_plan_is_sent_to_pages_once_and_taken_away() -> None:
    with Loop(scenario("behind_the_wall")) as loop:
        loop.session.receive('{"type":"order","what":"plan"}')
        found: list[dict] = []

        def seen(number: int) -> bool:
            found.extend(json.loads(line) for line in loop.latest().splitlines())
            return sum(one["type"] == "plan" for one in found) == number

        wait_for(lambda: seen(1))
        (plan,) = [one for one in found if one["type"] == "plan"]
        assert len(plan["lines"]) == 2  # of the end-effector and of the platform
        assert len(plan["ghosts"]["joints"]) > 5
        tree = np.frombuffer(b64decode(plan["tree"]["f32"]), dtype="<f4").reshape(-1, 2, 3)
        assert len(tree) > 2
        assert np.ptp(tree[..., 2]) == 0.0  # on the ground
        floor = np.frombuffer(b64decode(plan["lines"][1]["points"]["f32"]), dtype="<f4")
        np.testing.assert_allclose(tree[0, 0, :2], floor[:2], atol=1e-6)  # where it stood when it planned
        wait_for(lambda: loop.picture()["plans"] is True)
        late = [json.loads(line) for line in loop.session.follow()().splitlines()]
        assert plan in late
        loop.session.receive('{"type":"order","what":"react"}')
        wait_for(lambda: seen(2))
        gone = [one for one in found if one["type"] == "plan"][-1]
        assert gone["lines"] == []
        assert gone["tree"] is None


@pytest.mark.parametrize("name", ["behind_the_wall", "unicycle_3r_position"])
def test_a_plan_to_where_the_robot_is_is_followed_and_shown(name: str) -> None:
    """Of no length, or nearly: the loop goes on."""
    with Loop(scenario(name)) as loop:
        driven = loop.session._driven
        here = json.dumps(ee(driven)[: len(driven.targets[0].signal.value)].tolist())
        loop.session.receive(f'{{"type":"aim","task":0,"value":{here}}}')
        loop.session.receive('{"type":"order","what":"plan"}')
        found: list[dict] = []

        def shown() -> bool:
            found.extend(json.loads(line) for line in loop.latest().splitlines())
            return any(one["type"] == "plan" for one in found)

        wait_for(shown)
        wait_for(lambda: "plan's end" in str(loop.picture()["told"]))


def test_what_goes_wrong_with_a_plan_is_told_and_the_loop_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def raises(*_: object) -> dict[str, object]:
        raise ValueError("drawn wrongly")

    monkeypatch.setattr(Planning, "shown", raises)
    with Loop(scenario("behind_the_wall")) as loop:
        loop.session.receive('{"type":"order","what":"plan"}')
        wait_for(lambda: "drawn wrongly" in str(loop.picture()["told"]))
        before = loop.picture()["t"]
        wait_for(lambda: loop.picture()["t"] != before)
        assert loop.picture()["plans"] is False


# the loop


def test_a_hostile_message_changes_nothing() -> None:
    with Loop(scenario()) as loop:
        for text in HOSTILE:
            loop.session.receive(text)
        loop.session.receive('{"type":"aim","task":7,"value":[1,2,3]}')
        loop.session.receive('{"type":"aim","task":0,"value":[1,2]}')
        loop.session.receive('{"type":"pick","key":"robot.source","value":"/etc/passwd"}')
        driven = loop.session._driven
        target, choices = driven.targets[0].signal.value, driven.choices
        wait_for(
            lambda: not loop.session._waiting and not loop.session._picks and loop.session._making is None
        )
        count = loop.session._count
        wait_for(lambda: loop.session._count > count + 3)
        np.testing.assert_array_equal(driven.targets[0].signal.value, target)
        assert driven.choices == choices
        assert driven.trouble == ""


def test_a_page_is_told_every_sample_once_and_one_that_comes_late_the_last_ones() -> None:
    with Loop(scenario()) as loop:
        times = []
        late = None
        while len(times) < 40:
            times += [sample[0] for sample in loop.picture()["samples"]]
            time.sleep(0.02)
            if len(times) > 20 and late is None:
                late = json.loads(loop.session.follow()().splitlines()[-1])
    assert times == sorted(set(times))
    assert late is not None
    told = [sample[0] for sample in late["samples"]]
    assert told[: len(times)] == times[: len(told)]


class Growing(deque[tuple[int, list[float]]]):
    """Samples, to which the loop adds one after each time that somebody goes through them."""

    def __iter__(self) -> Iterator[tuple[int, list[float]]]:
        held = [self[k] for k in range(len(self))]
        number, (t, *values) = held[-1]
        self.append((number + 1, [t + 0.1, *values]))
        return iter(held)


def test_a_sample_that_comes_while_a_picture_is_made_is_told_with_the_next() -> None:
    with Loop(scenario()) as loop:
        wait_for(lambda: loop.picture()["t"] > 0.1)
    session, latest = loop.session, loop.session.follow()  # its own loop has ended
    session._samples = Growing(session._samples)
    before = [sample[0] for _, sample in tuple(session._samples)]
    times = [sample[0] for _ in range(4) for sample in json.loads(latest().splitlines()[-1])["samples"]]
    np.testing.assert_allclose(times, [*before, *(before[-1] + 0.1 * np.arange(1, 5))], rtol=1e-12)


def test_pause_restart_and_choices_are_told() -> None:
    with Loop(scenario()) as loop:
        wait_for(lambda: loop.picture()["t"] > 0.2)
        loop.session.receive('{"type":"order","what":"pause"}')
        wait_for(lambda: loop.picture()["paused"])
        t = loop.picture()["t"]
        time.sleep(0.2)
        assert loop.picture()["t"] == t
        loop.session.receive('{"type":"pick","key":"limits","value":true}')
        found: list[dict] = []

        def chosen() -> bool:
            for line in loop.latest().splitlines():
                found.append(json.loads(line))
            told = [one for one in found if one["type"] == "choices"]
            return (
                bool(told) and next(c for c in told[-1]["choices"] if c["key"] == "limits")["value"] is True
            )

        wait_for(chosen)
        loop.session.receive('{"type":"order","what":"restart"}')
        wait_for(lambda: loop.picture()["t"] == 0.0)
        loop.session.receive('{"type":"order","what":"go"}')
        wait_for(lambda: loop.picture()["t"] > 0.1)


def test_an_aim_shows_before_the_next_picture_is_due(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nmm.plugins.live.session.FPS", 0.01)
    with Loop(RobotSetup(nmm.load("unicycle_2r"), [nmm.Position("ee", "xy")], np.zeros(5))) as loop:
        first = loop.latest().splitlines()[-2]
        began = loop.session._driven.targets[0].signal.value
        aim = {"type": "aim", "task": 0, "value": [began[0] - 0.5, began[1] + 0.5]}
        loop.session.receive(json.dumps(aim))
        wait_for(lambda: loop.latest().splitlines()[-2] != first)


def test_pictures_say_which_aim_they_know_of() -> None:
    def aim(value: list[float], number: int) -> dict[str, object]:
        message = {"type": "aim", "task": 0, "value": value, "number": number}
        loop.session.receive(json.dumps(message))
        wait_for(lambda: loop.picture()["heard"] == [number])
        return loop.picture()

    with Loop(scenario()) as loop:
        wait_for(lambda: loop.picture()["heard"] == [None])
        assert aim([1.0, 0.5, 0.6], 7)["targets"] == [[1.0, 0.5, 0.6]]
        # What cannot be aimed at is heard too: no page waits for it.
        assert aim([1.0, 0.5], 9)["targets"] == [[1.0, 0.5, 0.6]]


def test_targets_are_brought_to_where_the_robot_is() -> None:
    with Loop(scenario()) as loop:
        wait_for(lambda: loop.picture()["t"] > 0.2)
        loop.session.receive('{"type":"order","what":"here"}')
        wait_for(lambda: np.allclose(loop.picture()["targets"], loop.picture()["at"], atol=1e-12))


def test_time_passes_as_it_does_on_the_wall() -> None:
    """As far as the machine can: what it could not do in time is told."""
    with Loop(scenario()) as loop:
        wait_for(lambda: loop.picture()["t"] > 0.2)
        w0, t0 = time.monotonic(), loop.picture()["t"]
        time.sleep(1.0)
        t1, w1 = loop.picture()["t"], time.monotonic()
        assert t1 - t0 <= w1 - w0 + 0.3
        wait_for(lambda: loop.picture()["t"] - t0 + loop.session.clock.lost / 30.0 >= 0.9 * (w1 - w0))


def test_obstacles_are_shown_where_they_are_and_kept_off() -> None:
    """One that moves, too: the robot gives way to it, as `Collisions` promises."""
    robot = nmm.load("unicycle_2r")
    wall = nmm.Obstacle(nmm.Box([0.1, 4.0, 1.0]), [2.0, 0.0, 0.5], name="wall")
    ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [-3.0 + 0.1 * t, 0.0, 0.3], name="ball")

    class Walled(RobotSetup):
        def controller(self, settings: Settings) -> nmm.Controller:
            plain = super().controller(settings)
            return nmm.Controller(
                robot, plain.task, plain.resolver, limits=plain.limits, dt=self.dt,
                collisions=nmm.Collisions(0.05, obstacles=[wall, ball]),
            )  # fmt: skip

    with Loop(Walled(robot, [nmm.Position("ee", "xy")], robot.rest)) as loop:
        told = [command for command in loop.session.commands if command["type"] == "obstacle"]
        assert [(one["path"], one["name"]) for one in told] == [
            ("/nmm/obstacle 0", "wall"), ("/nmm/obstacle 1", "ball"),
        ]  # fmt: skip
        loop.session.receive('{"type":"aim","task":0,"value":[3.0,0.0]}')
        wait_for(lambda: loop.session._look.t > 4.0)
        lines = [json.loads(line) for line in loop.latest().splitlines()]
        ((path, matrix),) = next(line for line in lines if line["type"] == "places")["transforms"]
        picture = next(line for line in lines if line["type"] == "drive")
        assert path == "/nmm/obstacle 1"
        assert matrix[12] == pytest.approx(-3.0 + 0.1 * picture["t"], abs=1e-9)
        # The arm's end would be through the wall by now.
        assert 1.2 < picture["at"][0][0] < 1.95


def test_what_a_scenario_draws_is_there_and_what_is_carried_goes_along() -> None:
    """Scenery after the obstacles, none of which the controller knows; a load below its frame's joint."""
    box = {"kind": "box", "size": [0.2, 0.3, 0.02]}
    scene = {
        "carried": [{"name": "tray", "frame": "ee", "shape": box}],
        "scenery": [{"name": "table", "shape": box, "xyz": [2, 0, 0.5]}],
    }
    given = ScenarioSetup(nmm.Scenario.load("unicycle_2r_position", {"scene": scene}))
    driven = Driven(given)
    assert driven.obstacles == ()
    session = DriveSession(driven)
    try:
        told = [command for command in session.commands if command["type"] in ("obstacle", "carried")]
        assert [one["name"] for one in told] == ["table", "tray"]
        (path,) = (
            one["path"] for one in session.commands if one["type"] == "object" and "carried" in one["path"]
        )
        places = json.loads(session.pose())["transforms"]
        joint = max((node for node, _ in places if path.startswith(f"{node}/")), key=len)
        assert joint.endswith("q2")
    finally:
        session.close()


def test_a_function_that_raises_stops_the_robot_and_not_the_loop() -> None:
    """Until the robot begins again where the function has a value."""
    robot = nmm.load("unicycle_2r")
    shy = {"now": False}

    def height(here: Configuration) -> float:
        if shy["now"]:
            raise InputError("no value here")
        return float(here.placement("ee").translation[0])

    task = nmm.Task(nmm.CallableFunction(height, ["ahead"]), 0.0)
    with Loop(RobotSetup(robot, [task], robot.rest)) as loop:
        wait_for(lambda: loop.picture()["t"] > 0.1)
        shy["now"] = True
        wait_for(lambda: "Stands still: no value here" in str(loop.picture()["told"]))
        assert loop.picture()["wrong"]
        shy["now"] = False
        loop.session.receive('{"type":"order","what":"restart"}')
        wait_for(lambda: loop.picture()["told"] and not loop.picture()["wrong"])
        t = loop.picture()["t"]
        wait_for(lambda: loop.picture()["t"] > t)


@pytest.mark.parametrize(
    ("owner", "name", "kind"),
    [
        (Driven, "step", ValueError),
        (Driven, "step", SystemExit),
        (Driven, "look", ValueError),
        (Driven, "restart", ValueError),
        (Planning, "words", ValueError),
        (DriveSession, "_values", ValueError),
    ],
)
def test_nothing_that_goes_wrong_ends_the_loop(
    monkeypatch: pytest.MonkeyPatch, owner: type, name: str, kind: type[BaseException]
) -> None:
    """It is told, and the robot begins again where nothing is wrong any more."""
    with Loop(scenario()) as loop:
        wait_for(lambda: loop.picture()["t"] > 0.1)
        with monkeypatch.context() as meanwhile:

            def raises(*_: object) -> None:
                raise kind("it went wrong")

            meanwhile.setattr(owner, name, raises)
            loop.session.receive('{"type":"order","what":"plan"}')
            loop.session.receive('{"type":"order","what":"restart"}')
            wait_for(lambda: "it went wrong" in str(loop.picture()["told"]))
            assert loop.picture()["wrong"]
            count = loop.session._count
            wait_for(lambda: loop.session._count > count + 3)  # there are pictures all the same
        loop.session.receive('{"type":"order","what":"react"}')
        loop.session.receive('{"type":"order","what":"restart"}')
        wait_for(lambda: "it went wrong" not in str(loop.picture()["told"]))
        t = loop.picture()["t"]
        wait_for(lambda: loop.picture()["t"] > t)


def test_work_that_ends_its_thread_has_a_result() -> None:
    def ends() -> None:
        raise SystemExit("no more")

    with pytest.raises(RunError, match="no more"):
        later(ends).result(timeout=MOST)


# the command


@pytest.mark.parametrize("name", [pytest.param("SIGINT", marks=pytest.mark.thorough), "SIGKILL"])
def test_nothing_stays_behind(tmp_path: Path, name: str) -> None:
    running, url = page_of(tmp_path, "drive", "unicycle_3r_position")
    port = int(url.rsplit(":", 1)[1].strip("/"))
    assert listening()[port] == "0100007F"
    running.send_signal(getattr(signal, name))
    running.communicate(timeout=MOST)
    assert running.returncode == (0 if name == "SIGINT" else -signal.SIGKILL)
    wait_for(lambda: port not in listening())
    assert list(tmp_path.iterdir()) == []


def test_only_its_own_page_is_listened_to(tmp_path: Path) -> None:
    running, url = page_of(tmp_path, "drive", "unicycle_3r_position")
    try:
        with urllib.request.urlopen(url, timeout=MOST) as answer:
            token = re.search(r'data-token="([^"]+)"', answer.read().decode())[1]
        socket = url.replace("http", "ws") + "socket"

        async def connects(address: str, **headers: str) -> bool:
            try:
                page = await websocket_connect(HTTPRequest(address, headers=headers))
            except HTTPClientError as error:
                return error.code != 403
            page.close()
            return True

        run = lambda *a, **k: IOLoop().run_sync(lambda: connects(*a, **k))  # noqa: E731
        assert run(f"{socket}?token={token}", Origin=url.strip("/"))
        assert not run(socket, Origin=url.strip("/"))
        assert not run(f"{socket}?token=wrong", Origin=url.strip("/"))
        assert not run(f"{socket}?token={token}", Origin="http://example.org")
        request = urllib.request.Request(url, headers={"Host": "example.org"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(request, timeout=MOST)
    finally:
        running.kill()
        running.communicate()


def test_bad_input_is_a_line(capfd: pytest.CaptureFixture[str]) -> None:
    for arguments, words in (
        (["nothing_like_it"], "unknown robot or scenario"),
        (["unicycle_2r", "--task", "position:nowhere"], "nowhere"),
        (["unicycle_3r_position", "--port", "99999"], "from 1 to 65535"),
    ):
        done = refused(capfd, "drive", *arguments, "--no-open")
        assert (done.status, done.out) == (2, "")
        (line,) = done.err.splitlines()  # nothing is warned of that is refused
        assert line.startswith("nmm drive: ")
        assert words in line


def test_a_scenario_error_names_its_key() -> None:
    wrong = nmm.Scenario.load("unicycle_3r_position", {"limits": {"velocity": {"nothing": 1}}})
    with pytest.raises(ScenarioError, match="limits"):
        ScenarioSetup(wrong).controller({})
