"""A task in a word, and what a command's SUBJECT means: what they take, and every kind of bad input."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy import pi

from nmm import Scenario
from nmm.base.errors import InputError
from nmm.cli.subjects import studied
from nmm.control.functions.function import Function
from nmm.control.functions.program import evaluate
from nmm.control.functions.tasks import (
    CenterOfMass,
    Distance,
    Heading,
    LinearCoordinates,
    Orientation,
    Pointing,
    Pose,
    Position,
    Posture,
    Task,
)
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load, mount
from nmm.model.robots.robot import Robot
from nmm.scenario.short_task import short_task


@pytest.fixture(scope="module")
def mounted() -> Robot:
    """A robot that moves in space, and whose arm has one end."""
    return mount("omni_base", "small_arm")


def same(found: Function | Task, expected: Function, robot: Robot) -> None:
    """The same rows, values and derivatives."""
    assert isinstance(found, Function)
    assert found.rows(robot) == expected.rows(robot)
    q = np.random.default_rng(1).uniform(-1.0, 1.0, robot.n)
    for one, other in zip(
        evaluate(found, 0.0, Configuration(robot, q)),
        evaluate(expected, 0.0, Configuration(robot, q)),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


# tasks that are one


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("position", Position("ee", "xy")),
        ("position:", Position("ee", "xy")),
        ("position:ee", Position("ee", "xy")),
        ("position::y", Position("ee", "y")),
        ("position:link2:yx", Position("link2", "yx")),
        (" position : ee : xyz ", Position("ee", "xyz")),
        ("pose", Pose("ee")),
        ("orientation:link1", Orientation("link1")),
        ("heading:link2", Heading("link2")),
        ("center_of_mass", CenterOfMass("xy")),
        ("center_of_mass:x", CenterOfMass("x")),
        ("center_of_mass::x", CenterOfMass("x")),
        ("coordinates:q1, q2", LinearCoordinates("q1", "q2")),
        ("posture", Posture()),
        ("posture:q2", Posture("q2")),
        ("{kind: position, frame: ee, axes: xy}", Position("ee", "xy")),
        ("{kind: coordinates, of: {q1: 1, q2: -pi}}", LinearCoordinates({"q1": 1.0, "q2": -pi})),
        ("{kind: pointing, frame: ee, at: [1, 0, 1]}", Pointing("ee", [1.0, 0.0, 1.0])),
        ("{kind: distance, frame: ee, to: [1, 0, 1]}", Distance("ee", [1.0, 0.0, 1.0])),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_a_text_is_a_function(text: str, expected: Function, robot_2r: Robot) -> None:
    same(short_task(text, robot_2r), expected, robot_2r)


def test_without_axes_those_that_the_robot_moves_along(robot_3r: Robot, mounted: Robot) -> None:
    same(short_task("position", robot_3r), Position("ee", "xyz"), robot_3r)
    same(short_task("position:base_footprint", robot_3r), Position("base_footprint", "xy"), robot_3r)
    tip = short_task("position", mounted).rows(mounted)
    assert [row.name for row in tip] == ["ee.x", "ee.y", "ee.z"]
    fixed = load("unicycle_2r", platform="fixed")
    same(short_task("position", fixed), Position("ee", "xy"), fixed)
    same(short_task("position:link1", fixed), Position("link1", "xyz"), fixed)  # it does not move at all


def test_with_a_reference_it_is_a_task(robot_2r: Robot) -> None:
    task = short_task("{kind: position, frame: ee, axes: xy, reference: [1, 2], gain: 3}", robot_2r)
    assert isinstance(task, Task)
    here = Configuration(robot_2r, np.zeros(5))
    np.testing.assert_array_equal(evaluate(task.reference, 0.0, here).value, [1.0, 2.0])
    np.testing.assert_array_equal(np.asarray(task.gain) * np.eye(2), 3.0 * np.eye(2))
    text = "{kind: position, frame: link2, axes: xy}"
    bearing = short_task(
        f"{{kind: heading, frame: link1, reference: {{kind: bearing, of: {text}, towards: [6, 2]}}}}",
        robot_2r,
    )
    assert isinstance(bearing, Task)
    assert np.any(evaluate(bearing.reference, 0.0, here).value_q != 0.0)


# tasks that are none


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected KIND:FRAME:AXES, as in position:ee:xy, or a mapping as in a scenario, got ''"),
        ("  ", "got ' '"),
        (":", "unknown kind ''"),
        ("pos", "unknown kind 'pos' (did you mean 'pose'?); available: pose, posture, position"),
        ("Position:ee", "did you mean 'position'?"),
        ("[position]", "unknown kind '[position]'"),
        ("posé:ee", "did you mean 'pose'?"),
        ("position:hand", "unknown frame 'hand'; available: "),
        ("position:eee", "(did you mean 'ee'?)"),
        ("position:universe", "unknown frame 'universe'"),
        ("position:ee:xw", "axes: expected some of x, y, z, each once"),
        ("position:ee:xx", "axes: expected some of x, y, z, each once"),
        ("position:ee:XY", "axes: expected some of x, y, z, each once"),
        ("position:ee:xy:", "expected KIND:FRAME:AXES"),
        ("pose:ee:xy", "AXES for positions only"),
        ("heading:ee:xy", "AXES for positions only"),
        ("center_of_mass:ee", "axes: expected some of x, y, z"),
        ("center_of_mass:ee:xy", "expected KIND:FRAME:AXES"),
        ("coordinates", "expected coordinates:NAME,NAME,..."),
        ("coordinates:", "expected coordinates:NAME,NAME,..."),
        ("coordinates:q1,", "expected coordinates:NAME,NAME,..."),
        ("coordinates:q1:q2", "expected coordinates:NAME,NAME,..."),
        ("coordinates:q9", "unknown coordinate 'q9'; available: x, y, theta, q1, q2"),
        ("posture:,", "expected posture:NAME,NAME,..."),
        ("posture:ee", "unknown coordinate 'ee'"),
        ("pointing:ee", "expected a mapping, as in {kind: pointing, frame: ..., at: [1, 0, 1]}"),
        ("distance", "expected a mapping, as in {kind: distance, frame: ..., to: [1, 0, 1]}"),
        ("{", "not valid YAML"),
        ("{}", "kind: this key is missing; available: position"),
        ("{frame: ee}", "kind: this key is missing"),
        ("{kind: }", "kind: this key is missing"),
        ("{kind: [position]}", "unknown kind"),
        ("{kind: {a: 1}}", "unknown kind"),
        ("{kind: 3}", "unknown kind '3'"),
        ("{kind: posision, frame: ee}", "did you mean 'position'?"),
        ("{kind: position}", "frame: this key is missing"),
        ("{kind: position, kind: pose}", "expected every key once"),
        ("{kind: position, frame: hand}", "frame: robot unicycle_2r: unknown frame 'hand'"),
        ("{kind: position, frame: [ee]}", "frame: "),
        ("{kind: position, frame: ee, axes: }", "axes: "),
        ("{kind: position, frame: ee, axis: x}", "unknown key 'axis' (did you mean 'axes'?)"),
        ("{kind: position, frame: ee, 1: 2}", "unknown key '1'"),
        ("{kind: position, frame: ee, gain: 2}", "unknown key 'gain'"),
        ("{kind: position, frame: ee, axes: xy, reference: [1]}", "reference: expected 2 components"),
        ("{kind: position, frame: ee, axes: xy, reference: {kind: circle}}", "reference.center: "),
        ("{kind: position, frame: ee, axes: xy, reference: {kind: square}}", "reference"),
        ("{kind: position, frame: ee, axes: xy, reference: [1, .nan]}", "finite"),
        ("{kind: position, frame: ee, axes: xy, reference: [1, 2], gain: -1}", "gain: expected positive"),
        ("{kind: pointing, frame: ee, at: [1, 0]}", "at: expected a point with x, y and z"),
        ("{kind: distance, frame: ee}", "to: this key is missing"),
        ("{kind: position, frame: *x}", "not valid YAML"),
        ("{kind: !!python/object/apply:os.getcwd []}", "expected plain YAML"),
    ],
    ids=lambda given: given or "nothing",
)
def test_what_is_no_task(text: str, message: str, robot_2r: Robot) -> None:
    with pytest.raises(InputError) as caught:
        short_task(text, robot_2r)
    assert str(caught.value).startswith("task")
    assert message in str(caught.value)


def test_a_robot_with_no_end_or_with_several_needs_a_frame() -> None:
    for source in ("car_base", "trailer_base"):
        with pytest.raises(InputError, match=r"expected a frame, as in position:FRAME; available: "):
            short_task("position", load(source))


# subjects


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as `nmm compare` leaves it, with a run in it."""
    folder = tmp_path_factory.mktemp("comparison")
    settings = {"duration": 0.5, "dt": 0.1}
    Scenario.load("unicycle_2r_position", settings).run().save(folder / "rg", figures=False)
    return folder


def test_a_robot_at_rest_and_where_it_is_told_to_be() -> None:
    given = studied("unicycle_2r", tasks=["position"], at=["q1=pi/2", "x=-1"], t=2.0, settings=["d=0.1"])
    assert (given.name, given.t, given.controller, given.trajectory) == ("unicycle_2r", 2.0, None, None)
    np.testing.assert_array_equal(given.q, [-1.0, 0.0, 0.0, pi / 2, 0.0])
    assert given.robot.arguments["d"] == "0.1"
    assert given.subject == (given.robot, given.task)
    limited = studied("panda_mecanum_pose", tasks=["position:base_footprint"]).robot
    assert not np.array_equal(limited.rest, np.zeros(limited.n))


def test_a_scenario_has_a_task_a_start_and_a_controller() -> None:
    given = studied("unicycle_2r_position", tasks=None, at=["q2=0.5"], settings=["robot.arguments.d=0.1"])
    assert given.controller is not None
    assert given.subject is given.controller
    assert given.robot is given.controller.robot
    assert given.robot.arguments["d"] == "0.1"
    np.testing.assert_allclose(given.q, [-1.0, -1.0, pi, 0.0, 0.5])
    other = studied("unicycle_2r_position", tasks=["heading", "posture:q1"])
    assert other.controller is None
    assert [len(task.rows(other.robot)) for task in other.task] == [1, 1]


def test_a_run_is_where_it_was(folder: Path) -> None:
    given = studied(str(folder / "rg"), tasks=None)
    run = given.trajectory
    assert run is not None
    assert given.controller is not None
    assert given.t == 0.0
    np.testing.assert_array_equal(given.q, run.q[0])
    given.q[0] = 7.0  # a copy
    assert run.q[0, 0] != 7.0
    then = studied(str(folder / "rg"), tasks=None, t=0.25)
    assert then.t == 0.25
    np.testing.assert_allclose(then.q, (run.q[2] + run.q[3]) / 2, atol=1e-15)


def test_a_run_without_its_scenario_needs_a_task(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "rg", tmp_path / "run")
    (tmp_path / "run" / "scenario.yaml").unlink()
    with pytest.raises(InputError, match="is a run without a scenario: expected --task"):
        studied(str(tmp_path / "run"), tasks=None)
    assert studied(str(tmp_path / "run"), tasks=["position"]).controller is None


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        ("unicycle_2r", {}, "unicycle_2r is a robot: expected --task, as in --task position"),
        ("", {}, "unknown robot or scenario ''"),
        ("unicycle_2", {}, "unknown robot or scenario 'unicycle_2' (did you mean 'unicycle_2r'?)"),
        ("unicycle_2r_positio", {}, "did you mean 'unicycle_2r_position'?"),
        ("nowhere.yaml", {}, "nowhere.yaml"),
        ("nowhere.urdf", {"tasks": ["position"]}, "nowhere.urdf: no such file"),
        ("package://no/x.urdf", {"tasks": ["position"]}, "package 'no' not found"),
        ("RUNS", {}, "expected a robot, a scenario or a run's folder, this is another folder, which holds"),
        ("RUNS", {"tasks": ["position"]}, "which holds the runs rg"),
        (".", {}, "this is another folder"),
        ("unicycle_2r", {"tasks": ["nope"]}, "task nope: unknown kind"),
        ("unicycle_2r", {"tasks": ["position", ""]}, "task: expected KIND"),
        ("unicycle_2r", {"tasks": ["position"], "at": ["q1"]}, "--at: expected COORDINATE=VALUE"),
        ("unicycle_2r", {"tasks": ["position"], "at": ["=1"]}, "--at: expected COORDINATE=VALUE"),
        ("unicycle_2r", {"tasks": ["position"], "at": ["q9=1"]}, "unknown coordinate 'q9'; available: x, y"),
        (
            "unicycle_2r",
            {"tasks": ["position"], "at": ["q1=x"]},
            "--at: q1: unknown name 'x'; expected a number or arithmetic",
        ),
        ("unicycle_2r", {"tasks": ["position"], "at": ["q1="]}, "--at: q1: expected a number"),
        (
            "unicycle_2r",
            {"tasks": ["position"], "at": ["q1=1/0"]},
            "--at: q1: a division by zero; expected a finite number",
        ),
        (
            "unicycle_2r",
            {"tasks": ["position"], "at": ["q1=nan"]},
            "--at: q1: expected a finite number",
        ),
        ("unicycle_2r", {"tasks": ["position"], "at": ["q1=1e999"]}, "--at: q1: expected finite numbers"),
        ("unicycle_2r", {"tasks": ["position"], "at": ["q1=1", "q1=2"]}, "--at: q1 is given twice"),
        (
            "unicycle_2r",
            {"tasks": ["position"], "lock": {"q1": 0.1}, "at": ["q1=1"]},
            "--at: q1 is locked, and no coordinate then",
        ),
        ("unicycle_2r", {"tasks": ["position"], "settings": ["d"]}, "--set: expected ARG=VALUE"),
        ("unicycle_2r", {"tasks": ["position"], "settings": ["e=1"]}, "unknown xacro argument 'e'"),
        ("unicycle_2r", {"tasks": ["position"], "platform": "hover"}, "unknown platform 'hover'"),
        ("unicycle_2r_position", {"settings": ["nope=1"]}, "unknown key 'nope'"),
        ("unicycle_2r_position", {"platform": "fixed"}, "--platform: of a robot's file"),
        ("unicycle_2r_position", {"platform": "car", "axle": "ee"}, "--platform, --axle: of a robot's file"),
        ("unicycle_2r_position", {"package_dirs": ["x"]}, "--package-dir: of a robot's file"),
        ("RUN", {"settings": ["dt=1"]}, "expected a robot or a scenario"),
        ("RUN", {"platform": "fixed"}, "--platform: of a robot's file"),
        ("RUN", {"t": 9.0}, "--time: expected an instant of the run, 0 to 0.5 s, got 9"),
        ("RUN", {"t": -0.1}, "--time: expected an instant of the run"),
        ("RUN", {"t": float("nan")}, "--time: expected an instant of the run"),
        ("RUN", {"tasks": ["position:hand"]}, "unknown frame 'hand'"),
    ],
    ids=lambda given: str(given)[:60],
)
def test_what_is_no_subject(source: str, options: dict[str, Any], message: str, folder: Path) -> None:
    path = {"RUNS": str(folder), "RUN": str(folder / "rg")}.get(source, source)
    with pytest.raises(InputError) as caught:
        studied(path, **{"tasks": None} | options)
    assert message in str(caught.value)
