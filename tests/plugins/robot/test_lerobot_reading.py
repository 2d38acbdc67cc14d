"""Data sets of LeRobot's read back: nmm's own, LeKiwi's columns, units that nobody states."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gripping import folding
from places import ROOT
from planar_arms import planar_arm

pytest.importorskip("pyarrow")
from lerobot_sets import LEKIWI, lerobot_set, moved
from urdf_parts import vehicle, write

import nmm
from nmm.base.errors import InputError

#: As LeRobot 0.6 writes LeKiwi's columns, and as 0.4 and 0.5 do.
DEGREES = {"x.vel": "m/s", "y.vel": "m/s", "theta.vel": "deg/s", "*.pos": "deg", "arm_gripper.pos": "0..100"}
SHARES = DEGREES | {"*.pos": "-100..100"}
GRIPPER = {"arm_gripper": (0.0, 1.5)}


@pytest.fixture(scope="module")
def lekiwi() -> nmm.Robot:
    return nmm.load(ROOT / "docs" / "tutorials" / "lekiwi.urdf.xacro")


def states(count: int = 21) -> np.ndarray:
    """A quarter of a circle of 0.5 m to the left, in 2 s at 10 frames a second, while the arm lifts."""
    rows = np.zeros((count, len(LEKIWI)))
    rows[:, LEKIWI.index("x.vel")] = 0.5 * np.pi / 4
    rows[:, LEKIWI.index("theta.vel")] = 45.0
    rows[:, LEKIWI.index("arm_shoulder_lift.pos")] = np.linspace(-30, 60, count)
    rows[:, LEKIWI.index("arm_gripper.pos")] = 50.0
    return rows


@pytest.mark.parametrize("name", ["unicycle_2r", "car_base", "trailer_base", "omni_base", "fixed", "folding"])
def test_what_nmm_writes_is_read_as_it_was(name: str, tmp_path: Path) -> None:
    if name == "fixed":
        robot = planar_arm(tmp_path, 0.5, 0.4)
    else:
        robot = folding() if name == "folding" else nmm.load(name)
    run = moved(robot)
    place = nmm.write_lerobot([run, run], tmp_path / "set", task="move", fps=20)
    for episode in nmm.read_lerobot(place, robot):
        assert np.abs(episode.t - run.t).max() < 1e-12
        assert np.abs(episode.q - run.q).max() < 1e-6
        assert np.abs(episode.u - run.u).max() < 1e-6
        assert np.abs(episode.q_dot - run.q_dot).max() < 1e-5
        assert episode.complete
        assert not episode.warnings
    saved = nmm.read_lerobot(place, robot, episodes=[1])[0].save(tmp_path / "run", figures=False)
    assert np.abs(nmm.Trajectory.load(saved, robot).q - run.q).max() < 1e-6


def test_actions_are_inputs_only_where_nmm_wrote_all_episodes(tmp_path: Path) -> None:
    """A data set that LeRobot went on with: nmm says of it what it was before."""
    robot = planar_arm(tmp_path, 0.5, 0.4)
    run = moved(robot)
    one = nmm.write_lerobot(run, tmp_path / "one", task="move", fps=20)
    two = nmm.write_lerobot([run, run], tmp_path / "two", task="move", fps=20)
    assert all(np.abs(each.u - run.u).max() < 1e-6 for each in nmm.read_lerobot(two, robot))
    shutil.copy(one / "meta" / "nmm.json", two / "meta" / "nmm.json")
    for each in nmm.read_lerobot(two, robot):
        assert each.u == pytest.approx(np.gradient(run.q, 0.05, axis=0), abs=1e-4)


def test_lekiwis_base_turns_by_degrees_and_its_arm_by_what_is_asked(
    lekiwi: nmm.Robot, tmp_path: Path
) -> None:
    place = lerobot_set(tmp_path / "set", [states()])
    (read,) = nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER, frame="tip")
    assert read.t[-1] == pytest.approx(2.0)
    assert read.q[-1, :3] == pytest.approx([0.5, 0.5, np.pi / 2], abs=1e-6)
    assert read.u[:, :3] == pytest.approx(np.tile([0.5 * np.pi / 4, 0.0, np.pi / 4], (21, 1)), abs=1e-6)
    lift, gripper = (lekiwi.q_names.index(f"arm_{name}") for name in ("shoulder_lift", "gripper"))
    assert read.q[:, lift] == pytest.approx(np.linspace(-np.pi / 6, np.pi / 3, 21), abs=1e-6)
    assert read.u[:, lift] == pytest.approx(np.pi / 4, abs=1e-5)
    assert read.q[:, gripper] == pytest.approx(0.75)
    assert read.path.shape == (21, 3)
    (moved,) = nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER, start=(1, 2, np.pi / 2))
    assert moved.q[-1, :3] == pytest.approx([0.5, 2.5, np.pi], abs=1e-6)


def test_shares_of_a_range_are_what_a_calibration_makes_of_them(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    """The same servo positions, written as 0.4 and as 0.6 do, are the same angles."""
    calibration = {
        name.removesuffix(".pos"): {
            "id": k, "drive_mode": 0, "homing_offset": 7, "range_min": 700 + k, "range_max": 3300 - 50 * k,
        }
        for k, name in enumerate(LEKIWI[:6])
    }  # fmt: skip
    file = tmp_path / "calibration.json"
    file.write_text(json.dumps(calibration))
    rng, shares, degrees = np.random.default_rng(0), states(), states()
    for k, motor in enumerate(calibration.values()):
        steps = rng.integers(motor["range_min"], motor["range_max"], len(shares))
        middle, span = (motor["range_min"] + motor["range_max"]) / 2, motor["range_max"] - motor["range_min"]
        degrees[:, k] = (steps - middle) * 360 / 4095
        shares[:, k] = (steps - motor["range_min"]) / span * 200 - 100
    degrees[:, 5] = shares[:, 5] = shares[:, 5] / 2 + 50  # the gripper is in 0..100 in every version
    gripper: dict[str, Any] = {"ranges": GRIPPER}
    a, b = lerobot_set(tmp_path / "a", [shares]), lerobot_set(tmp_path / "b", [degrees])
    (old,) = nmm.read_lerobot(a, lekiwi, units=SHARES, calibration=file, **gripper)
    (new,) = nmm.read_lerobot(b, lekiwi, units=DEGREES, calibration=str(file), **gripper)
    assert np.abs(old.q - new.q).max() < 1e-5
    assert old.q[:, 8] == pytest.approx(1.5 * shares[:, 5] / 100, abs=1e-5)
    with pytest.warns(RuntimeWarning, match="arm_gripper is outside its limits"):  # 0 is in its middle, too
        (centred,) = nmm.read_lerobot(b, lekiwi, units=DEGREES, calibration=file)
    half = (calibration["arm_gripper"]["range_max"] - calibration["arm_gripper"]["range_min"]) * np.pi / 4095
    assert centred.q[:, 8] == pytest.approx((shares[:, 5] / 50 - 1) * half, abs=1e-5)
    for motor in calibration.values():  # turned around: the same shares are the other end
        motor["drive_mode"] = 1
    file.write_text(json.dumps(calibration))
    (turned,) = nmm.read_lerobot(a, lekiwi, units=SHARES, calibration=file, **gripper)
    assert np.abs(turned.q[:, 3:8] + old.q[:, 3:8]).max() < 1e-5


def test_what_an_encoder_reads_is_corrected_and_a_coordinate_is_not(tmp_path: Path) -> None:
    """A steering whose axis points down and that stands askew, an arm's joint that is geared the other way
    round; a data set of a recorder and one of nmm's."""
    nominal = nmm.load(write(tmp_path / "down.urdf", vehicle("steering", 0.7, up=False)))
    askew = {"offset.steering": 0.1, "ratio.steering": 1.25, "offset.q1": -0.05, "ratio.q1": -1.0}
    robot = nmm.with_numbers(nominal, askew)
    i, arm = (robot.q_names.index(name) for name in ("steering", "q1"))
    run = moved(robot)
    names = [f"{name}.pos" for name in robot.q_names]
    recorded = run.q.copy()
    recorded[:, i] = [robot.reading("steering", angle) for angle in run.q[:, i].tolist()]
    assert np.abs(recorded[:, i] - (run.q[:, i] - 0.1) / -1.25).max() < 1e-12
    recorded[:, arm] = -0.05 - run.q[:, arm]
    place = lerobot_set(tmp_path / "recorded", [recorded], names=names, fps=20)
    units = {"?.pos": "m", "theta.pos": "rad", "steering.pos": "rad", "q1.pos": "rad"}
    (read,) = nmm.read_lerobot(place, robot, units=units)
    assert np.abs(read.q - run.q).max() < 1e-6
    motor = {"range_min": 0, "range_max": 4095}
    (tmp_path / "calibration.json").write_text(json.dumps({"steering": motor}))
    for kind, shares in (
        ("calibration", recorded[:, i] / np.pi * 100),
        ("ranges", run.q[:, i] / 0.5 * 100),  # ends of the coordinate
    ):
        rows = recorded.copy()
        rows[:, i] = shares
        given: Any = tmp_path / "calibration.json" if kind == "calibration" else {"steering": (-0.5, 0.5)}
        place = lerobot_set(tmp_path / kind, [rows], names=names, fps=20)
        (read,) = nmm.read_lerobot(place, robot, units=units | {"steering.pos": "-100..100"}, **{kind: given})
        assert np.abs(read.q - run.q).max() < 1e-6
    lower, upper = nominal.q_limits[arm]  # which its encoder has, too
    rows = recorded.copy()
    rows[:, arm] = 200 * (recorded[:, arm] - lower) / (upper - lower) - 100
    place = lerobot_set(tmp_path / "limits", [rows], names=names, fps=20)
    shares = units | {"q1.pos": "-100..100"}
    (read,) = nmm.read_lerobot(place, robot, units=shares, ranges={"q1": "limits"})
    assert np.abs(read.q - run.q).max() < 1e-6
    written = nmm.write_lerobot(run, tmp_path / "written", task="steer", fps=20)
    (written / "meta" / "nmm.json").unlink()  # as LeRobot's tools do
    (read,) = nmm.read_lerobot(written, robot)
    assert np.abs(read.q - run.q).max() < 1e-6


def test_ranges_are_given_or_the_robots_limits_when_asked(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    rows = states()
    rows[:, :5], rows[:, 5] = 100.0, 0.0
    place = lerobot_set(tmp_path / "set", [rows])
    (read,) = nmm.read_lerobot(place, lekiwi, units=SHARES, ranges="limits")
    assert read.q[0, 3:8] == pytest.approx(lekiwi.q_limits[3:8, 1])
    assert read.q[0, 8] == pytest.approx(lekiwi.q_limits[8, 0])
    own = {f"{name}.pos": (-0.5, 0.7) for name in lekiwi.q_names[3:]}  # by column
    (read,) = nmm.read_lerobot(place, lekiwi, units=SHARES, ranges=own)
    assert read.q[0, 3:] == pytest.approx([0.7] * 5 + [-0.5])
    for ranges in ({**dict.fromkeys(lekiwi.q_names[3:8], (-1, 1)), "arm_gripper": "limits"},):
        (read,) = nmm.read_lerobot(place, lekiwi, units=SHARES, ranges=ranges)
        assert read.q[0, 3:] == pytest.approx([1.0] * 5 + [lekiwi.q_limits[8, 0]])
    with pytest.raises(InputError, match="ranges: arm_gripper: expected two ends, or 'limits', got 'open'"):
        nmm.read_lerobot(place, lekiwi, units=SHARES, ranges={"arm_gripper": "open"})
    with pytest.raises(InputError, match="where that ends is not known; expected ranges="):
        nmm.read_lerobot(place, lekiwi, units=SHARES)
    with pytest.raises(InputError, match=r"ranges: arm_gripper: expected two ends that differ"):
        nmm.read_lerobot(place, lekiwi, units=SHARES, ranges={"arm_gripper": (1, 1)})


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "not valid JSON"),
        ("[]", "expected"),
        ('{"arm_gripper": {"range_min": 5}}', "arm_gripper.range_max"),
        (
            '{"arm_gripper": {"range_min": 5, "range_max": 5}}',
            "arm_gripper: range_max: expected more than range_min",
        ),
        ('{"arm_gripper": {"range_min": 0, "range_max": 1e9}}', "arm_gripper"),
        (None, "this file is missing"),
    ],
)
def test_a_damaged_calibration_is_named(
    content: str | None, said: str, lekiwi: nmm.Robot, tmp_path: Path
) -> None:
    file = tmp_path / "calibration.json"
    if content is not None:
        file.write_text(content)
    place = lerobot_set(tmp_path / "set", [states()])
    with pytest.raises(InputError, match=said) as caught:
        nmm.read_lerobot(place, lekiwi, units=SHARES, calibration=file)
    assert "calibration.json" in str(caught.value)


def test_units_are_never_guessed(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    place = lerobot_set(tmp_path / "set", [states()])
    with pytest.raises(InputError) as caught:
        nmm.read_lerobot(place, lekiwi)
    said = str(caught.value)
    assert (
        "info.json: features.observation.state: no unit is stated of arm_shoulder_pan.pos and 8 more" in said
    )
    assert "'*.pos': 'deg|rad|-100..100'" in said
    assert "'theta.vel': 'deg/s|rad/s'" in said
    assert len(said) <= 300
    without = {name: unit for name, unit in DEGREES.items() if name != "theta.vel"}
    with pytest.raises(
        InputError,
        match=r"no unit is stated of theta.vel, and .* expected units={'theta.vel': 'deg/s\\|rad/s'}",
    ):
        nmm.read_lerobot(place, lekiwi, units=without, ranges=GRIPPER)


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ({"theta.vel": "deg"}, "units: theta.vel: unknown unit 'deg' .*; available: rad/s, deg/s"),
        ({"x.vel": "deg/s"}, "units: x.vel: unknown unit 'deg/s'; available: m/s, mm/s"),
        ({"x.vel": "-100..100"}, "units: x.vel: unknown unit '-100..100'"),
        ({"arm_wrist_roll.pos": "percent"}, "unknown unit 'percent'; available: rad, deg, -100..100, 0..100"),
        ({"phi.vel": "deg/s"}, "units: phi.vel: no column; available: .*theta.vel"),
        ({"phi.*": "deg/s"}, "units: phi.*: no column"),
        ({"x.vel": 1.0}, "units: x.vel: expected names and units as text"),
    ],
)
def test_units_that_cannot_be_are_refused(
    units: dict[str, Any], said: str, lekiwi: nmm.Robot, tmp_path: Path
) -> None:
    place = lerobot_set(tmp_path / "set", [states()])
    with pytest.raises(InputError, match=said):
        nmm.read_lerobot(place, lekiwi, units=DEGREES | units, ranges=GRIPPER)


@pytest.mark.parametrize("units", ["deg", 5, ["x.vel", "m/s"]])
def test_units_are_said_by_column(units: Any, lekiwi: nmm.Robot, tmp_path: Path) -> None:
    place = lerobot_set(tmp_path / "set", [states()])
    with pytest.raises(InputError, match=r"^units: expected units by column or pattern, got"):
        nmm.read_lerobot(place, lekiwi, units=units)


def test_what_a_data_set_states_is_not_overruled(tmp_path: Path) -> None:
    run = moved(nmm.load("unicycle_2r"))
    place = nmm.write_lerobot(run, tmp_path / "set", task="move", fps=20)
    nmm.read_lerobot(place, run.robot, units={"q*.pos": "rad"})
    with pytest.raises(InputError, match=r"units: q1.pos: expected 'rad', as the data set states, got 'deg'"):
        nmm.read_lerobot(place, run.robot, units={"q*.pos": "deg"})


def test_velocities_that_wheels_cannot_make_are_doubted(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    place = lerobot_set(tmp_path / "set", [states()])
    with pytest.warns(RuntimeWarning, match="ask wheels for .* times their limits: another unit"):
        nmm.read_lerobot(place, lekiwi, units=DEGREES | {"theta.vel": "rad/s"}, ranges=GRIPPER)
    rows = np.tile([0.1, 0.2, 0.0], (30, 1))
    other = lerobot_set(tmp_path / "other", [rows.astype(np.float32)], names=["x.vel", "y.vel", "theta.vel"])
    units = {"?.vel": "m/s", "theta.vel": "rad/s"}
    with pytest.warns(RuntimeWarning, match="89% of a velocity is one that .* cannot have: another robot's"):
        nmm.read_lerobot(other, nmm.load("differential_base"), units=units)


def test_actions_are_what_was_asked_not_what_wheels_did(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    """LeKiwi scales its wheels' speeds down to what they can, and records what it was told."""
    asked = states()
    asked[:, LEKIWI.index("x.vel")] *= 1.75
    place = lerobot_set(tmp_path / "set", [states()], [asked])
    with pytest.warns(RuntimeWarning, match="set: episode 0: actions ask for up to 1.75 times the velocity"):
        (read,) = nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER)
    assert [finding.code for finding in read.findings] == ["actions_beyond"]
    assert read.findings[0].values["times"] == pytest.approx(1.75)
    assert read.q[-1, :3] == pytest.approx([0.5, 0.5, np.pi / 2], abs=1e-6)
    assert read.u[0, 0] == pytest.approx(0.5 * np.pi / 4)


def test_joints_far_outside_their_limits_are_doubted(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    place = lerobot_set(tmp_path / "set", [states()])
    with pytest.warns(
        RuntimeWarning, match="arm_shoulder_lift is outside its limits by up to 58.3: another unit"
    ):
        (read,) = nmm.read_lerobot(
            place, lekiwi, units=DEGREES | {"*.pos": "rad", "arm_gripper.pos": "0..100"}, ranges=GRIPPER
        )
    assert read.findings[0].code == "joints_outside"


def test_a_fixed_base_has_no_twist(tmp_path: Path) -> None:
    arm = planar_arm(tmp_path, 0.5, 0.4, limited=True)
    names = ("q1.pos", "q2.pos", "x.vel", "y.vel", "theta.vel")
    rows = np.random.default_rng(0).uniform(-1, 1, (15, 5))
    rows[:, 2:] = np.nan  # which nobody reads
    place = lerobot_set(tmp_path / "set", [rows], names=names)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (read,) = nmm.read_lerobot(place, arm, units={"*.pos": "deg"})
    assert read.q == pytest.approx(np.radians(rows[:, :2]), abs=1e-7)
    assert read.u == pytest.approx(np.gradient(read.q, 0.1, axis=0))
    assert read.u.shape == (15, 2)


def test_columns_may_be_called_otherwise_and_stand_in_any_order(tmp_path: Path) -> None:
    robot = nmm.load("unicycle_2r")
    names = ("elbow", "turn", "ahead", "q1", "aside")
    rows = np.tile([10.0, 0.5, 0.2, 20.0, 0.0], (12, 1))
    place = lerobot_set(tmp_path / "set", [rows], names=names)
    columns = {"q2": "elbow", "vx": "ahead", "vy": "aside", "omega": "turn"}
    units = {"elbow": "deg", "q1": "deg", "turn": "rad/s", "a*": "m/s"}
    (read,) = nmm.read_lerobot(place, robot, units=units, columns=columns)
    assert read.q[-1] == pytest.approx(
        [0.4 * np.sin(0.55), 0.4 * (1 - np.cos(0.55)), 0.55, np.radians(20), np.radians(10)], abs=1e-6
    )
    assert read.u[0] == pytest.approx([0.2, 0.5, 0, 0], abs=1e-7)
    for wrong, said in (
        ({"q2": "wrist"}, "columns: q2: unknown column 'wrist'; available: elbow"),
        ({"q7": "elbow"}, "columns: unknown coordinate 'q7'"),
        ({}, r"nothing says where q2 of unicycle_2r is; expected a column q2.pos, or columns="),
        ({"q2": "elbow"}, "nothing says where the platform of unicycle_2r is, nor how it moved"),
        (columns | {"x": "ahead"}, "columns: x: expected a column of y and theta, too; available: elbow"),
        ("q2", "columns: expected columns by coordinate, got 'q2'"),
        (["q2", "elbow"], "columns: expected columns by coordinate"),
    ):
        with pytest.raises(InputError, match=said):
            nmm.read_lerobot(place, robot, units=units, columns=wrong)


def test_angles_within_a_turn_are_counted_on(tmp_path: Path) -> None:
    arm = planar_arm(tmp_path, 0.5)
    angles = np.linspace(0, 900, 40)
    rows = ((angles + 180) % 360 - 180)[:, np.newaxis]
    place = lerobot_set(tmp_path / "set", [rows], names=("q1.pos",))
    (read,) = nmm.read_lerobot(place, arm, units={"q1.pos": "deg"})
    assert read.q[:, 0] == pytest.approx(np.radians(angles), abs=1e-5)


def test_an_episode_of_one_frame_stands_still(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    place = lerobot_set(tmp_path / "set", [states(1), states(2)])
    one, two = nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER)
    assert (len(one), len(two)) == (1, 2)
    assert one.q[0, :3] == pytest.approx([0, 0, 0])
    assert one.u[0, :3] == pytest.approx([0.5 * np.pi / 4, 0, np.pi / 4])
    assert not one.u[0, 3:].any()
    assert two.t == pytest.approx([0, 0.1])
    arm = planar_arm(tmp_path, 0.5)
    (still,) = nmm.read_lerobot(
        lerobot_set(tmp_path / "arm", [np.array([[30.0]])], names=("q1.pos",)), arm, units={"q1.pos": "deg"}
    )
    assert still.u.tolist() == [[0.0]]


def test_a_number_that_is_none_is_named(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    rows = states()
    rows[7:9, LEKIWI.index("theta.vel")] = np.nan
    place = lerobot_set(tmp_path / "set", [states(), rows])
    nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER, episodes=0)
    with pytest.raises(
        InputError, match=r"set: episode 1: theta.vel is no finite number in 2 of 21 frames, first in frame 7"
    ):
        nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER)


def test_episodes_are_asked_for_by_number(lekiwi: nmm.Robot, tmp_path: Path) -> None:
    place = lerobot_set(tmp_path / "set", [states(k) for k in (5, 9, 13)])
    read = nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER, episodes=[2, 0])
    assert [(one.label, len(one)) for one in read] == [("episode 2", 13), ("episode 0", 5)]
    with pytest.raises(InputError, match=r"episodes: unknown episode 3; available: 0, 1, 2"):
        nmm.read_lerobot(place, lekiwi, units=DEGREES, ranges=GRIPPER, episodes=3)
