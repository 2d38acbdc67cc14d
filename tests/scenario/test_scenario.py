"""Scenario files: numbers, strict YAML, settings, and runs that come out again."""

from __future__ import annotations

import math
import multiprocessing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from findings import refused
from short_scenario import MINIMAL, scenario

import nmm
from nmm import Scenario, ScenarioError
from nmm.base.bundled import bundled_scenarios
from nmm.base.kinds import RESOLVERS
from nmm.scenario.numbers import evaluate, number

# Numbers


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5/4*pi", 5 / 4 * math.pi),
        ("-pi", -math.pi),
        ("0.08*pi", 0.08 * math.pi),
        ("1e-3", 1e-3),
        ("1e5", 1e5),
        (".5", 0.5),
        ("+2.", 2.0),
        ("2**-2", 0.25),
        ("2 * (3 - 1) / 8", 0.5),
        ("sqrt(2)/2", math.sqrt(2) / 2),
        ("pi**2", math.pi**2),
    ],
)
def test_arithmetic_is_pythons(text: str, value: float) -> None:
    assert evaluate(text) == value


@pytest.mark.parametrize(
    "text",
    [
        "", "pie", "x", "1,2", "1;2", "1\n2", "[1]", "(1,)", "'a'", "True", "None", "1j", "1 == 1",
        "a=1", "a:=1", "1 if 1 else 2", "lambda: 1", "abs(1)", "sqrt", "sqrt(-1)", "sqrt()", "sqrt(x=1)",
        "pi.real", "().__class__", "(-1)**0.5", "10**400", "9**9**9**9", "1/0", "1//2", "7%2",
        "__import__('os')", "1<<3", "010", "nan", ".nan", "inf", "-.inf", "Infinity", "1e999", "1e308*10",
        "90 deg", "1:30", "(" * 101 + "1" + ")" * 101, "1+" * 200 + "1", "-" * 190 + "x",
    ],
)  # fmt: skip
def test_what_is_no_finite_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"expected a (finite )?number") as caught:
        number(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [True, None, [1], {"a": 1}, math.nan, -math.inf, 1j, b"1"])
def test_data_that_is_no_finite_number_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match=r"expected a (finite )?number"):
        number(value)


def test_numbers_of_numpy_are_numbers() -> None:
    assert number(np.float64(0.1)) == 0.1
    assert number(np.int64(3)) == 3.0


# YAML


@pytest.mark.parametrize(
    ("text", "fields"),
    [
        ("", {"where": "given.yaml", "got": None}),
        ("- a\n- b", {"where": "given.yaml", "got": ['a', 'b']}),
        ("just text", {"where": "given.yaml", "got": 'just text'}),
        ("q0: !!python/object/apply:os.system [ls]", {"where": "given.yaml:1"}),
        ("robot: a\ndt: !!float 1", {"where": "given.yaml:2"}),
        ("robot: a\ndt: !mine 1", {"where": "given.yaml:2"}),
        ("dt: 1\nq0: {}\ndt: 2", {"where": "given.yaml:3: dt"}),
        ("q0: {x: 1,\n x: 2}", {"where": "given.yaml:2: q0.x"}),
        ("dt: 1\n---\ndt: 2", {"where": "given.yaml:2"}),
        ("dt: [1\nq0: {", {"where": "given.yaml:2"}),
        ("dt:\n\t1", {"where": "given.yaml:2"}),
        ("dt: *nobody", {"where": "given.yaml:1"}),
        ("dt: &a [*a]", {"where": "given.yaml:1"}),
        ("? [a, b]\n: 1", {"where": "given.yaml:1"}),
        ("dt: " + "[" * 1200 + "]" * 1200, {"where": "given.yaml:1"}),
        ("dt: \x00", {"where": "given.yaml"}),
        (
            "a: &a [x,x,x,x,x,x,x,x,x]\n"
            + "".join(
                f"{b}: &{b} [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefg", "bcdefgh", strict=True)
            ),
            {"where": "given.yaml:1"},
        ),
    ],
)  # fmt: skip
def test_yaml_is_read_strictly(text: str, fields: dict[str, Any], tmp_path: Path) -> None:
    with refused(**fields, kind=ScenarioError) as caught:
        scenario(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_text_or_not_there(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_bytes(b"robot: \xff\xfe")
    with refused("a.yaml", kind=ScenarioError):
        Scenario.load(tmp_path / "a.yaml")
    with refused("b.yaml", kind=ScenarioError):
        Scenario.load(tmp_path / "b.yaml")
    with refused("test_a_file_that_is_not_text_o0", kind=ScenarioError):
        Scenario.load(tmp_path)


def test_anchors_may_be_used(tmp_path: Path) -> None:
    text = MINIMAL.replace("reference: [1, 0.5]", "reference: &here [1, 0.5]") + "title: x\n"
    given = scenario(tmp_path, text.replace("q0: {q1: 0.3, q2: 0.4}", "q0: {q1: &a 0.3, q2: *a}"))
    assert given.parts.q0 == {"q1": 0.3, "q2": 0.3}


def test_words_that_yaml_reads_as_booleans_are_words(tmp_path: Path) -> None:
    assert scenario(tmp_path, MINIMAL + "title: no\n").title == "no"


# Settings


def test_settings_reach_every_level(tmp_path: Path) -> None:
    given = scenario(
        tmp_path, dt="1e-3", resolver__alpha="5", task__gain="2", q0__x="-pi", robot__arguments__d="0.7"
    )
    assert (given.parts.dt, given.parts.task[0].gain, given.parts.q0["x"]) == (1e-3, 2.0, -math.pi)
    assert given.parts.resolver.alpha == 5.0
    assert given.robot().arguments["d"] == "0.7"
    assert given.override("robot.arguments", {"d": 0.7}).robot().arguments["d"] == "0.7"
    mass = given.robot().model.inertias[3].mass
    assert mass > 0  # the robot with the other geometry is loaded, not the paper's
    base = given.robot().model.jointPlacements[4].translation[0]
    assert base == pytest.approx(0.7)


def test_settings_of_lists_count_from_zero() -> None:
    given = Scenario.load("unicycle_2r_pointing").override("task.1.gain", "7")
    assert [part.gain for part in given.parts.task] == [1.0, 7.0]
    with refused("unicycle_2r_pointing.yaml: set task.2.gain", got="2", kind=ScenarioError):
        given.override("task.2.gain", "7")
    with refused("unicycle_2r_pointing.yaml: set task.gain", got="gain", kind=ScenarioError):
        given.override("task.gain", "7")


@pytest.mark.parametrize(
    ("key", "fields"),
    [
        (
            "resolver.alfa",
            {"where": "unicycle_2r_position.yaml: set resolver.alfa", "got": "alfa"},
        ),
        (
            "resolvr.alpha",
            {"where": "unicycle_2r_position.yaml: resolvr, with resolvr.alpha set", "got": "resolvr"},
        ),
        ("dt.x", {"where": "unicycle_2r_position.yaml: set dt.x"}),
        ("a..b", {"where": "unicycle_2r_position.yaml: set a..b"}),
        ("", {"where": "unicycle_2r_position.yaml: set "}),
    ],
)
def test_settings_that_lead_nowhere(key: str, fields: dict[str, Any]) -> None:
    with refused(**fields, kind=ScenarioError):
        Scenario.load("unicycle_2r_position", {key: "5"})


GARBAGE = (
    "", "true", "x", "-1", "[]", "{}", "[x]", "[[1]]", "[null]", "{a: 1}", "{kind: [1]}", "{kind: position}",
    "1e999", "[1, 2, 3]", "[v, q1]", '"a\\0b.urdf"', '"a\\nb"', math.nan, b"x", object(), [{}],
    {"a": object()},
)  # fmt: skip


def places(value: object, kinds: str = "", path: tuple[str, ...] = ()) -> set[tuple[str, str]]:
    """The path of everything in nested data, with the kinds that it is in; of values in a list, the first."""
    if isinstance(value, dict):
        kinds += f"{value.get('kind', '')}/"
        inner = [*value.items()]
    else:
        inner = [*enumerate(value)] if isinstance(value, list) else []
        inner = [(k, item) for k, item in inner if k == 0 or isinstance(item, dict)]
    found = {(".".join(path), kinds)} if path else set()
    return found.union(*(places(item, kinds, (*path, str(key))) for key, item in inner))


def places_of(given: Scenario) -> set[tuple[str, str]]:
    return places(yaml.safe_load(given.path.read_text())) | places(given.resolved())


#: In which everything is tried; in the others, what is elsewhere or of another kind.
WHOLE = "unicycle_2r_link_pointing"


@pytest.mark.parametrize("name", [WHOLE, "unicycle_2r_extended_jacobian", "unicycle_3r_spline"])
def test_garbage_at_any_key_is_taken_or_refused_in_one_line(name: str) -> None:
    given = Scenario.load(name)
    given.robot()
    tried = places_of(given) - (places_of(Scenario.load(WHOLE)) if name != WHOLE else set())
    keys = {path for path, _ in tried}
    assert len(keys) > 30
    for key in keys:
        for value in GARBAGE:
            try:
                given.override(key, value).controller()
            except ScenarioError as error:
                where, text = error.where, str(error)
                assert where.startswith(str(given.path)), (key, value)
                assert "\n" not in text, (key, value)


def test_settings_change_nothing_but_the_copy() -> None:
    given = Scenario.load("unicycle_2r_position")
    before = given.resolved()
    other = given.override("task.0.reference.radius", 2)
    assert given.resolved() == before
    assert other.resolved()["task"]["reference"]["radius"] == 2.0


def test_a_task_alone_is_the_first_of_a_list(tmp_path: Path) -> None:
    """A file may hold the mapping itself, as nmm init and a run's folder write it."""
    file = tmp_path / "alone.yaml"
    file.write_text(yaml.safe_dump(Scenario.load("unicycle_2r_position").resolved()), encoding="utf-8")
    assert "task:\n  " in file.read_text(encoding="utf-8")
    given = Scenario.load(str(file), {"task.0.gain": 4, "objective.0.terms.1.weight": 2})
    assert given.parts.task[0].gain == 4.0
    assert given.resolved()["objective"]["terms"][1]["weight"] == 2.0
    with refused("alone.yaml: set task.gian", got="gian", kind=ScenarioError):
        Scenario.load(str(file), {"task.0.gian": 4})
    with refused("alone.yaml:60: task.1, with task.1.gain set", got="1", kind=ScenarioError):
        Scenario.load(str(file), {"task.1.gain": 4})


def test_settings_take_data_and_arrays() -> None:
    given = Scenario.load("unicycle_2r_position", {"q0": np.arange(5.0), "task.0.gain": np.eye(2) * 3})
    assert given.parts.q0 == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert given.parts.task[0].gain == [[3.0, 0.0], [0.0, 3.0]]


def test_another_resolver_keeps_what_it_knows() -> None:
    given = Scenario.load("unicycle_2r_position", {"resolver.alpha": 4})
    assert given.with_resolver("rg") is given
    pg = given.with_resolver("pg")
    knows = {"kind": "pg", "tolerance": 1e-10, "alpha": 4.0, "weights": None, "step": "constant"}
    assert pg.parts.resolver.model_dump() == knows
    assert given.with_resolver("ej").parts.resolver.kind == "ej"
    with refused("unicycle_2r_position.yaml: set resolver.kind", got="sqp", kind=ScenarioError):
        given.with_resolver("sqp")


def test_the_robot_is_loaded_once_and_shared() -> None:
    given = Scenario.load("unicycle_2r_position")
    assert given.robot() is given.robot()
    assert given.with_resolver("pg").robot() is given.robot()
    assert given.override("robot.arguments.d", "0.4").robot() is not given.robot()


def test_robot_files_are_relative_to_the_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robots, elsewhere = tmp_path / "robots", tmp_path / "elsewhere"
    robots.mkdir()
    elsewhere.mkdir()
    arm = (
        '<robot name="arm"><link name="base"/><link name="ee"/><joint name="q1" type="continuous">'
        '<parent link="base"/><child link="ee"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint></robot>'
    )
    (robots / "arm.urdf").write_text(arm)
    monkeypatch.chdir(elsewhere)
    text = MINIMAL.replace("q0: {q1: 0.3, q2: 0.4}", "q0: {q1: 0.3}")
    given = scenario(tmp_path, text.replace("unicycle_2r", "robots/arm.urdf"))
    assert given.robot().q_names == ("x", "y", "theta", "q1")
    assert given.resolved()["robot"]["source"] == str(robots / "arm.urdf")
    # A path that is set is relative to the working folder.
    assert scenario(tmp_path, text, robot="../robots/arm.urdf").robot().q_names[-1] == "q1"
    with refused("elsewhere/robots/arm.urdf", kind=ScenarioError):
        scenario(tmp_path, text, robot="robots/arm.urdf").robot()


def test_settings_reach_below_a_robots_bare_name() -> None:
    """`robot: name`, `platform: name`, `arm: name` are mappings with one key, written short."""
    steered = Scenario.load("car_steered_by_the_null_space")
    changed = steered.override("robot.platform.arguments.wheelbase", 0.8).override("robot.arm.lock.q5", 0.1)
    assert changed.robot().platform.parameters[0] == 0.8  # the wheelbase, measured in the file
    assert changed.robot().q_names[-1] == "q4"
    assert steered.override("robot.platform.source", "omni_base").robot().platform.name == "mecanum"
    kind = Scenario.load("unicycle_2r_position", {"robot.platform": "unicycle"})
    assert kind.override("robot.platform.kind", "unicycle").robot().platform.name == "unicycle"
    with refused("unicycle_2r_position.yaml: set robot.platform.kind.name", kind=ScenarioError):
        kind.override("robot.platform.kind.name", 1)


# Runs that come out again


#: Their objectives are quadratic, with a term for each degree of redundancy: EJ's added task.
WITH_AN_ADDED_TASK = ("position", "pointing", "link_pointing", "extended_jacobian", "sampled", "switching")
#: With each resolver; every other scenario with one of those that need no added task, in turn.
WITH_EVERY_RESOLVER = ("unicycle_2r_position", "unicycle_3r_position", "unicycle_2r_pointing")


def resolvers_of(k: int, name: str) -> list[str]:
    """Those with which the k-th scenario runs twice."""
    without = [kind for kind in RESOLVERS if not RESOLVERS[kind].takes_added_task]
    if name not in WITH_EVERY_RESOLVER:
        without = [without[k % len(without)]]
    added = name.partition("r_")[2] in WITH_AN_ADDED_TASK
    return without + [kind for kind in RESOLVERS if RESOLVERS[kind].takes_added_task and added]


@pytest.mark.parametrize(
    ("name", "resolver"),
    [(name, kind) for k, name in enumerate(bundled_scenarios()) for kind in resolvers_of(k, name)],
)
def test_a_resolved_scenario_gives_the_same_run(name: str, resolver: str, tmp_path: Path) -> None:
    given = Scenario.load(name, {"duration": 0.2}).with_resolver(resolver)
    first = given.run()
    assert first.scenario == given.resolved()
    (tmp_path / "again.yaml").write_text(yaml.safe_dump(first.scenario, sort_keys=False))
    again = Scenario.load(tmp_path / "again.yaml")
    second = again.run()
    assert again.resolved() == first.scenario
    for array in ("t", "q", "u", "r", "r_d", "error", "objective", "sigma_min", "partition"):
        # not a number where a task that comes and goes is not there
        one, other = getattr(first, array), getattr(second, array)
        assert np.array_equal(one, other, equal_nan=array in ("r", "r_d", "error")), array


def test_resolved_holds_every_default_as_plain_data() -> None:
    data = Scenario.load("unicycle_2r_pointing", {"resolver.kind": "rg"}).resolved()
    assert (data["dt"], data["method"], data["tolerance"]) == (0.005, "rk4", 1e-9)
    assert data["resolver"]["threshold"] == 0.01
    assert data["robot"] == {
        "source": "unicycle_2r",
        "calibration": None,
        "arguments": {},
        "platform": None,
        "package_dirs": [],
        "steer": [],
        "wheels": None,
        "lock": {},
        "axle": None,
        "limits": {},
        "missing_meshes": "error",
        "srdf": None,
    }

    def plain(value: object) -> bool:
        if isinstance(value, dict):
            return all(type(key) is str and plain(item) for key, item in value.items())
        return (
            all(map(plain, value))
            if isinstance(value, list)
            else type(value) in (str, float, int, bool, type(None))
        )

    assert plain(data)


# Other processes


def told(scenarios: list[Scenario]) -> list[dict[str, Any]]:
    """In a process of its own, found by its name; the last one runs."""
    assert scenarios[-1].run().complete
    return [scenario.resolved() for scenario in scenarios]


def test_a_scenario_travels_to_a_process_of_its_users(tmp_path: Path) -> None:
    """All that are bundled, each kind of resolver, one with a loaded robot, and one of one's own."""
    short = scenario(tmp_path, q0__q1=0.5)
    short.robot()
    sent = [Scenario.load(name) for name in bundled_scenarios()]
    sent += [short.with_resolver(kind) for kind in RESOLVERS if kind != "ej"]
    sent.append(short.with_resolver(nmm.ProjectedGradient(alpha=3.0)))
    with multiprocessing.get_context("spawn").Pool(1) as process:
        assert process.apply(told, (sent,)) == [one.resolved() for one in sent]


@pytest.mark.parametrize("name", ["arm.urdf", "arm.xacro", "arm.yaml"])
@pytest.mark.parametrize("text", ['<robot name="a: b"/>', '<?xml version="1.0"?>\n<!-- a: b -->\n<robot/>'])
def test_a_robots_file_is_no_scenario(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as found:
        Scenario.load(tmp_path / name)
    assert found.value.where == str(tmp_path / name)
    assert f"nmm init {tmp_path / name}" in found.value.expected
