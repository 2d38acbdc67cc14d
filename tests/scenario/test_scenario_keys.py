"""Every key of a scenario: from the text to the object of the library that it asks for."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from findings import refused
from short_scenario import scenario

import nmm
import nmm.control.resolvers
from nmm import Scenario, ScenarioError
from nmm.base import kinds
from nmm.control.integrators import METHODS
from nmm.model.robots.configuration import Configuration
from nmm.scenario.collisions import OBSTACLE_PARTS
from nmm.scenario.constructors import MadePart, documented, parameters
from nmm.scenario.functions import FUNCTION_PARTS, REFERENCE_PARTS
from nmm.scenario.limits import LIMIT_PARTS
from nmm.scenario.objectives import OBJECTIVE_PARTS
from nmm.scenario.reference import sections
from nmm.scenario.resolvers import RESOLVER_PARTS
from nmm.scenario.schema import ScenarioPart
from nmm.scenario.tasks import CONDITION_PARTS, TASK_PARTS


def evaluated(robot: nmm.Robot, function: nmm.extending.Function, t: float) -> tuple[np.ndarray, ...]:
    q = np.random.default_rng(7).uniform(-1, 1, robot.n)
    return tuple(nmm.evaluate(function, t, Configuration(robot, q)))


PI = math.pi
FUNCTIONS: list[tuple[str, str, nmm.extending.Function]] = [
    (
        "xy",
        "{kind: circle, center: [1, 2], radius: 3, rate: pi/4, phase: -pi}",
        nmm.Circle([1, 2], 3, PI / 4, -PI),
    ),
    (
        "xyz",
        "{kind: circle, center: [1, 2, 0.5], radius: 3, rate: -1, plane: yz}",
        nmm.Circle([1, 2, 0.5], 3, -1, 0, "yz"),
    ),
    (
        "xy",
        "{kind: line, start: [0, 1], end: [2, pi], duration: 4, profile: smooth}",
        nmm.Line([0, 1], [2, PI], 4, "smooth"),
    ),
    ("xy", "{kind: constant, value: [1, 2]}", nmm.Constant([1, 2])),
    ("xy", "[1, 2]", nmm.Constant([1, 2])),
    ("x", "1/3", nmm.Constant(1 / 3)),
    (
        "xy",
        "{kind: polynomial, coefficients: [[1, 2], [3, 4], [-1, 0]], duration: 3}",
        nmm.Polynomial([[1, 2], [3, 4], [-1, 0]], 3),
    ),
    (
        "xy",
        "{kind: polynomial, times: [0, 1, 2], points: [[1, 2], [3, 4], [0, 0]]}",
        nmm.Polynomial.through([0, 1, 2], [[1, 2], [3, 4], [0, 0]]),
    ),
    (
        "xy",
        "{kind: spline, times: [0, 1, 3], points: [[1, 2], [3, 4], [0, 0]], degree: 5, ends: natural}",
        nmm.Spline([0, 1, 3], [[1, 2], [3, 4], [0, 0]], 5, "natural"),
    ),
    ("xy", "{kind: spline, times: [0, 1], points: [[1, 2], [3, 4]]}", nmm.Spline([0, 1], [[1, 2], [3, 4]])),
    ("xy", "{kind: position, frame: link2, axes: yx}", nmm.Position("link2", "yx")),
]  # fmt: skip


@pytest.mark.parametrize(("axes", "text", "expected"), FUNCTIONS)
def test_references(
    robot_2r: nmm.Robot, tmp_path: Path, axes: str, text: str, expected: nmm.extending.Function
) -> None:
    task = scenario(tmp_path, task__axes=axes, task__reference=text).controller().task.tasks[0]
    assert type(task.reference) is type(expected)
    for t in (0.0, 0.7):
        for ours, theirs in zip(
            evaluated(robot_2r, task.reference, t), evaluated(robot_2r, expected, t), strict=True
        ):
            assert np.array_equal(ours, theirs)


TASKS: list[tuple[str, nmm.Task]] = [
    ("{kind: position, frame: ee, axes: yx, reference: [1, 2]}", nmm.Task(nmm.Position("ee", "yx"), [1, 2])),
    (
        "{kind: heading, frame: link2, direction: [1, 1, 0], about: z, reference: pi/3, gain: 4}",
        nmm.Task(nmm.Heading("link2", [1, 1, 0], "z"), PI / 3, 4),
    ),
    (
        "{kind: heading, frame: link1, reference: {kind: bearing, of: {kind: position, frame: link2}, "
        "towards: [6, 2]}}",
        nmm.Task(nmm.Heading("link1"), nmm.Bearing(nmm.Position("link2"), [6, 2])),
    ),
    (
        "{kind: heading, frame: link1, reference: {kind: bearing, of: {kind: circle, center: [0, 0], "
        "radius: 1, rate: 1}, towards: [6, 2]}}",
        nmm.Task(nmm.Heading("link1"), nmm.Bearing(nmm.Circle([0, 0], 1, 1), [6, 2])),
    ),
    (
        "{kind: coordinates, of: q2, reference: pi, gain: null}",
        nmm.Task(nmm.LinearCoordinates("q2"), PI, None),
    ),
    (
        "{kind: coordinates, of: [q1, {theta: 1, q2: -1/2}], reference: [0, 1], gain: [1, 2]}",
        nmm.Task(nmm.LinearCoordinates("q1", {"theta": 1, "q2": -0.5}), [0, 1], [1, 2]),
    ),
    (
        "{kind: position, frame: ee, axes: xy, reference: [1, 2], gain: [[2, 1], [0, 3]]}",
        nmm.Task(nmm.Position("ee", "xy"), [1, 2], [[2, 1], [0, 3]]),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), TASKS)
def test_tasks(robot_2r: nmm.Robot, tmp_path: Path, text: str, expected: nmm.Task) -> None:
    task = scenario(tmp_path, task=text).controller().task.tasks[0]
    assert np.array_equal(task.gain_matrix(robot_2r), expected.gain_matrix(robot_2r))
    assert task.rows(robot_2r) == expected.rows(robot_2r)
    assert task.reference.rows(robot_2r)[0].unit == task.rows(robot_2r)[0].unit
    for ours, theirs in ((task.function, expected.function), (task.reference, expected.reference)):
        for a, b in zip(evaluated(robot_2r, ours, 0.3), evaluated(robot_2r, theirs, 0.3), strict=True):
            assert np.array_equal(a, b)


Square, Quadratic = nmm.QuadraticTerm, nmm.Quadratic
OBJECTIVE_TEXTS: list[tuple[str, nmm.extending.Objective]] = [
    (
        "{kind: quadratic, terms: [{of: {theta: 1, q1: 2}, target: pi/2, weight: 3}, {of: q2}]}",
        Quadratic(Square({"theta": 1, "q1": 2}, PI / 2, 3), Square("q2")),
    ),
    ("{kind: quadratic, terms: [{of: q2}], weight: 4, maximise: true}", -4 * Quadratic(Square("q2"))),
    (
        "{kind: joint_range, joints: [q2, q1], lower: [-pi, -1], upper: [pi, 2]}",
        nmm.JointRange(["q2", "q1"], [-PI, -1], [PI, 2]),
    ),
    ("{kind: manipulability, frame: ee, rows: xy, of: arm}", -1 * nmm.Manipulability("ee", "xy", "arm")),
    (
        "{kind: manipulability, frame: ee, rows: [x, rz], maximise: false, weight: 2}",
        2 * nmm.Manipulability("ee", ["x", "rz"]),
    ),
    (
        "[{kind: quadratic, terms: [{of: q2}]}, {kind: manipulability, frame: ee, rows: xy}]",
        Quadratic(Square("q2")) - nmm.Manipulability("ee", "xy"),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), OBJECTIVE_TEXTS)
def test_objectives(
    robot_2r: nmm.Robot, tmp_path: Path, text: str, expected: nmm.extending.Objective
) -> None:
    objective = scenario(tmp_path, objective=text).controller().given.objective
    assert objective is not None
    here = Configuration(robot_2r, [0.1, -0.3, 0.5, 0.7, 1.1])
    assert objective.value(here) == expected.value(here)
    assert np.array_equal(objective.gradient(here), expected.gradient(here))


def test_no_objective(tmp_path: Path) -> None:
    assert scenario(tmp_path).controller().given.objective is None
    assert scenario(tmp_path, objective="null").controller().given.objective is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{kind: rg}", nmm.ReducedGradient()),
        (
            "{kind: rg, alpha: 5, partitions: [[v, q1], [1, 2]]}",
            nmm.ReducedGradient(5, [("v", "q1"), (1, 2)]),
        ),
        ("{kind: rg, partitions: automatic, threshold: 0.2}", nmm.ReducedGradient(threshold=0.2)),
        ("{kind: pg, alpha: 2, tolerance: 1e-8}", nmm.ProjectedGradient(2, tolerance=1e-8)),
        ("{kind: pg, weights: {v: 2}}", nmm.ProjectedGradient(weights={"v": 2})),
        ("{kind: pg, weights: [1, 2, 3, 4]}", nmm.ProjectedGradient(weights=[1, 2, 3, 4])),
        (
            "{kind: pg, weights: [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}",
            nmm.ProjectedGradient(weights=np.diag([2, 1, 1, 1])),
        ),
    ],
)
def test_resolvers(tmp_path: Path, text: str, expected: nmm.extending.Resolver) -> None:
    found = scenario(tmp_path, resolver=text).controller().solver.resolver
    assert type(found) is type(expected)
    dimensions = nmm.control.resolvers.Dimensions(2, 0, ("v", "omega", "q1", "q2"))
    for ours, theirs in zip(found.setup(dimensions), expected.setup(dimensions), strict=True):
        assert np.array_equal(ours, theirs)


REGISTERED: list[tuple[kinds.Kinds, dict[str, type[MadePart]]]] = [
    (kinds.TASKS, dict(TASK_PARTS)),
    (kinds.REFERENCES, dict(REFERENCE_PARTS)),
    (kinds.OBJECTIVES, dict(OBJECTIVE_PARTS)),
    (kinds.RESOLVERS, dict(RESOLVER_PARTS)),
    (kinds.LIMITS, dict(LIMIT_PARTS)),
]
each_list = pytest.mark.parametrize(("listed", "parts"), REGISTERED, ids=lambda it: getattr(it, "what", ""))


@each_list
def test_every_kind_can_be_asked_for(listed: kinds.Kinds, parts: dict[str, type[MadePart]]) -> None:
    """What a constructor takes, a file can say, and with the same default; what else it says is listed."""
    beside = {"kind", "reference", "gain", "weight", "maximise", "added_task", "priority", "speed", "braking"}
    beside |= {"name", "when"}
    own = {"quadratic": {"terms"}, "polynomial": {"times", "points"}}
    handed_over = {"collisions"}  # the scenario's own
    assert set(listed) <= set(parts)
    for name, made in listed.items():
        fields = parts[name].model_fields
        taken = {one.key: one for one in parameters(made) if one.key not in handed_over}
        if name not in own:
            assert set(taken) <= set(fields), f"{name}: no key for {set(taken) - set(fields)}"
        assert set(fields) - set(taken) <= beside | own.get(name, set()), name
        for key in set(fields) & set(taken) - {"unit"}:
            if name not in own:
                assert fields[key].is_required() == taken[key].required, f"{name}.{key}"
                if not taken[key].required:
                    assert fields[key].default == taken[key].default, f"{name}.{key}"


@each_list
def test_every_parameter_is_documented(listed: kinds.Kinds, parts: dict[str, type[MadePart]]) -> None:
    for name, made in listed.items():
        texts = documented(made)
        for one in parameters(made):
            assert texts.get(one.name), f"{made.__name__} ({name}): its docstring says nothing of {one.name}"


@pytest.mark.parametrize("listed", [*(one for one, _ in REGISTERED), kinds.PLATFORMS], ids=lambda it: it.what)
def test_every_kind_is_a_public_name(listed: kinds.Kinds) -> None:
    for name, kind in listed.items():
        public = getattr(nmm, kind.__name__, None)
        assert public is kind, f"{name}: nmm.{kind.__name__} is missing: run python docs/make_kind_lists.py"
        own = getattr(kind, "name", name)
        assert own == name, f"{kind.__name__} calls itself {own}, nmm.base.kinds calls it {name}"


def test_the_methods_are_the_integrators() -> None:
    assert set(ScenarioPart.model_fields["method"].annotation.__args__) == set(METHODS)


def test_every_key_is_described() -> None:
    for section in sections():
        assert section.summary, section.title
        for key, _, description in section.keys:
            assert description, f"{section.title}: {key}"
            assert not re.search(r"\b(None|True|False)\b", description), f"{section.title}: {key}"
    titles = [section.title for section in sections()]
    assert len(set(titles)) == len(titles)
    shared = [kind for kind, part in REFERENCE_PARTS.items() if part is FUNCTION_PARTS.get(kind)]
    others = ("the file", "robot", "robot, with arms mounted", "robot.arms", "objective.terms")
    others = (*others, "reference.faults", "disturbances.localisation")
    others = (*others, "limits", "limits.bounds", "until", "disturbances", "retreat", "plan", "plan.track")
    others = (*others, "steering", "scene", "scene.carried", "scene.scenery")
    others = (*others, *(f"task.when, kind: {kind}" for kind in CONDITION_PARTS))
    others = (*others, "collisions", "collisions.obstacles", *OBSTACLE_PARTS)
    others = (*others, *(title for title in titles if title.endswith(", of any kind")))
    assert len(titles) == len(others) + sum(len(parts) for _, parts in REGISTERED) - len(shared)


def test_keys_that_all_kinds_have_are_told_once() -> None:
    told = [key for section in sections() if section.title.startswith("task, ") for key, _, _ in section.keys]
    assert [told.count(key) for key in ("gain", "reference", "priority", "when")] == [1] * 4


def test_a_unit_that_is_not_the_tasks(tmp_path: Path) -> None:
    with refused("given.yaml: set task.reference", got="rad", kind=ScenarioError):
        scenario(tmp_path, task__reference="{kind: constant, value: [1, 2], unit: rad}").controller()


def test_planning_mode_keeps_the_error(tmp_path: Path) -> None:
    run = scenario(tmp_path, task__gain="null", duration="1").run()
    assert np.abs(run.error - run.error[0]).max() < 1e-9
    assert np.linalg.norm(run.error[0]) > 0.1


# The extended Jacobian's added task


def test_the_added_task_is_made_from_the_objective(robot_2r: nmm.Robot) -> None:
    given = Scenario.load("unicycle_2r_position", {"resolver.kind": "ej", "resolver.gain": 3})
    controller = given.controller()
    here = Configuration(robot_2r, [0.1, -0.3, 0.5, 0.7, 1.1])
    values = [nmm.evaluate(task.function, 0.0, here).value[0] for task in controller.given.added_task]
    assert values == [pytest.approx(0.5 + 0.7 + 1.1), 0.7]
    assert [nmm.evaluate(task.reference, 0.0, here).value[0] for task in controller.given.added_task] == [
        PI / 2,
        PI / 4,
    ]
    assert [task.gain for task in controller.given.added_task] == [3.0, 3.0]


def test_the_extended_jacobian_does_in_case_2_what_the_reduced_gradient_does() -> None:
    """One degree of redundancy and H2 = ½ (q2 + π/2)²: both make q2 decay with α = K_y."""
    given = Scenario.load("unicycle_2r_pointing", {"duration": 2})
    rg, ej = given.run(), given.with_resolver("ej").run()
    assert np.abs(rg.q - ej.q).max() < 1e-9


@pytest.mark.parametrize(
    ("objective", "came"),
    [
        ("null", "the objective has 0 quadratic terms"),
        ("{kind: quadratic, terms: [{of: q1}]}", "the objective has 1 quadratic terms"),
        ("{kind: manipulability, frame: ee, rows: xy}", "the objective has 0 quadratic terms"),
    ],
)
def test_an_added_task_that_cannot_be_made(tmp_path: Path, objective: str, came: str) -> None:
    with refused("given.yaml:5: resolver.added_task", kind=ScenarioError):
        scenario(tmp_path, objective=objective, resolver__kind="ej").controller()


def test_an_added_task_of_the_wrong_size(tmp_path: Path) -> None:
    added = "{kind: coordinates, of: q1, reference: 0}"
    with refused("given.yaml: set resolver.added_task", got=1, kind=ScenarioError):
        scenario(tmp_path, resolver=f"{{kind: ej, added_task: {added}}}").controller()


def test_a_point_may_be_a_frame(robot_2r: nmm.Robot, tmp_path: Path) -> None:
    """As in Python, `Distance("ee", "link1")`."""
    task = scenario(tmp_path, task="{kind: distance, frame: ee, to: link1, reference: 0.2}").controller().task
    for a, b in zip(
        evaluated(robot_2r, task.tasks[0].function, 0.0),
        evaluated(robot_2r, nmm.Distance("ee", "link1"), 0.0),
        strict=True,
    ):
        assert np.array_equal(a, b)
    with refused("given.yaml: set task.to: robot unicycle_2r", kind=ScenarioError):
        scenario(tmp_path, task="{kind: distance, frame: ee, to: hand, reference: 0.2}").controller()
