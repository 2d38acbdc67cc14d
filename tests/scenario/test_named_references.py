"""One reference in two places: by its path, which keeps them together, and by an anchor, which does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import Result
from short_scenario import MINIMAL, scenario

from nmm import Configuration, Scenario, ScenarioError, Trajectory
from nmm.base.bundled import bundled_scenarios
from nmm.cli.exit_status import status_of
from nmm.scenario.document import read_file

TWO = """\
robot: unicycle_2r
q0: {x: -1, y: -1, theta: pi}
duration: 12
dt: 0.02
task:
  - {kind: position, frame: ee, axes: xy, reference: CIRCLE}
  - {kind: heading, frame: link2, reference: {kind: bearing, of: AGAIN, towards: [6, 2]}}
objective: {kind: quadratic, terms: [{of: q2, target: -pi/2}]}
resolver: {kind: rg, partitions: [[v, omega, q1]]}
"""
CIRCLE = "{kind: circle, center: [2, 2], radius: 3, rate: 0.08*pi, phase: 5/4*pi}"
NAMED = TWO.replace("CIRCLE", CIRCLE).replace("AGAIN", "task.0.reference")
ANCHORED = TWO.replace("CIRCLE", f"&circle {CIRCLE}").replace("AGAIN", "*circle")
RADIUS = "task.0.reference.radius"


def miss(run: Trajectory) -> float:
    """By how much link 2 points past (6, 2) from where the hand is at the end, rad."""
    here = Configuration(run.robot, run.q[-1])
    hand, link = here.placement("ee").translation, here.placement("link2").rotation[:, 0]
    wanted = np.array([6.0, 2.0]) - hand[:2]
    return float(abs(np.angle(complex(*link[:2]) / complex(*wanted))))


def test_a_setting_of_a_named_reference_reaches_all_that_name_it(tmp_path: Path) -> None:
    """Link 2 points from where the hand is, which a bearing of the old circle does not."""
    run = scenario(tmp_path, NAMED).override(RADIUS, 2).run()
    assert miss(run) < 1e-3
    assert run.warnings == ()
    assert miss(scenario(tmp_path, ANCHORED).override(RADIUS, 2).run()) > np.radians(10)


def test_a_named_reference_is_the_same_run_as_one_written_twice(tmp_path: Path) -> None:
    twice = scenario(tmp_path, TWO.replace("CIRCLE", CIRCLE).replace("AGAIN", CIRCLE), duration=1).run()
    named = scenario(tmp_path, NAMED, duration=1).run()
    np.testing.assert_array_equal(named.q, twice.q)
    np.testing.assert_array_equal(named.u, twice.u)


def test_a_runs_folder_keeps_what_is_named(tmp_path: Path) -> None:
    """Run again with another radius, the scenario that a folder holds points rightly, too."""
    scenario(tmp_path, NAMED, duration=0.1).run().save(tmp_path / "run", figures=False)
    again = Scenario.load(tmp_path / "run" / "scenario.yaml", {RADIUS: "2", "duration": "12"})
    assert miss(again.run()) < 1e-3


@pytest.mark.parametrize("name", ["unicycle_2r_pointing", "unicycle_2r_extended_jacobian"])
def test_the_papers_scenarios_name_their_circle(name: str) -> None:
    """In a task that stands without a list as in a list, and in an added task."""
    run = Scenario.load(name, {RADIUS: "2", "dt": "0.02"}).run()
    assert miss(run) < 1e-3


def test_no_bundled_scenario_has_an_anchor() -> None:
    tied = [name for name, file in bundled_scenarios().items() if read_file(file).tied]
    assert len(bundled_scenarios()) > 20
    assert tied == []


@pytest.mark.parametrize(
    ("key", "written"),
    [
        ("objective", "{kind: alignment, along: PATH}"),
        ("objective", "{kind: alignment, along: {kind: velocity, of: PATH}}"),
        ("objective", "{kind: alignment, at: PATH}"),
        ("objective", "{kind: quadratic, terms: [{of: q2, target: PATH}]}"),
        ("objective", "{kind: quadratic, terms: [{of: q2}], weight: PATH}"),
        ("objective", "{kind: posture, posture: {q2: PATH}}"),
        ("task.1", "{kind: distance, frame: ee, to: PATH, reference: 1}"),
        ("task.1", "{kind: position, frame: link2, axes: xy, reference: PATH}"),
        ("task.1", "{kind: heading, frame: link2, reference: {kind: bearing, of: PATH, towards: [6, 2]}}"),
    ],
)
def test_wherever_a_function_may_stand_it_may_be_named(key: str, written: str, tmp_path: Path) -> None:
    """The named one and one that is written out are one value, at every time."""
    first = {"angle": "{kind: line, start: 0, end: 1, duration: 4}"}
    first["plane"] = "{kind: line, start: [1, 0], end: [2, 1], duration: 4}"
    first["space"] = "{kind: line, start: [1, 0, 0], end: [2, 1, 0.5], duration: 4}"
    task = {"angle": "{kind: coordinates, of: q1, ", "plane": "{kind: position, frame: ee, axes: xy, "}
    task["space"] = "{kind: position, frame: ee, axes: xyz, "
    shape = "angle" if "q2" in written else "space" if "to:" in written else "plane"
    found = []
    for path in ("task.0.reference", first[shape]):
        text = MINIMAL.partition("task:")[0] + "resolver: {kind: dls}\n"
        text += f"task: [{task[shape]}reference: {first[shape]}}}"
        value = written.replace("PATH", path)
        text += f", {value}]\n" if key == "task.1" else f"]\n{key}: {value}\n"
        controller = scenario(tmp_path, text).controller()
        found.append([controller(t, [0.1, 0.2, 0.3, 0.4, 0.5]) for t in (0.0, 1.7, 3.1)])
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(
    ("settings", "messages"),
    [
        ({"task.1.reference.of": "task.2.reference"}, ["set task.1.reference.of", "unknown reference"]),
        ({"task.1.reference.of": "task.0.refrence"}, ["did you mean 'task.0.reference'", "task.1.reference"]),
        ({"task.0.reference": "task.0.reference"}, ["task.0.reference → task.0.reference"]),
        (
            {"task.0.reference": "{kind: bearing, of: task.1.reference, towards: [1, 2]}"},
            ["task.0.reference", "does not lead back", "task.1.reference → task.0.reference → task.1"],
        ),
        ({"task.1.reference.of.radius": "2"}, ["is task.0.reference: set task.0.reference.radius"]),
        ({"task.0.gain": "task.0.reference"}, ["set task.0.gain", "expected"]),
    ],
)
def test_a_path_that_leads_nowhere_or_in_a_circle(
    settings: dict[str, str], messages: list[str], tmp_path: Path
) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(tmp_path, NAMED).with_settings(settings)
    assert "\n" not in str(caught.value)
    for message in messages:
        assert message in str(caught.value)


def test_a_setting_below_an_anchor_names_the_places_that_stay(tmp_path: Path) -> None:
    given = scenario(tmp_path, ANCHORED).override(RADIUS, 2)
    (warning,) = given.warnings
    assert warning.startswith(f"{RADIUS} was set alone")
    assert "task.1.reference.of.radius" in warning
    assert given.override("duration", 0.1).run().warnings[0] == warning
    # The other way round, the whole value, a scalar in it; not the place of the same anchor that is set too.
    assert (
        "task.0.reference.radius"
        in scenario(tmp_path, ANCHORED, task__1__reference__of__radius=2).warnings[0]
    )
    assert "task.1.reference.of the" in scenario(tmp_path, ANCHORED, task__0__reference=CIRCLE).warnings[0]
    for also in ("task.1.reference.of.radius", "task.1.reference.of"):
        value = 2 if also.endswith("radius") else CIRCLE
        assert given.override(also, value).warnings == ()
    assert scenario(tmp_path, ANCHORED, dt=0.01).warnings == ()
    assert scenario(tmp_path, NAMED, task__0__reference__radius=2).warnings == ()


def test_every_place_of_an_anchor_is_named(tmp_path: Path) -> None:
    text = MINIMAL.replace("{q1: 0.3, q2: 0.4}", "{q1: &a 0.3, q2: *a, x: *a}")
    (warning,) = scenario(tmp_path, text, q0__q2=1).warnings
    assert "given q0.q1 and q0.x the same value" in warning


@pytest.mark.parametrize("command", ["run", "singularities", "laps"])
def test_the_command_line_tells_it(command: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "given.yaml").write_text(ANCHORED, encoding="utf-8")
    more = {
        "run": ["--set", "duration=0.1"],
        "laps": ["--laps", "1", "--resolvers", "rg", "--set", "dt=0.05"],
    }
    out = [*more[command], "--out", str(tmp_path / "out")] if command in more else []
    status = status_of([command, str(tmp_path / "given.yaml"), "--set", f"{RADIUS}=2", *out])
    result = Result(status, *capfd.readouterr())
    assert result.err.count(f"{RADIUS} was set alone") == 1
    assert result.status in (0, 1)  # whether the laps close is not the matter
