"""info, view and robots: what they print, and what they refuse; and the inputs without effect on a task."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Result
from ports import listening
from urdf_parts import AXIS, LIMIT, inertial, joint, link, robot, shape, write

import nmm
from nmm.base.bundled import bundled_robots
from nmm.cli.exit_status import status_of
from nmm.control.step.idle_inputs import inputs_without_effect

Command = Callable[..., Result]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run a command line in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: Result(status_of(arguments), *capfd.readouterr())


def rows(result: Result, header: str) -> dict[str, list[str]]:
    """The table with that header: its rows by their first word."""
    lines = result.out.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(header))
    table = lines[
        start + 1 : start + 1 + next(i for i, line in enumerate([*lines[start + 1 :], ""]) if not line)
    ]
    return {line.split()[0]: line.split()[1:] for line in table}


SCENARIO = """
name: car_position
robot: arm.urdf
task:
  - {kind: position, frame: b, axes: xy, gain: 2, reference: {kind: constant, value: [1, 0.5]}}
resolver: {kind: pg, alpha: 1}
q0: {q: 0.3}
duration: 1
"""


def on_wheels(platform: str, **limits: str) -> str:
    """A car with a steering joint, and an arm of one joint."""
    column = LIMIT.replace('lower="-1" upper="1"', 'lower="-0.5" upper="0.5"')
    rolling = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'
    wheel = '<origin xyz="0 {} 0.1"/>'
    return robot(
        f'<nmm platform="{platform}"/>',
        *(link(name, inertial()) for name in ("base", "a", "b", "left", "right", "column")),
        joint("steering", "base", "column", body=AXIS + column, origin='<origin xyz="0.8 0 0.1"/>'),
        joint("left_wheel", "base", "left", "continuous", rolling, wheel.format(0.3)),
        joint("right_wheel", "base", "right", "continuous", rolling, wheel.format(-0.3)),
        joint("base_joint", "base", "a", "fixed", ""),
        joint("q", "a", "b", body=AXIS + LIMIT),
    )


# info


def test_info_tells_units_limits_and_groups(run: Command, tmp_path: Path) -> None:
    write(tmp_path / "arm.urdf", on_wheels("car"))
    result = run("info", "arm.urdf")
    assert (result.status, result.err) == (0, "")
    loaded = nmm.load(tmp_path / "arm.urdf")
    coordinates, inputs = rows(result, "coordinate"), rows(result, "input")
    assert tuple(coordinates) == loaded.q_names
    assert coordinates["x"] == ["m", "platform", "-", "-"]
    assert coordinates["steering"] == ["rad", "platform", "-0.5", "0.5"]
    assert coordinates["q"] == ["rad", "arm", "-1", "1"]
    assert tuple(inputs) == loaded.u_names
    assert inputs["steering_rate"] == ["rad/s", "platform", "1"]
    assert inputs["q"] == ["rad/s", "arm", "1"]
    assert result.value("group platform:") == "v, steering_rate"
    assert result.value("group arm:") == "q"
    assert result.value("platform wheelbase:") == "0.8 m"
    assert "platform: car, declared in the file" in result.out
    assert rows(result, "wheel")["left_wheel"][:2] == ["0.1", "m"]
    assert result.value("position in the plane").split() == ["2", "3", "1"]


def test_info_tells_what_was_locked_moved_and_reduced(run: Command, tmp_path: Path) -> None:
    write(tmp_path / "arm.urdf", on_wheels("unicycle"))
    result = run(
        "info", "arm.urdf", "--platform", "unicycle", "--lock", "steering=pi/8", "--lock", "q=0.5", "--axle",
        "-0.1,0",
    )  # fmt: skip
    assert (result.status, result.err) == (0, "")
    assert tuple(rows(result, "coordinate")) == ("x", "y", "theta")
    assert "locked joints: steering at 0.392699, q at 0.5" in result.out
    assert "reference point is at (-0.1, 0, 0) m" in result.out
    assert "wheels that only roll, left out of q: left_wheel, right_wheel" in result.out
    assert rows(result, "wheel")["left_wheel"][-4:-1] == ["(0.1,", "0.3,", "0.1)"]


def test_info_tells_meshes_and_packages(run: Command, tmp_path: Path) -> None:
    parts = tmp_path / "parts"
    parts.mkdir()
    write(parts / "cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    meshes = ("package://parts/cube.obj", "package://parts/gone.stl", "package://nowhere/m.stl")
    write(tmp_path / "arm.urdf", robot(link("a", "".join(shape(f'<mesh filename="{m}"/>') for m in meshes))))
    result = run("info", "arm.urdf", "--package-dir", str(tmp_path))
    assert (result.status, result.err) == (0, "")
    assert result.value("meshes:") == "1 of 3 found"
    assert result.value("package parts:") == str(parts)
    for name in meshes[1:]:
        assert name in result.value("meshes not found:")
    assert result.value("package not found: nowhere; looked in").startswith(str(tmp_path))


def test_info_of_a_scenario_shows_its_robot_and_what_does_not_move_its_task(
    run: Command, tmp_path: Path
) -> None:
    write(tmp_path / "arm.urdf", on_wheels("car"))
    write(tmp_path / "car.yaml", SCENARIO)
    result = run("info", "--scenario", "car.yaml")
    assert (result.status, result.err) == (0, "")
    assert "steering" in rows(result, "coordinate")
    assert result.value("car_position").split() == ["2", "3", "1"]
    assert "steering_rate has no effect on the task: only the objective can use it" in result.out
    assert "\nv has no effect" not in result.out
    write(tmp_path / "arm.urdf", on_wheels("unicycle"))
    steered = run("info", "--scenario", "car.yaml")
    assert "they steer, and stand still at zero: steering" in steered.out
    # Of another name it is a joint of the arm that moves nothing.
    write(tmp_path / "arm.urdf", on_wheels("unicycle").replace("steering", "wiper"))
    turned = run("info", "--scenario", "car.yaml")
    assert "\nwiper has no effect on the task: " in turned.out
    assert "every input moves the task" in run("info", "--scenario", "unicycle_2r_position").out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "expected ROBOT"),
        (["--scenario", "unicycle_2r_position", "--axle", "1,2"], "are for ROBOT"),
        (["unicycle_2r", "--scenario", "unicycle_3r_position"], "does not fit robot unicycle_2r"),
        (["unicycle_2r", "--lock", "q1"], "--lock: expected JOINT=VALUE, as in torso=0.2, got 'q1'"),
        (["unicycle_2r", "--lock", "q1=left"], "--lock: q1: "),
        (["unicycle_2r", "--lock", "q1=1", "--lock", "q1=2"], "--lock: q1 is given twice"),
        (["unicycle_2r", "--lock", "q9=1"], "'q9'"),
        (["unicycle_2r", "--axle", "1,a"], "--axle: "),
        (["unicycle_2r", "--axle", "wheel"], "unknown frame 'wheel'"),
        (["unicycle_2r", "--platform", "hovercraft"], "unknown platform 'hovercraft'"),
        (["unicycle_2r", "--package-dir", "nowhere"], "nowhere"),
    ],
)
@pytest.mark.parametrize("command", ["info", "view"])
def test_wrong_usage_is_one_line(run: Command, command: str, arguments: Sequence[str], words: str) -> None:
    if command == "view" and ("--scenario" in arguments or not arguments):
        arguments, words = ["unicycle_2r", "--port", "x"], "Invalid value for '--port'"
    result = run(command, *arguments)
    assert (result.status, result.out) == (2, "")
    assert result.err.startswith(f"nmm {command}: ")
    assert words in result.err
    assert len(result.err.splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("info", ["ROBOT", "--scenario", "--platform", "--lock", "JOINT=VALUE", "--axle", "--package-dir"]),
        ("check", ["FILE", "-a", "--package-dir", "Exit status 2"]),
        ("view", ["ROBOT", "--lock", "--port", "--no-open", "--no-frames", "Ctrl-C"]),
    ],
)
def test_help(run: Command, command: str, words: Sequence[str]) -> None:
    result = run(command, "--help")
    assert result.status == 0
    for word in words:
        assert word in result.out
    assert command in run("--help").out


# view


def test_view_refuses_a_port_that_is_taken(run: Command) -> None:
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        result = run("view", "unicycle_2r", "--no-open", "--port", str(port))
    assert result.status == 2
    assert f"port: {port} is in use" in result.err
    assert port not in listening()


# robots


def test_robots_lists_robots_bases_and_arms(run: Command) -> None:
    result = run("robots")
    assert result.status == 0
    for name, path in bundled_robots().items():
        (line,) = [line for line in result.out.splitlines() if line.split()[0] == name]
        declared = re.search(r'<nmm platform="(\w+)"', path.read_text(encoding="utf-8"))
        if declared:
            assert f"Platform: {declared[1]}." in line
    assert "small five-joint arm" in result.value("small_arm")


# Inputs without effect on a task


def controller_on(robot: nmm.Robot, frame: str, **options: Any) -> nmm.Controller:
    task = nmm.Task(nmm.Position(frame, "xy"), nmm.Constant([1.0, 0.5]), 2.0)
    return nmm.Controller(robot, task, nmm.ReducedGradient(alpha=1.0), **options)


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> nmm.Robot:
    return nmm.load(write(tmp_path_factory.mktemp("car") / "arm.urdf", on_wheels("car")))


def test_a_steering_rate_has_no_effect(car: nmm.Robot, robot_3r: nmm.Robot) -> None:
    assert inputs_without_effect(controller_on(car, "b").solver) == (
        "steering_rate",
        "q",
    )  # on q's axis
    assert inputs_without_effect(controller_on(robot_3r, "ee").solver) == ()
    # The column's origin is on q1's axis, and the later joints are below it.
    assert inputs_without_effect(controller_on(robot_3r, "link1").solver) == ("q1", "q2", "q3")


def test_a_singular_start_hides_no_input(robot_3r: nmm.Robot) -> None:
    """Upright, q1 does not move the end-effector; elsewhere it does."""
    controller = controller_on(robot_3r, "ee")
    upright = controller.evaluate(0.0, robot_3r.q())
    assert np.linalg.norm(upright.J[:, robot_3r.input("q1")]) < 1e-12
    assert inputs_without_effect(controller.solver, robot_3r.q()) == ()


def test_the_partition_stays_as_it_was(robot_3r: nmm.Robot) -> None:
    controller, twin = controller_on(robot_3r, "ee"), controller_on(robot_3r, "ee")
    q = robot_3r.q({"q2": 1.0, "q3": 0.5})
    controller(0.0, q), twin(0.0, q)
    inputs_without_effect(controller.solver, q)
    for other in (q, q + 0.01):
        np.testing.assert_array_equal(controller(0.0, other), twin(0.0, other))
        np.testing.assert_array_equal(controller.last(0.0, other).partition, twin.last(0.0, other).partition)


def test_a_users_function_that_raises_is_no_error(robot_3r: nmm.Robot) -> None:
    def value(configuration: nmm.Configuration) -> list[float]:
        raise ZeroDivisionError("not here")

    task = nmm.Task(nmm.CallableFunction(value, ["one"]), nmm.Constant([1.0]), 1.0)
    controller = nmm.Controller(robot_3r, task, nmm.ProjectedGradient())
    assert inputs_without_effect(controller.solver) == ()
