"""The scenario's keys for tasks of spatial arms: from the text to the objects, and errors at their keys."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from findings import refused
from short_scenario import scenario

import nmm
from nmm import Scenario, ScenarioError, rotation_vector
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading.packages import Packages

PI = math.pi
#: Six joints on a unicycle: enough for a pose. Its first joint's link is `shoulder_link`, its tip `tool0`.
SHARE = next(f for f in Packages(Path(__file__)).folders if (f / "example-robot-data").is_dir())
UR5 = SHARE / "example-robot-data" / "robots" / "ur_description" / "urdf" / "ur5_robot.urdf"


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    """A scenario whose robot is loaded once, for all those that change its task only."""
    given = scenario(
        tmp_path_factory.mktemp("spatial"),
        robot=str(UR5),
        q0="{shoulder_lift_joint: -1.1, elbow_joint: 1.6, wrist_1_joint: -0.9, wrist_2_joint: -1.2}",
        task="{kind: orientation, frame: tool0, reference: [0, 0, 0]}",
        resolver="{kind: pg}",
    )
    given.robot()
    return given


def one_task(template: Scenario, text: str) -> nmm.Task:
    task: nmm.Task = template.override("task", text).controller().task.tasks[0]
    return task


def assert_same(robot: nmm.Robot, ours: nmm.extending.Function, theirs: nmm.extending.Function) -> None:
    assert type(ours) is type(theirs)
    assert [row.unit for row in ours.rows(robot)] == [row.unit for row in theirs.rows(robot)]
    here = Configuration(robot, np.random.default_rng(7).uniform(-1, 1, robot.n))
    for t in (0.0, 0.7):
        for a, b in zip(nmm.evaluate(ours, t, here), nmm.evaluate(theirs, t, here), strict=True):
            assert np.array_equal(a, b)


CIRCLE = "{kind: circle, center: [2, 1, 0.5], radius: 1, rate: pi/4, plane: yz}"
CIRCLE_MADE = nmm.Circle([2, 1, 0.5], 1, PI / 4, plane="yz")
QUATERNION = [0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)]
TASKS: list[tuple[str, nmm.Task]] = [
    (
        "{kind: position, frame: tool0, axes: zx, relative_to: shoulder_link, reference: [1, 2]}",
        nmm.Task(nmm.Position("tool0", "zx", "shoulder_link"), [1, 2]),
    ),
    (
        "{kind: orientation, frame: tool0, reference: [0, pi/2, 0], gain: 3}",
        nmm.Task(nmm.Orientation("tool0"), nmm.Constant([0, PI / 2, 0], "rad"), 3),
    ),
    (
        "{kind: orientation, frame: tool0, relative_to: shoulder_link, reference: {rpy: [0.1, pi/2, -1]}}",
        nmm.Task(
            nmm.Orientation("tool0", "shoulder_link"),
            nmm.Constant(rotation_vector(rpy=[0.1, PI / 2, -1]), "rad"),
        ),
    ),
    (
        "{kind: orientation, frame: tool0, reference: {quaternion: [0, sqrt(1/2), 0, sqrt(1/2)]}}",
        nmm.Task(nmm.Orientation("tool0"), nmm.Constant(rotation_vector(quaternion=QUATERNION), "rad")),
    ),
    (
        "{kind: orientation, frame: tool0, reference: {kind: rotation, vector: [0, 0, 1]}}",
        nmm.Task(nmm.Orientation("tool0"), nmm.Constant([0, 0, 1], "rad")),
    ),
    (
        "{kind: orientation, frame: tool0, reference: {kind: slerp, start: {rpy: [0, 0, 1]}, "
        "end: [0.1, 0.2, 0.3], duration: 2, profile: smooth}}",
        nmm.Task(nmm.Orientation("tool0"), nmm.Slerp([0, 0, 1], [0.1, 0.2, 0.3], 2, "smooth")),
    ),
    (
        "{kind: orientation, frame: tool0, reference: {kind: turn, axis: [0, 0, 1], rate: pi/8, "
        "start: {quaternion: [0, sqrt(1/2), 0, sqrt(1/2)]}}}",
        nmm.Task(
            nmm.Orientation("tool0"),
            nmm.SteadyTurn([0, 0, 1], PI / 8, rotation_vector(quaternion=QUATERNION)),
        ),
    ),
    (
        "{kind: orientation, frame: tool0, reference: {kind: turn, axis: [1, 0, 0], rate: 1}}",
        nmm.Task(nmm.Orientation("tool0"), nmm.SteadyTurn([1, 0, 0], 1)),
    ),
    (
        "{kind: orientation, frame: tool0, reference: {kind: line, start: [0, 0, 0], end: [0, 0, 1], "
        "duration: 2}}",
        nmm.Task(nmm.Orientation("tool0"), nmm.Line([0, 0, 0], [0, 0, 1], 2, unit="rad")),
    ),
    (
        "{kind: orientation, frame: tool0, reference: {kind: orientation, frame: base}}",
        nmm.Task(nmm.Orientation("tool0"), nmm.Orientation("base")),
    ),
    (
        "{kind: pose, frame: tool0, reference: [1, 2, 3, 0, 0, pi], gain: [1, 1, 1, 2, 2, 2]}",
        nmm.Task(nmm.Pose("tool0"), nmm.Constant([1, 2, 3, 0, 0, PI], "1"), [1, 1, 1, 2, 2, 2]),
    ),
    (
        f"{{kind: pose, frame: tool0, reference: {{kind: pose, position: {CIRCLE}, "
        "orientation: {rpy: [0, 0, 1]}}}",
        nmm.Task(nmm.Pose("tool0"), nmm.PoseReference(CIRCLE_MADE, [0, 0, 1])),
    ),
    (
        "{kind: pose, frame: tool0, reference: {kind: pose, position: {kind: position, frame: base}, "
        "orientation: {kind: turn, axis: [0, 0, 1], rate: 1}}}",
        nmm.Task(nmm.Pose("tool0"), nmm.PoseReference(nmm.Position("base"), nmm.SteadyTurn([0, 0, 1], 1))),
    ),
    (
        "{kind: pointing, frame: tool0, at: [6, 2, 1], axis: x, reference: [0, 0]}",
        nmm.Task(nmm.Pointing("tool0", [6, 2, 1], "x"), nmm.Constant([0, 0], "rad")),
    ),
    (
        f"{{kind: pointing, frame: tool0, at: {CIRCLE}, axis: [0, 1, pi], reference: [0, 0]}}",
        nmm.Task(nmm.Pointing("tool0", CIRCLE_MADE, [0, 1, PI]), nmm.Constant([0, 0], "rad")),
    ),
    (
        "{kind: pointing, frame: tool0, at: {kind: position, frame: base}, reference: [0, 0]}",
        nmm.Task(nmm.Pointing("tool0", "base"), nmm.Constant([0, 0], "rad")),
    ),
    (
        "{kind: distance, frame: tool0, to: {kind: position, frame: base}, reference: 0.7}",
        nmm.Task(nmm.Distance("tool0", "base"), 0.7),
    ),
    (
        "{kind: distance, frame: tool0, to: [1, 2, 3], reference: {kind: distance, frame: base, "
        "to: {kind: center_of_mass}}}",
        nmm.Task(nmm.Distance("tool0", [1, 2, 3]), nmm.Distance("base", nmm.CenterOfMass())),
    ),
    (
        "{kind: center_of_mass, axes: zx, reference: [0.3, 0]}",
        nmm.Task(nmm.CenterOfMass("zx"), [0.3, 0]),
    ),
    (
        "{kind: posture, reference: [0, -1, 1, 0, 0, 0]}",
        nmm.Task(nmm.Posture(), nmm.Constant([0, -1, 1, 0, 0, 0], "rad")),
    ),
    (
        "{kind: posture, of: [elbow_joint, theta], reference: [1, 0]}",
        nmm.Task(nmm.Posture("elbow_joint", "theta"), nmm.Constant([1, 0], "rad")),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), TASKS)
def test_tasks(template: Scenario, text: str, expected: nmm.Task) -> None:
    robot, task = template.robot(), one_task(template, text)
    assert_same(robot, task.function, expected.function)
    assert task.rows(robot) == expected.rows(robot)
    assert_same(robot, task.reference, expected.reference)
    assert np.array_equal(task.gain_matrix(robot), expected.gain_matrix(robot))


@pytest.mark.parametrize("text", [text for text, _ in TASKS])
def test_what_is_resolved_is_the_same_scenario(template: Scenario, text: str, tmp_path: Path) -> None:
    given = template.override("task", text)
    path = tmp_path / "resolved.yaml"
    path.write_text(yaml.safe_dump(given.resolved(), sort_keys=False), encoding="utf-8")
    again = Scenario.load(path)
    assert again.resolved() == given.resolved() | {"name": again.name}
    again._robot = template.robot()  # not loaded anew
    ours, theirs = (s.controller().task.tasks[0] for s in (again, given))
    assert_same(template.robot(), ours.function, theirs.function)
    assert_same(template.robot(), ours.reference, theirs.reference)


POSE = "{kind: pose, frame: tool0, reference: %s}"
TURNED = "{kind: orientation, frame: tool0, reference: %s}"
BAD = [
    (
        "{kind: pose, frame: tool, reference: 0}",
        {"where": "given.yaml: set task.frame: robot ur5", "got": "tool"},
    ),
    (
        "{kind: orientation, frame: tool0, relative_to: here, reference: 0}",
        {"where": "given.yaml: set task.relative_to: robot ur5", "got": "here"},
    ),
    (
        "{kind: position, frame: tool0, relative_to: tool0, reference: 0}",
        {"where": "given.yaml: set task.relative_to"},
    ),
    (TURNED % "[0, 0]", {"where": "given.yaml: set task.reference", "got": 2}),
    (TURNED % "{rpy: [0, 0]}", {"where": "given.yaml: set task.reference.rpy", "got": ["0", "0"]}),
    (TURNED % "{rpy: [0, 0, up]}", {"where": "given.yaml: set task.reference.rpy", "got": "up"}),
    (
        TURNED % "{quaternion: [0, 0, 0, 2]}",
        {"where": "given.yaml: set task.reference.quaternion", "got": [0.0, 0.0, 0.0, 2.0]},
    ),
    (TURNED % "{rpy: [0, 0, 0], axis: 1}", {"where": "given.yaml: set task.reference.axis", "got": "axis"}),
    (
        TURNED % "{rpy: [0, 0, 0], quaternion: [0, 0, 0, 1]}",
        {"where": "given.yaml: set task.reference", "got": ["rpy", "quaternion"]},
    ),
    (TURNED % "{kind: rotation}", {"where": "given.yaml: set task.reference", "got": []}),
    (
        TURNED % "{kind: turn, axis: [0, 0, 0], rate: 1}",
        {"where": "given.yaml: set task.reference.axis", "got": [0.0, 0.0, 0.0]},
    ),
    (TURNED % "{kind: turn, axis: [0, 0, 1]}", {"where": "given.yaml: set task.reference.rate"}),
    (
        TURNED % "{kind: turn, axis: [0, 0, 1], rate: 1, start: {rpy: [0, 1]}}",
        {"where": "given.yaml: set task.reference.start.rpy", "got": ["0", "1"]},
    ),
    (
        TURNED % "{kind: slerp, start: [0, 0, 0], end: [0, 0], duration: 1}",
        {"where": "given.yaml: set task.reference.end", "got": [0.0, 0.0]},
    ),
    (
        TURNED % "{kind: slerp, start: [0, 0, 0], end: {quaternion: [0, 0, 0, 0]}, duration: 1}",
        {"where": "given.yaml: set task.reference.end.quaternion", "got": [0.0, 0.0, 0.0, 0.0]},
    ),
    (
        TURNED % "{kind: turn, axis: [0, 0, 1], rate: 1, start: {kind: circle}}",
        {"where": "given.yaml: set task.reference.start", "got": {"kind": "circle"}},
    ),
    (
        TURNED % "{kind: turn, axis: [0, 0, 1], rate: 1, start: {kind: rotation}}",
        {"where": "given.yaml: set task.reference.start", "got": []},
    ),
    (
        TURNED % "{kind: turn, axis: [0, 0, 1], rate: 1, start: up}",
        {"where": "given.yaml: set task.reference.start", "got": "up"},
    ),
    (
        TURNED % "{kind: turn, axis: [0, 0, 1], rate: 1, start: [0, [1]]}",
        {"where": "given.yaml: set task.reference.start", "got": [0.0, [1.0]]},
    ),
    (TURNED % "{kind: position, frame: base}", {"where": "given.yaml: set task.reference", "got": "m"}),
    (POSE % "[1, 2, 3]", {"where": "given.yaml: set task.reference", "got": 3}),
    (POSE % "{kind: pose, position: [1, 2, 3]}", {"where": "given.yaml: set task.reference.orientation"}),
    (
        POSE % "{kind: pose, position: [1, 2], orientation: [0, 0, 0]}",
        {"where": "given.yaml: set task.reference.position", "got": ["r0 (m)", "r1 (m)"]},
    ),
    (
        POSE % "{kind: pose, position: [1, 2, 3], orientation: {rpy: 1}}",
        {"where": "given.yaml: set task.reference.orientation.rpy", "got": "1"},
    ),
    (
        POSE % "{kind: pose, position: {kind: position, frame: bas}, orientation: [0, 0, 0]}",
        {"where": "given.yaml: set task.reference.position.frame: robot ur5", "got": "bas"},
    ),
    (
        "{kind: pointing, frame: tool0, at: [1, 2], reference: [0, 0]}",
        {"where": "given.yaml: set task.at", "got": ["r0 (m)", "r1 (m)"]},
    ),
    (
        "{kind: pointing, frame: tool0, at: [1, 2, 3], axis: w, reference: [0, 0]}",
        {"where": "given.yaml: set task.axis", "got": "w"},
    ),
    (
        "{kind: pointing, frame: tool0, at: [1, 2, 3], axis: [0, 0, 0], reference: [0, 0]}",
        {"where": "given.yaml: set task.axis", "got": [0.0, 0.0, 0.0]},
    ),
    (
        "{kind: pointing, frame: tool0, at: {kind: position, frame: tool0}, reference: [0, 0]}",
        {"where": "given.yaml: set task.at"},
    ),
    ("{kind: pointing, frame: tool0, reference: [0, 0]}", {"where": "given.yaml: set task.at"}),
    (
        "{kind: distance, frame: tool0, to: {kind: heading, frame: base}, reference: 1}",
        {"where": "given.yaml: set task.to", "got": ["base.heading (rad)"]},
    ),
    ("{kind: center_of_mass, axes: xw, reference: 1}", {"where": "given.yaml: set task.axes", "got": "xw"}),
    (
        "{kind: posture, of: [elbow], reference: 0}",
        {"where": "given.yaml: set task.of: robot ur5", "got": "elbow"},
    ),
    ("{kind: posture, of: [], reference: 0}", {"where": "given.yaml: set task.of", "got": []}),
    (
        "{kind: posture, of: [elbow_joint, elbow_joint], reference: [0, 0]}",
        {"where": "given.yaml: set task: posture"},
    ),
]


@pytest.mark.parametrize(("text", "fields"), BAD)
def test_errors_know_their_key(template: Scenario, text: str, fields: dict[str, Any]) -> None:
    with refused(**fields, kind=ScenarioError):
        template.override("task", text).controller()


def test_a_pose_is_tracked(template: Scenario) -> None:
    """A whole run: the circle with its orientation, from a file to a small error."""
    reference = (
        "{kind: pose, position: {kind: circle, center: [0.5, -0.2, 0.6], radius: 0.2, rate: 0.5}, "
        "orientation: {kind: slerp, start: {rpy: [pi/2, 0, 0]}, end: {rpy: [pi/2, 0, pi/3]}, duration: 6}}"
    )
    given = template.override("task", f"{{kind: pose, frame: tool0, reference: {reference}, gain: 5}}")
    run = given.override("duration", 4).override("dt", 0.01).run()
    assert run.complete, run.message
    assert run.error_norm[0] > 0.1
    assert run.error_norm[-1] < 1e-6
