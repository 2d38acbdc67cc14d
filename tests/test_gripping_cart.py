"""What a reader met with a robot of his own: a car with an arm and a gripper."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gripping_cart import ARM, FINGERS, cart, scenario

import nmm
from nmm.analysis.singular.ellipsoids import frame_of
from nmm.cli.exit_status import status_of
from nmm.drafts.hand import hands
from nmm.playback.channels import channels
from nmm.robots.loading.tips import first_tip, tips
from nmm.scenario.short_task import short_task

POSTURE = "objective: {kind: posture, posture: {lift: 0.6, left_finger_joint: 0.01}}"


@pytest.mark.parametrize(
    ("more", "start", "key"),
    [
        (POSTURE, "", "objective"),
        ("limits: {position: {left_finger_joint: [0, 0.02]}}", "", "limits"),
        ("limits: {velocity: {left_finger_joint: 0.02}}", "", "limits"),
        ("", ", left_finger_joint: 0.02", "q0.left_finger_joint"),
    ],
)
def test_a_locked_joint_that_a_scenario_names_is_told_as_locked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: str, start: str, key: str
) -> None:
    path = scenario(tmp_path, more, start=start)
    assert status_of(["run", str(path), "--out", str(tmp_path / "free")]) == 0
    capsys.readouterr()
    assert status_of(["run", str(path), "--lock", "*finger*=0", "--out", str(tmp_path / "o")]) == 2
    said = capsys.readouterr().err
    assert "left_finger_joint is locked at 0 (by lock, or --lock)" in said
    assert "leave it out here, or do not lock it" in said
    assert f": {key}" in said
    assert not (tmp_path / "o").exists()


def test_a_start_may_name_a_locked_joint_where_it_is_locked(tmp_path: Path) -> None:
    path = scenario(tmp_path, start=", left_finger_joint: 0.02, right_finger_joint: 0.02")
    run = nmm.Scenario.load(path, {"robot.lock": "{'*finger*': 0.02}"}).run()
    assert run.outcome == "completed"
    assert not {*FINGERS} & {*run.robot.q_names}


def test_a_follower_of_a_locked_joint_is_told_as_locked(tmp_path: Path) -> None:
    robot = nmm.load(cart(tmp_path / "cart.urdf", mimic=True), lock={FINGERS[0]: 0.03})
    assert robot.locked == dict.fromkeys(FINGERS, 0.03)
    with pytest.raises(nmm.InputError, match=r"right_finger_joint is locked at 0\.03"):
        robot.coordinate(FINGERS[1])


@pytest.mark.parametrize("mimic", [False, True])
def test_fingers_are_no_ends_of_an_arm(tmp_path: Path, mimic: bool) -> None:
    robot = nmm.load(cart(tmp_path / "cart.urdf", mimic=mimic))
    assert tips(robot) == ("grasp",)
    assert first_tip(robot) == frame_of(robot, None) == hands(robot)[0].frame == "grasp"
    assert short_task("position", robot).frame == "grasp"


def test_a_gripper_that_stays_closed_hides_no_margin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is told apart; what moves has its margin, and its name."""
    path = scenario(tmp_path, "limits: {velocity: false}")
    assert status_of(["run", str(path), "--out", str(tmp_path / "o")]) == 0
    lines = [line.split("  ", 1) for line in capsys.readouterr().out.splitlines() if "  " in line]
    said = {label: value.strip() for label, value in lines}
    run = nmm.Trajectory.load(tmp_path / "o")
    q, moving = run.robot.q_limits, [run.robot.coordinate(name) for name in ("steer", *ARM[:4])]
    room = np.minimum(run.q - q[:, 0], q[:, 1] - run.q)[:, moving] / (q[:, 1] - q[:, 0])[moving]
    np.testing.assert_allclose(run.margin, room.min(axis=1), atol=1e-12)
    least = ("steer", *ARM[:4])[int(room.min(axis=0).argmin())]
    assert room.min() > 0.0
    assert said["least margin to a limit"] == f"{100 * room.min():.3g} % of its range ({least})"
    assert said["at a limit throughout"] == f"{', '.join(FINGERS)}; not counted above"
    summary = run.summary()
    assert summary["margin_of"] == least
    assert summary["standing_at_limits"] == [*FINGERS]


def test_an_input_at_its_limit_all_along_counts(tmp_path: Path) -> None:
    """Only coordinates can stand still: an input that never leaves its limit binds."""
    path = scenario(tmp_path, "limits: {position: false, velocity: {v: 0.05}}", speed=2.0)
    run = nmm.Scenario.load(path).run()
    assert np.ptp(run.u[5:, 0]) < 1e-12
    assert np.abs(run.margin[5:]).max() < 1e-12
    assert run.summary()["margin_of"] == "u_v"


def test_rounding_is_no_margin_in_plots() -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1, "limits": True}).run()
    noisy = replace(run, margin=np.linspace(-6e-10, 1e-16, len(run)))
    (margin,) = [one for one in channels(noisy).channels if one.name == "margin"]
    np.testing.assert_array_equal(margin.values, 0.0)
