"""Motions in words: they say what the robot then does, whichever way it stands and turns."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import pi
from numpy.typing import NDArray
from platform_grid import EXAMPLES
from robot_grid import built, start

from nmm.analysis.redundant.motion_words import (
    COORDINATES,
    INPUTS,
    Words,
    coordinate_words,
    input_words,
    motion_text,
)
from nmm.analysis.redundant.report import redundancy
from nmm.configuration import Configuration
from nmm.robot import Robot
from nmm.tasks import Position

Array = NDArray[np.float64]


def moved(robot: Robot, q: Array, motion: Array, step: float) -> Array:
    """q after a short time with constant inputs, by the midpoint rule."""
    return q + step * robot.S(q + step / 2 * robot.S(q) @ motion) @ motion


def body_displacement(robot: Robot, q: Array, u: Array, step: float = 1e-3) -> Array:
    """Forward, left (m) and counter-clockwise (rad) in the platform's own axes, for a unit of time."""
    change = (moved(robot, q, u, step) - q)[:3] / step
    c, s = np.cos(q[2]), np.sin(q[2])
    return np.array([c * change[0] + s * change[1], -s * change[0] + c * change[1], change[2]])


#: Which displacement, and with which sign.
DISPLACED = {
    "drive forward": (0, 1), "drive back": (0, -1), "slide left": (1, 1), "slide right": (1, -1),
    "turn left": (2, 1), "turn right": (2, -1),
}  # fmt: skip


@pytest.mark.parametrize(
    "base", ["unicycle", "differential", "car", "tractor", "mecanum", "described by its wheels"]
)
def test_words_of_platforms_are_what_they_do(base: str, rng: np.random.Generator) -> None:
    robot = built(base, "small arm")
    q = robot.q(start(base, "small arm") | {"theta": float(rng.uniform(-3, 3))})
    words = input_words(robot, q)
    said = 0
    for k, name in enumerate(robot.platform.inputs):
        for rate in (0.7, -0.7):
            u = np.zeros(robot.n_u)
            u[k] = rate
            text = motion_text(u, robot.u_names, robot.u_units, words, robot.platform.p)
            phrase = text.split(" at ")[0]
            assert text == f"{phrase} at 0.7 {robot.u_units[k]} alone"
            if phrase in DISPLACED:
                axis, sign = DISPLACED[phrase]
                assert sign * body_displacement(robot, q, u)[axis] > 0.0, name
                said += 1
    assert said or base == "differential"


def test_wheels_forward_drive_forward() -> None:
    robot = built("differential", "small arm")
    assert INPUTS["omega_left"] == Words("left wheel forward", "left wheel back")
    left, right = robot.input("omega_left"), robot.input("omega_right")
    for only, turns in ((left, -1), (right, 1)):  # the left wheel forward turns the robot to the right
        u = np.zeros(robot.n_u)
        u[only] = 1.0
        forward, _, turned = body_displacement(robot, robot.q(), u)
        assert forward > 0
        assert turns * turned > 0


def test_steering_left_makes_it_turn_left() -> None:
    for base in ("car", "front-driven car"):
        robot = built(base, "small arm")
        u = np.zeros(robot.n_u)
        u[robot.input("steering_rate")] = 0.2
        q = moved(robot, robot.q(), u, 1.0)
        assert input_words(robot, robot.q())["steering_rate"].positive == "steer left"
        drive = np.eye(robot.n_u)[robot.input("v")]
        assert body_displacement(robot, q, drive)[2] > 0


def test_inputs_with_names_of_their_own() -> None:
    wheeled = {name: EXAMPLES[f"wheeled, {name}"] for name in ("omni", "wheel speeds", "two steered")}
    names = {name for platform in wheeled.values() for name in platform.inputs}
    assert {"rear_left_spin", "steer_a_rate", "vx"} <= names
    robot = built("described by its wheels", "small arm")
    words = input_words(robot, robot.q())
    assert words[robot.platform.inputs[0]].positive == "drive forward"
    rate = Words("paddle", "paddle").phrase(-0.25, "rad/s")
    assert rate == "paddle at -0.25 rad/s"


@pytest.mark.parametrize("q1", [0.0, 0.9])
@pytest.mark.parametrize("q2", [0.4, -0.4, 2.9, -2.9, 3.5])
def test_the_elbow_opens_when_the_hand_leaves_the_shoulder(robot_2r: Robot, q1: float, q2: float) -> None:
    q = robot_2r.q({"theta": 0.7, "q1": q1, "q2": q2})
    words = input_words(robot_2r, q)
    assert words["q1"] == Words("q1 turns left", "q1 turns right")

    def reach(q: Array) -> float:
        configuration = Configuration(robot_2r, q)
        flat = configuration.placement("ee").translation - configuration.placement("link1").translation
        return float(np.linalg.norm(flat[:2]))

    for rate in (1.0, -1.0):
        ahead = q + rate * 1e-4 * np.eye(5)[4]
        phrase = words["q2"].phrase(rate, "rad/s")
        assert phrase.startswith("q2 opens" if reach(ahead) > reach(q) else "q2 closes")


@pytest.mark.parametrize(("q2", "word"), [(0.0, "bends"), (pi, "unfolds"), (-pi, "unfolds")])
def test_stretched_and_folded_elbows_have_one_word(robot_2r: Robot, q2: float, word: str) -> None:
    assert input_words(robot_2r, robot_2r.q({"q2": q2}))["q2"] == Words(f"q2 {word}", f"q2 {word}")


@pytest.mark.parametrize("trial", range(4))
def test_words_of_a_spatial_arm(ur5: Robot, trial: int) -> None:
    rng = np.random.default_rng(trial)
    q = ur5.q(
        {"shoulder_lift_joint": rng.uniform(-2, -0.5), "elbow_joint": (-1) ** trial * rng.uniform(0.4, 2.5)}
    )
    q[ur5.coordinate("wrist_1_joint")] = rng.uniform(-2, 2)
    words = input_words(ur5, q)
    assert words["shoulder_pan_joint"] == Words(
        "shoulder_pan_joint turns left", "shoulder_pan_joint turns right"
    )

    def at(q: Array, frame: str) -> Array:
        return np.array(Configuration(ur5, q).placement(frame).translation)

    lift, elbow = ur5.coordinate("shoulder_lift_joint"), ur5.coordinate("elbow_joint")
    for rate in (1.0, -1.0):
        ahead = q + rate * 1e-4 * np.eye(ur5.n)[lift]
        rises = at(ahead, "forearm_link")[2] > at(q, "forearm_link")[2]
        assert words["shoulder_lift_joint"].phrase(rate, "").split()[1] == ("lifts" if rises else "lowers")
        ahead = q + rate * 1e-4 * np.eye(ur5.n)[elbow]
        before, after = (
            np.linalg.norm(at(one, "wrist_1_link") - at(one, "upper_arm_link")) for one in (q, ahead)
        )
        assert words["elbow_joint"].phrase(rate, "").split()[1] == ("opens" if after > before else "closes")
    assert words["wrist_3_joint"].positive.split()[1] == "turns"


def test_a_torso_extends_upwards(tiago: Robot) -> None:
    words = input_words(tiago, tiago.rest)
    assert words["torso_lift_joint"] == Words("torso_lift_joint extends", "torso_lift_joint retracts")
    assert words["arm_1_joint"].positive == "arm_1_joint turns left"
    up = tiago.rest + 0.1 * np.eye(tiago.n)[tiago.coordinate("torso_lift_joint")]
    heights = [Configuration(tiago, q).placement("arm_1_link").translation[2] for q in (tiago.rest, up)]
    assert heights[1] > heights[0]


@pytest.mark.parametrize("theta", [0.0, 2.4])
@pytest.mark.parametrize("q2", [0.7, -1.3])
def test_a_whole_sentence_comes_true(robot_2r: Robot, theta: float, q2: float) -> None:
    """The task rests to second order; platform and arm do what is said, and the opposite backwards."""
    q = robot_2r.q({"theta": theta, "q1": 0.4, "q2": q2})
    report = redundancy((robot_2r, Position("ee", "xy")), q)
    words = input_words(robot_2r, q)
    for vector in report.readable:
        for u in (vector, -vector):
            text = motion_text(u, robot_2r.u_names, robot_2r.u_units, words, 2)
            ahead = moved(robot_2r, q, u, 1e-4)
            tip = [Configuration(robot_2r, one).placement("ee").translation for one in (q, ahead)]
            assert np.abs(tip[1] - tip[0]).max() < 1e-7
            for phrase, (axis, sign) in DISPLACED.items():
                if phrase in text:
                    assert sign * body_displacement(robot_2r, q, u, 1e-4)[axis] > 0
            bends = abs(ahead[4]) > abs(q[4])
            assert ("q2 closes" if bends else "q2 opens") in text
            assert f"{abs(u[3]):.2g} rad/s" in text
    assert report.texts == tuple(
        motion_text(u, robot_2r.u_names, robot_2r.u_units, words, 2) for u in report.readable
    )


def test_withheld_motions_are_said_in_the_platforms_axes(robot_2r: Robot) -> None:
    q = robot_2r.q({"theta": 1.1, "q1": 0.4, "q2": 0.7})
    report = redundancy((robot_2r, Position("ee", "xy")), q)
    (vector,), (text,) = report.withheld, report.withheld_texts
    left = -np.sin(1.1) * vector[0] + np.cos(1.1) * vector[1]
    ahead = np.cos(1.1) * vector[0] + np.sin(1.1) * vector[1]
    assert f"slide {'left' if left > 0 else 'right'} at {abs(left):.2g} m/s" in text
    np.testing.assert_allclose(ahead, 0.0, atol=1e-12)  # what the wheels admit is not in it
    assert set(COORDINATES) <= set(coordinate_words(robot_2r, q))


def test_motions_in_words() -> None:
    words = {"v": INPUTS["v"], "a": Words("a opens", "a closes"), "b": Words("b turns", "b turns")}
    names, units = ("v", "a", "b"), ("m/s", "rad/s", "rad/s")

    def said(*rates: float) -> str:
        return motion_text(np.array(rates), names, units, words, 1)

    assert said(-0.31, 1, 0) == "drive back at 0.31 m/s while a opens at 1 rad/s"
    assert (
        said(0.31, -1, 0.5) == "drive forward at 0.31 m/s while a closes at 1 rad/s and b turns at +0.5 rad/s"
    )
    assert said(0, 1, -2) == "a opens at 1 rad/s while b turns at -2 rad/s"
    assert said(0, 0, 1) == "b turns at +1 rad/s alone"
    assert said(0, 0, 0) == "nothing moves"
