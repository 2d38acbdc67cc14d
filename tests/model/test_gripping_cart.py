"""What a reader met with a robot of his own: a car with an arm and a gripper."""

from __future__ import annotations

import logging
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from findings import of_code, refused, the
from gripping_cart import ARM, FINGERS, cart, scenario
from small_pictures import draw_only
from urdf_parts import write

import nmm
from nmm.analysis.singular.ellipsoids import frame_of
from nmm.base.files import whole_file
from nmm.cli.exit_status import status_of
from nmm.cli.subjects import configuration_at
from nmm.model.robots.reach import first_tip, tips
from nmm.scenario.scaffold.end_effector import hands
from nmm.scenario.short_task import short_task
from nmm.views.folders import run as folders_run
from nmm.views.playback.channels import channels

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


def test_what_the_extended_jacobian_lacks_is_said_as_it_can_be_given(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The setting that the error names runs; a message of at most 300 characters has room for it."""
    path = scenario(tmp_path, "objective: {kind: posture, posture: {lift: 0.6}}")
    monkeypatch.chdir(tmp_path)
    given = ["run", path.name, "--resolver", "ej", "--out", "o"]
    assert status_of(given) == 2
    said = capsys.readouterr().err
    setting = said.split("--set '")[1].split("'")[0]
    assert status_of([*given, "--set", setting]) in (0, 1)


SRDF = """<robot name="cart"><group name="arm"><chain base_link="base_link" tip_link="palm"/></group>
<group_state name="home" group="arm"><joint name="lift" value="0.4"/><joint name="bend" value="1.2"/>
</group_state>
<group_state name="far" group="arm"><joint name="lift" value="2.5"/></group_state></robot>"""


@pytest.fixture(autouse=True)
def _pictures_are_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    draw_only([], monkeypatch)


@pytest.fixture
def known(tmp_path: Path) -> Path:
    """A cart with postures."""
    write(tmp_path / "cart.srdf", SRDF)
    return cart(tmp_path / "cart.urdf")


def test_a_posture_is_a_place_to_look_at(known: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = nmm.load(known)
    q = configuration_at(robot, robot.rest, ["posture=home", "bend=0.5"], {})
    assert [q[robot.coordinate(name)] for name in ("lift", "bend")] == [0.4, 0.5]
    for command in ("singularities", "redundancy"):
        assert status_of([command, str(known), "--task", "position", "--at", "posture=home"]) == 0
        posture = capsys.readouterr().out
        by_name = ["--at", "lift=0.4", "--at", "bend=1.2"]
        assert status_of([command, str(known), "--task", "position", *by_name]) == 0
        assert capsys.readouterr().out == posture
    assert status_of(["singularities", str(known), "--task", "position", "--at", "posture=hom"]) == 2
    assert "unknown posture 'hom' (did you mean 'home'?)" in capsys.readouterr().err


def test_postures_beyond_limits_are_told(known: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = "posture far is outside limits: lift = 2.5 (from -1.8 to 1.8)"
    assert status_of(["info", str(known)]) == 0
    out = capsys.readouterr().out
    assert f"note: SRDF cart.srdf: {said}" in out
    assert "posture home is outside" not in out
    assert status_of(["check", str(known)]) == 0
    out = capsys.readouterr().out
    assert f"warning: SRDF cart.srdf: {said}" in out
    assert "cart.srdf: 2 postures" in out


def test_what_steers_is_no_wheel_in_the_notes(known: Path) -> None:
    (wheels,) = of_code(nmm.load(known).notes, "wheels_left_out")
    (steer,) = of_code(nmm.load(known).notes, "swivels_left_out")
    steering = ["front_left_steer_joint", "front_right_steer_joint"]
    assert not {*steering} & {*wheels.values["names"]}
    assert steer.values["names"] == steering


def test_an_axle_that_is_neither_point_nor_frame(known: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(["info", str(known), "--axle", "1;2"]) == 2
    expected = "--axle: expected a frame, or X,Y[,Z[,YAW]] in m and rad with commas between, got '1;2'"
    assert expected in capsys.readouterr().err


def test_check_takes_the_axle_that_it_advises(known: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As info takes it; in brackets, as the advice writes it, too."""
    for given in ("0,0", "(0, 0)"):
        assert status_of(["check", str(known), "--axle", given]) == 0
        assert status_of(["info", str(known), "--axle", given]) == 0
    assert status_of(["check", str(known), "--axle", "nowhere"]) == 2
    assert "nowhere" in "".join(capsys.readouterr())


def test_a_task_without_a_frame_takes_the_longest_arm() -> None:
    """Not the head's end; arms of one length are named."""
    tiago = "package://example-robot-data/robots/tiago_description/robots/tiago_no_hand.urdf"
    with_head = nmm.load(tiago)
    assert len(tips(with_head)) > 1
    (row, *_) = short_task("position", with_head).rows(with_head)
    frame = with_head.model.frames[with_head.frame_id(row.name.partition(".")[0])]
    assert with_head.model.names[frame.parentJoint] == "arm_7_joint"
    two = nmm.Scenario.load("two_arms_box").robot()
    with refused("task position", available=tips(two)) as caught:
        short_task("position", two)
    assert all(f"{tip} (6 joints)" in caught.value.what for tip in tips(two))


def test_a_missed_target_names_the_limits_that_bind(tmp_path: Path) -> None:
    run = nmm.Scenario.load(scenario(tmp_path, "limits: {velocity: {v: 0.1}}", speed=1.5, duration=5.0)).run()
    assert run.outcome == "missed"
    relaxed = run.scale[:, 0] < 1.0
    share = np.mean(run.u[relaxed, 0] >= 0.1 - 1e-9)
    assert share > 0.5
    assert the(run, "limits_binding").values["limits"]["u_v"] == pytest.approx(share)


def test_driven_fingers_without_a_velocity_limit_are_told(tmp_path: Path) -> None:
    source = cart(tmp_path / "cart.urdf")
    source.write_text(source.read_text().replace('upper="0.04" velocity="0.1"', 'upper="0.04" velocity="0"'))
    robot = nmm.load(source)
    task = [
        nmm.Task(nmm.Position("grasp", "x"), nmm.Constant([1.3])),
        nmm.Task(nmm.LinearCoordinates(FINGERS[0]), nmm.Constant([0.02])),
    ]
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(1.0), limits=nmm.Limits(), dt=0.01)
    run = nmm.simulate(controller, {"lift": 0.6, "bend": 0.9}, 0.2, 0.01)
    assert FINGERS[0] in run.summary()["without_velocity_limit"]
    assert FINGERS[1] not in run.summary()["without_velocity_limit"]  # it never moves


def test_the_angle_of_no_joint_is_told_where_layouts_meet(known: Path) -> None:
    own = pin.buildModelFromUrdf(str(known), pin.JointModelPlanar())
    with pytest.raises(
        nmm.InputError, match="no joint steer: steer is nmm's own, and front_left_steer_joint"
    ):
        nmm.PinocchioLayout(nmm.load(known), own)


def test_a_page_leaves_nothing_of_a_writer_that_was_killed(tmp_path: Path) -> None:
    page, other = tmp_path / "page.html", tmp_path / ".page.html-abcdefgh-notes"
    other.write_text("mine")
    code = (
        "import os, signal, sys; from pathlib import Path; from nmm.base.files import whole_file\n"
        "with whole_file(Path(sys.argv[1])) as file:\n"
        "    file.write_text('half'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    for _ in range(2):
        subprocess.run([sys.executable, "-c", code, str(page)], check=False)
    assert (tmp_path / ".page.html.nmm-writing").exists()
    with whole_file(page) as living:
        living.write_text("whole")
    assert page.read_text() == "whole"
    assert {*tmp_path.iterdir()} == {page, other}


def test_a_long_run_says_that_it_is_being_written(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run()
    monkeypatch.setattr(folders_run, "MANY", len(run) - 1)
    with caplog.at_level(logging.INFO, "nmm"):
        run.save(tmp_path / "o", figures=False)
    assert caplog.messages == [f"writing {len(run)} samples to {tmp_path / 'o'}"]
    lines = (tmp_path / "o" / "trajectory.csv").read_text().splitlines()
    header, rows = lines[0].split(","), [line.split(",") for line in lines[1:]]
    np.testing.assert_array_equal(np.array([row[: run.robot.n + 1] for row in rows], float)[:, 1:], run.q)
    assert all(row[header.index("partition_0")].lstrip("-").isdigit() for row in rows)
