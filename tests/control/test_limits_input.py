"""Wrong limits in Python, in scenarios and on the command line: what was expected, and where."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import refused, the
from places import PANDA
from urdf_parts import write

import nmm
from nmm.cli.exit_status import status_of

ROBOT = nmm.load("unicycle_3r")
TIP = nmm.Position("ee", "xy")
FREE = [-np.inf, np.inf]


def on(**given: object) -> Callable[[], object]:
    return lambda: nmm.Limits(**given).on(ROBOT)  # type: ignore[arg-type]


def bound(*given: object, **more: object) -> Callable[[], object]:
    return lambda: nmm.Limits(bounds=nmm.Bound(TIP, *given, **more)).on(ROBOT)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("made", "fields"),
    [
        (on(velocity={"v": [1, -1]}), {"where": "velocity: v", "got": [1.0, -1.0]}),
        (on(velocity={"v": 0}), {"where": "velocity: v", "got": 0}),
        (on(velocity={"v": np.nan}), {"where": "velocity: v", "got": np.nan}),
        (on(velocity={"v": [1, 2, 3]}), {"where": "velocity: v", "got": [1, 2, 3]}),
        (on(velocity={"w": 1}), {"where": "velocity", "got": "w"}),
        (on(velocity=3), {"where": "velocity", "got": 3}),
        (on(position={"q1": [1, 0]}), {"where": "position: q1", "got": [1.0, 0.0]}),
        (on(position={"q1": 1}), {"where": "position: q1", "got": 1}),
        (on(position={"q9": [0, 1]}), {"where": "position: robot unicycle_3r", "got": "q9"}),
        (on(acceleration=0), {"where": "acceleration", "got": 0.0}),
        (on(acceleration=True), {"where": "acceleration", "got": True}),
        (on(acceleration={"arm": 0}), {"where": "acceleration: arm", "got": 0.0}),
        (on(acceleration={"legs": 1}), {"where": "acceleration", "got": "legs"}),
        (on(wheels={"front": 1}), {"where": "wheels", "got": "front"}),
        (on(wheels=True), {"where": "wheels", "got": True}),
        (on(recovery=0), {"where": "recovery", "got": 0.0}),
        (on(bounds=3), {"where": "bounds", "got": 3}),
        (on(bounds=[TIP]), {"where": "bounds"}),
        (bound(), {"where": "bound"}),
        (bound(1, 0), {"where": "bound"}),
        (bound([0, 1], 0, name="wall"), {"where": "bound wall"}),
        (
            bound([0, 0, 0]),
            {"where": "bound"},
        ),
        (bound([0, 0, 0], [1, 1]), {"where": "bound"}),
        (bound(np.nan), {"where": "bound: lower", "got": np.nan}),
        (bound("low"), {"where": "bound: lower", "got": "low"}),
        (bound(0, braking=0), {"where": "braking", "got": 0.0}),
        (lambda: nmm.Bound(nmm.Task(TIP, nmm.Constant([0, 0])), 0), {"where": "bound"}),  # type: ignore[arg-type]
    ],
)
def test_wrong_limits(made: Callable[[], object], fields: dict[str, Any]) -> None:
    with refused(**fields):
        made()


def test_wheels_of_a_robot_without_any() -> None:
    robot = nmm.load(PANDA, platform="fixed")
    with refused("wheels"):
        nmm.Limits(wheels=1.0).on(robot)


@pytest.mark.parametrize("ask", ["call", "evaluate", "velocity"])
def test_limits_from_sample_to_sample_need_dt(ask: str) -> None:
    task = nmm.Task(TIP, nmm.Constant([1.0, 1.0]))
    controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient(), limits=nmm.Limits(acceleration=1.0))
    do = {"call": controller, "evaluate": controller.evaluate, "velocity": controller.velocity}[ask]
    with refused("dt", got=None):
        do(0.0, np.zeros(ROBOT.n))


def test_a_task_that_is_no_number_ends_the_run_as_without_limits() -> None:
    """Inputs at rest would have it completed."""
    reference = nmm.CallableReference(lambda t: [1.0, 1.0 if t < 0.05 else np.nan], 2)
    task = nmm.Task(TIP, reference)
    controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient(), limits=nmm.Limits())
    run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.5}, 0.2, 0.01)
    assert not run.complete
    assert (
        the(run, "singular").values["undefined"]
        == "the task, its reference, the objective or a limit is undefined here"
    )


SCENARIO = """\
robot: unicycle_3r
q0: {q1: 0.3, q2: 0.5}
duration: 1
task: {kind: position, frame: ee, axes: xy, reference: [1, 1]}
resolver: {kind: pg}
limits:
"""


@pytest.mark.parametrize(
    ("limits", "place", "message"),
    [
        ("  velocity: {w: 1}", "7: limits.velocity", "unknown input or group 'w'"),
        ("  velocity: {v: [1, -1]}", "7: limits", "velocity: v: expected lower below upper"),
        (
            "  position: {q9: [0, 1]}",
            "7: limits.position",
            "unknown coordinate 'q9'",
        ),
        ("  position: {q1: [1, 0]}", "7: limits", "position: q1: expected lower below upper"),
        ("  acceleration: 0", "7: limits", "expected a number above 0"),
        (
            "  acceleration: true",
            "7: limits.acceleration",
            "expected a number, or numbers by name, got true",
        ),
        ("  wheels: {front: 1}", "7: limits.wheels", "unknown wheel 'front'"),
        ("  speed: 1", "7: limits.speed", "unknown key"),
        (
            "  bounds: [{kind: position, frame: ee, axes: xy, lower: [0, 0, 0]}]",
            "7: limits.bounds",
            "expected a number or 2",
        ),
        ("  bounds: [{kind: position, frame: hand, lower: 0}]", "7: limits.bounds", "unknown frame 'hand'"),
        (
            "  bounds: [{kind: position, frame: ee, axes: x}]",
            "7: limits.bounds",
            "expected lower, upper or both",
        ),
        (
            "  velocity: true\nuntil: 0.01",
            "8: until",
            "expected true, false or a mapping (key: value), got '0.01'",
        ),
        ("  velocity: true\nsteering: 3", "8: steering", "expected true, false or a mapping"),
        ("  velocity: true\nmethod: adaptive", "8: method", "got 'adaptive'"),
    ],
)
def test_a_scenario_names_file_and_key(
    limits: str, place: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "wrong.yaml", SCENARIO + limits + "\n")
    assert status_of(["run", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert f"wrong.yaml:{place}" in said
    assert message in said
    assert not (tmp_path / "out").exists()


def test_a_limit_on_the_command_line_is_refused_with_its_key(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(["run", "unicycle_3r_position", "--set", "limits.velocity={w: 1}"]) == 2
    assert "unknown input or group 'w'" in capsys.readouterr().err
