"""Joints locked by patterns, wheels and meshes by options, in Python, scenarios and on the command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from ackermann_car import car
from findings import refused
from gripping import FINGERS, panda
from places import PANDA
from urdf_parts import joint, link, robot, shape, write

import nmm
from nmm.cli.exit_status import status_of

HAND = [
    link("base"),
    *(part for i in (1, 2, 3) for part in (joint(f"finger_{i}", "base", f"tip_{i}"), link(f"tip_{i}"))),
    *(joint("elbow", "base", "upper"), link("upper")),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write(tmp_path / "hand.urdf", robot(*HAND))


@pytest.mark.parametrize(
    ("lock", "left"),
    [
        ({"*finger*": 0}, ("elbow",)),
        ({"finger_?": 0.3}, ("elbow",)),
        ({"finger_?": 0.3, "finger_2": -0.5}, ("elbow",)),
        ({"finger_2": -0.5, "finger_?": 0.3}, ("elbow",)),
        ({"*": 0}, ()),
    ],
)
def test_a_pattern_locks_all_that_match(path: Path, lock: dict[str, float], left: tuple[str, ...]) -> None:
    loaded = nmm.load(path, platform="fixed", lock=lock)
    assert loaded.q_names == left
    held = loaded.parts.provenance.locked
    for i in (1, 2, 3):
        pattern = next(value for key, value in lock.items() if "*" in key or "?" in key)
        assert held[f"finger_{i}"] == lock.get(f"finger_{i}", pattern)


def test_what_follows_a_locked_joint_goes_with_it() -> None:
    """The second finger follows the first: the pattern's value is the leader's alone."""
    robot = nmm.load(PANDA, platform="fixed", lock={"*finger*": 0.02})
    assert robot.parts.provenance.locked == {"panda_finger_joint1": 0.02}
    assert robot.parts.provenance.mimicked == {"panda_finger_joint2": ("panda_finger_joint1", 0.02)}
    assert robot.n == panda().n - len(FINGERS)


@pytest.mark.parametrize(
    ("lock", "where", "got"),
    [
        ({"*thumb*": 0}, "lock", "*thumb*"),
        ({"*finger*": 2.0}, "lock: finger_1", 2.0),
        ({"x*": 0}, "lock", "x*"),
        ({"finger.*": 0}, "lock", "finger.*"),
        ({"*finger*": "a"}, "lock: finger_1", "a"),
    ],
)
def test_patterns_that_cannot_be_locked(path: Path, lock: dict[str, float], where: str, got: object) -> None:
    with refused(where, kind=nmm.RobotError, got=got) as caught:
        nmm.load(path, lock=lock)
    if where == "lock":
        assert {*caught.value.available} == {"elbow", "finger_1", "finger_2", "finger_3"}


def test_the_platforms_own_joints_are_not_meant() -> None:
    robot = nmm.load("car_base", platform=nmm.model.platforms.Car(0.7), lock={"*steer*": 0.0})
    assert robot.q_names == ("x", "y", "theta", "steering")


SCENARIO = """
robot: {{source: {source}, platform: unicycle{more}}}
q0: {{elbow: 0.5}}
duration: 0.1
task: {{kind: position, frame: upper, axes: xy, reference: {{kind: constant, value: [1, 1]}}}}
resolver: {{kind: pg}}
"""


def test_locked_by_pattern_in_a_scenario_and_on_the_command_line(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = write(tmp_path / "s.yaml", SCENARIO.format(source=path, more=", lock: {'*finger*': 0.1}"))
    assert nmm.Scenario.load(scenario).robot().q_names == ("x", "y", "theta", "elbow")
    plain = write(tmp_path / "plain.yaml", SCENARIO.format(source=path, more=", lock: {finger_1: 0.2}"))
    assert status_of(["run", str(plain), "--lock", "*finger*=pi/10", "--out", str(tmp_path / "o")]) == 0
    run = nmm.Trajectory.load(tmp_path / "o")
    assert run.robot.q_names == ("x", "y", "theta", "elbow")
    assert run.robot.parts.provenance.locked["finger_1"] == 0.2
    again = nmm.Scenario.load(tmp_path / "o" / "scenario.yaml")
    assert again.robot().q_names == run.robot.q_names
    capsys.readouterr()
    for command in (["info", str(path)], ["check", str(path)]):
        assert status_of([*command, "--lock", "*finger*=0"]) == 0
        assert "finger_1 " not in capsys.readouterr().out.split("note:")[0].split("frames:")[0]
    assert status_of(["singularities", str(plain), "--lock", "finger*=0"]) == 0
    assert status_of(["redundancy", str(path), "--task", "position:upper:xy", "--lock", "finger*=0"]) == 0
    assert status_of(["info", "--scenario", str(plain), "--lock", "finger*=0"]) == 0


def test_a_mounted_robot_asks_for_which(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(["run", "ur5_unicycle_pose", "--lock", "wrist*=0"]) == 2
    assert "--set robot.arm.lock.JOINT=VALUE" in capsys.readouterr().err


def test_wheels_and_meshes_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The options that errors advise: wheels whose radius is not found, and a mesh that is not there."""
    text = (
        car()
        .replace(' 0.1"/>', ' 0"/>')
        .replace("</robot>", link("lamp", shape('<mesh filename="no.stl"/>')))
    )
    path = write(tmp_path / "car.urdf", text + joint("lamp_joint", "base", "lamp", "fixed", "") + "</robot>")
    names = [f"{end}_{side}_wheel_joint" for end in ("rear", "front") for side in ("left", "right")]
    radii = ",".join(f"{name}=0.2" for name in names)
    assert status_of(["info", str(path)]) == 0
    told = capsys.readouterr()
    assert "nothing tells the radius" in told.out + told.err
    assert status_of(["info", str(path), "--wheels", radii]) == 0
    assert "0.2 m" in capsys.readouterr().out
    assert status_of(["info", str(path), "--wheels", radii, "--missing-meshes", "error"]) == 2
    assert "no.stl" in capsys.readouterr().err
    assert status_of(["check", str(path), "--wheels", radii]) == 0
    assert "refused unless missing_meshes='skip'" in capsys.readouterr().out
    task = ["--task", "position:lamp:xy"]
    assert status_of(["redundancy", str(path), *task, "--wheels", radii]) == 2
    assert "no.stl" in capsys.readouterr().err
    assert status_of(["redundancy", str(path), *task, "--wheels", radii, "--missing-meshes", "skip"]) == 0
    capsys.readouterr()
    assert status_of(["info", str(path), "--wheels", "none", "--platform", "fixed"]) == 0
    assert "rear_left_wheel_joint" in capsys.readouterr().out.split("input")[0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--wheels", "rear=0.1,front"], "--wheels: expected a radius for each"),
        (["--wheels", ","], "--wheels: expected JOINT,JOINT"),
        (["--wheels", "nobody"], "unknown wheel joint 'nobody'"),
        (["--missing-meshes", "maybe"], "unknown missing_meshes 'maybe'"),
    ],
)
def test_options_that_say_nothing(
    path: Path, given: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_of(["info", str(path), *given]) == 2
    assert message in capsys.readouterr().err


MACROS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro" {}>
  <xacro:macro name="arm" params="prefix length:=1"><link name="${{prefix}}a"/></xacro:macro>
  <xacro:macro name="hand"><link name="h"/></xacro:macro>
</robot>"""


@pytest.mark.parametrize("name", ["", 'name="r"'])
def test_a_file_of_macros_alone_is_told_as_such(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "parts.xacro", MACROS.format(name))
    expected = (
        "holds no robot, only macros: arm (prefix length:=1); hand (no parameters); write a .xacro file"
    )
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(path)
    assert expected in str(caught.value)
    assert "<xacro:arm .../>" in str(caught.value)
    assert status_of(["check", str(path)]) == 2
    assert expected in capsys.readouterr().out
