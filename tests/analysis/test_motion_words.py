"""Motions in words: they say what the robot then does, whichever way it stands and turns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy import pi
from numpy.typing import NDArray
from platform_grid import EXAMPLES
from robot_grid import built, start

from nmm.analysis.null_space.motion_words import (
    COORDINATES,
    INPUTS,
    WHO,
    Words,
    coordinate_words,
    input_words,
    motion_text,
)
from nmm.analysis.null_space.report import redundancy
from nmm.control.functions.tasks import Position
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot

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
    "drives forward": (0, 1), "drives back": (0, -1), "slides left": (1, 1), "slides right": (1, -1),
    "turns left": (2, 1), "turns right": (2, -1),
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
            if phrase.removeprefix(WHO) in DISPLACED:
                axis, sign = DISPLACED[phrase.removeprefix(WHO)]
                assert sign * body_displacement(robot, q, u)[axis] > 0.0, name
                said += 1
    assert said or base == "differential"


def test_wheels_forward_drive_forward() -> None:
    robot = built("differential", "small arm")
    assert INPUTS["omega_left"] == Words("the left wheel rolls forward", "the left wheel rolls back")
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
        assert input_words(robot, robot.q())["steering_rate"].positive == "the platform steers left"
        drive = np.eye(robot.n_u)[robot.input("v")]
        assert body_displacement(robot, q, drive)[2] > 0


def test_inputs_with_names_of_their_own() -> None:
    wheeled = {name: EXAMPLES[f"wheeled, {name}"] for name in ("omni", "wheel speeds", "two steered")}
    names = {name for platform in wheeled.values() for name in platform.inputs}
    assert {"rear_left_spin", "steer_a_rate", "vx"} <= names
    robot = built("described by its wheels", "small arm")
    words = input_words(robot, robot.q())
    assert words[robot.platform.inputs[0]].positive == "the platform drives forward"
    rate = Words("paddle runs", "paddle runs").phrase(-0.25, "rad/s")
    assert rate == "paddle runs at -0.25 rad/s"


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


#: What a joint does, whichever way it goes.
TURNS = {"turns"}
LIFTS = {"lifts", "lowers", "turns"}  # upright links turn
ELBOWS = {"opens", "closes", "bends", "unfolds"}
KINDS = {
    "Panda": ("joint", {"1 3 5 7": TURNS, "2": LIFTS, "4 6": ELBOWS}),
    "TIAGo": (
        "arm_",
        {"1_joint 3_joint 5_joint 7_joint": TURNS, "2_joint": LIFTS, "4_joint 6_joint": ELBOWS},
    ),
    "UR5": (
        "",
        {
            "shoulder_pan_joint wrist_2_joint wrist_3_joint": TURNS,
            "shoulder_lift_joint": LIFTS,
            "elbow_joint": ELBOWS,
        },
    ),
}


@pytest.mark.parametrize("arm", KINDS)
def test_rolls_turn_shoulders_lift_and_elbows_open(arm: str, tiago: Robot, rng: np.random.Generator) -> None:
    """The makers' own kinds of joints: what bends and what rolls does not depend on the posture."""
    robot = tiago if arm == "TIAGo" else built("unicycle", arm)
    lower, upper = np.clip(robot.q_limits, -3.0, 3.0).T
    for q in (robot.rest, *(rng.uniform(lower, upper) for _ in range(20))):
        words = input_words(robot, q)
        before, kinds = KINDS[arm]
        for endings, expected in kinds.items():
            for ending in endings.split():
                (name,) = [name for name in words if name.endswith(before + ending)]
                said = {text.removeprefix(f"{name} ").split()[0] for text in words[name]}
                assert said <= expected, (name, words[name])


def chain(folder: Path, *joints: tuple[str, str, str, str], end: str) -> Robot:
    """An arm on a fixed base from (name, type, origin, axis)."""
    links, before = ['<link name="base"/>'], "base"
    for name, kind, xyz, axis in joints:
        limits = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
        links.append(
            f'<link name="{name}_link"/><joint name="{name}" type="{kind}"><parent link="{before}"/>'
            f'<child link="{name}_link"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>{limits}</joint>'
        )
        before = f"{name}_link"
    links.append(
        f'<link name="ee"/><joint name="end" type="fixed"><parent link="{before}"/><child link="ee"/>'
        f'<origin xyz="{end}"/></joint>'
    )
    path = folder / "chain.urdf"
    path.write_text(f'<robot name="chain">{"".join(links)}</robot>')
    return load(path, platform="fixed")


@pytest.mark.parametrize("column", [0.0, 0.36])
@pytest.mark.parametrize("along", [0.0, 0.2, 0.42])
@pytest.mark.parametrize("further", [0.0, 0.1, 0.4])
def test_words_do_not_depend_on_where_a_file_puts_origins(
    column: float, along: float, further: float, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Seven joints, roll and bend in turn: an origin may be anywhere on its joint's axis."""
    robot = chain(
        tmp_path,
        ("a1", "revolute", f"0 0 {0.36 - column}", "0 0 1"),
        ("a2", "revolute", f"0 0 {column}", "0 1 0"),
        ("a3", "revolute", f"0 0 {along}", "0 0 1"),
        ("a4", "revolute", f"0 0 {0.42 - along}", "0 1 0"),
        ("a5", "revolute", f"0 0 {further}", "0 0 1"),
        ("a6", "revolute", f"0 0 {0.4 - further}", "0 1 0"),
        ("a7", "revolute", "0 0 0", "0 0 1"),
        end="0 0 0.15",
    )
    for q in rng.uniform(-2.0, 2.0, (10, 7)):
        words = input_words(robot, q)
        for name in ("a1", "a3", "a5", "a7"):
            assert words[name].positive.startswith(f"{name} turns")
        for name in ("a4", "a6"):  # bending either way from the straight arm
            assert words[name] == Words(
                *[f"{name} {word}" for word in ("closes", "opens")][:: 1 if q[int(name[1]) - 1] > 0 else -1]
            )
        elbow = [
            Configuration(robot, q + step * np.eye(7)[1]).placement("a4_link").translation[2]
            for step in (0.0, 1e-4)
        ]
        assert words["a2"].positive == ("a2 lifts" if elbow[1] > elbow[0] else "a2 lowers")


def test_words_of_a_scara(tmp_path: Path) -> None:
    robot = chain(
        tmp_path,
        ("j1", "revolute", "0 0 0.3", "0 0 1"),
        ("j2", "revolute", "0.4 0 0", "0 0 1"),
        ("quill", "prismatic", "0.3 0 0", "0 0 -1"),
        ("j4", "revolute", "0 0 0", "0 0 -1"),
        end="0 0 -0.1",
    )
    words = input_words(robot, robot.q({"j2": 0.5, "quill": 0.1}))
    assert words["j1"] == Words("j1 turns left", "j1 turns right")
    assert words["j2"] == Words("j2 closes", "j2 opens")
    assert words["j4"] == Words("j4 turns right", "j4 turns left")
    assert words["quill"].positive.split()[1] in ("extends", "slides")


def test_the_shoulder_of_the_papers_spatial_arm_lifts(robot_3r: Robot, rng: np.random.Generator) -> None:
    for q2 in rng.uniform(-3.0, 3.0, 10):
        q = robot_3r.q({"q1": 0.4, "q2": q2, "q3": 0.5})
        heights = [
            Configuration(robot_3r, one).placement("link3").translation[2]
            for one in (q, q + 1e-4 * np.eye(6)[robot_3r.coordinate("q2")])
        ]
        expected = "q2 lifts" if heights[1] > heights[0] else "q2 lowers"
        assert input_words(robot_3r, q)["q2"].positive == expected


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
                if f"{WHO}{phrase}" in text:
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
    assert f"slides {'left' if left > 0 else 'right'} at {abs(left):.2g} m/s" in text
    np.testing.assert_allclose(ahead, 0.0, atol=1e-12)  # what the wheels admit is not in it
    assert set(COORDINATES) <= set(coordinate_words(robot_2r, q))


def test_motions_in_words() -> None:
    words = {"v": INPUTS["v"], "a": Words("a opens", "a closes"), "b": Words("b turns", "b turns")}
    names, units = ("v", "a", "b"), ("m/s", "rad/s", "rad/s")

    def said(*rates: float) -> str:
        return motion_text(np.array(rates), names, units, words, 1)

    assert said(-0.31, 1, 0) == "the platform drives back at 0.31 m/s while a opens at 1 rad/s"
    assert said(0.31, -1, 0.5) == (
        "the platform drives forward at 0.31 m/s while a closes at 1 rad/s and b turns at +0.5 rad/s"
    )
    assert said(0, 1, -2) == "a opens at 1 rad/s while b turns at -2 rad/s"
    assert said(0, 0, 1) == "b turns at +1 rad/s alone"
    assert said(0, 0, 0) == "nothing moves"


def test_the_platform_is_named_once() -> None:
    names, units = ("v", "omega", "omega_left"), ("m/s", "rad/s", "rad/s")
    text = motion_text(np.array([1.0, -1.0, 1.0]), names, units, INPUTS, 3)
    assert text.startswith("the platform drives forward at 1 m/s, turns right at 1 rad/s and the left wheel ")
