"""nmm singularities: what it prints is what the analysis says, and what it refuses."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_tables import expect_report, printed, table
from command_line import Result, Terminal, imported
from numpy import pi
from small_pictures import draw_only

from nmm import Scenario
from nmm.analysis import analyse, analyse_along
from nmm.base.findings import Finding
from nmm.cli.exit_status import status_of
from nmm.control.functions.tasks import Heading, Position
from nmm.model.robots.loading import load
from nmm.motion.trajectory import Trajectory

Command = Callable[..., Result]

POSITION = ("unicycle_2r", "--task", "position")
TIP = Position("ee", "xy")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run `nmm singularities` in an empty folder, in this process; pictures are empty."""
    monkeypatch.chdir(tmp_path)
    draw_only([], monkeypatch)
    return lambda *arguments: Result(status_of(["singularities", *arguments]), *capfd.readouterr())


@pytest.fixture(scope="module")
def switching(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that changes RG's partition and passes zeros of minors."""
    folder = tmp_path_factory.mktemp("runs") / "switching"
    Scenario.load("unicycle_2r_switching", {"dt": 0.02}).run().save(folder, figures=False)
    return folder


def findings(run: Command, *arguments: str) -> dict[str, dict[str, Any]]:
    """What `--json` says was found, by code."""
    found = parsed(run(*arguments, "--json"))["findings"]
    assert len({one["code"] for one in found}) == len(found)
    return {one["code"]: one for one in found}


def parsed(result: Result) -> Any:
    def refuse(text: str) -> None:
        raise AssertionError(f"{text} is no JSON")

    assert (result.status, result.err) == (0, "")
    return json.loads(result.out, parse_constant=refuse)


# at a configuration


def test_the_numbers_are_those_of_the_analysis(run: Command) -> None:
    result = run(*POSITION, "--at", "theta=pi/6", "--at", "q1=0.4", "--at", "q2=-1.1")
    report = analyse((load("unicycle_2r"), TIP), {"theta": pi / 6, "q1": 0.4, "q2": -1.1})
    expect_report(result, report)
    assert "inputs: v (m/s); omega, q1, q2 (rad/s)" in result.out
    assert "task: ee.x, ee.y (m)" in result.out
    assert "theta = 0.5236 rad (30°), q1 = 0.4 rad (22.92°)" in result.out
    minors = {row["minor"]: row for row in table(result, "value")}
    assert list(minors) == [f"Δ[{', '.join(name)}]" for name in report.minors]
    for (name, expected), share in zip(report.minors.items(), report.partitions.ratios, strict=True):
        row = minors[f"Δ[{', '.join(name)}]"]
        assert printed(row["value"]) == pytest.approx(expected, rel=1e-3)
        assert printed(row["|Δ|/√(det J Jᵀ)"]) == pytest.approx(share, rel=1e-2)
    found = findings(run, *POSITION, "--at", "theta=pi/6", "--at", "q1=0.4", "--at", "q2=-1.1")
    for finding in found.values():
        assert finding["text"] in result.out
    squares = found["minor_squares"]["values"]
    assert squares["squares"] == pytest.approx(squares["gram"], rel=1e-12)
    assert squares["gram"] == pytest.approx(np.linalg.det(report.J @ report.J.T), rel=1e-12)
    rates = dict(zip(report.inputs, report.by_input.rates, strict=True))
    strongest = max(rates, key=lambda name: abs(rates[name]))
    assert found["sigma_changes"]["values"]["motions"][0] == [strongest, rates[strongest], "rad", 0]


def test_what_the_platform_gives_back(run: Command) -> None:
    found = findings(run, *POSITION, "--at", "q1=pi/6", "--at", "theta=-pi/6")
    assert found["given_back"]["values"] == {"directions": ["ee.x"], "too_few": False}
    rg = found["rg_algorithmic"]["values"]
    assert (rg["singular"], rg["best"], rg["own"]) == ([["q1", "q2"]], ["v", "omega"], False)
    fixed = run(*POSITION, "--platform", "fixed", "--at", "q1=pi/6")
    assert [row["part"] for row in table(fixed, "part")] == ["arm"]
    alone = findings(run, *POSITION, "--platform", "fixed", "--at", "q1=pi/6")
    assert alone["rank_lost_here"]["values"] == {"rank": 1, "rows": 2, "lost": ["0.87 ee.x + 0.5 ee.y"]}
    assert not {"given_back", "nothing_given_back"} & set(alone)
    assert [name for name, *_ in alone["rank_restored"]["values"]["motions"]] == ["q2"]


def test_a_singular_configuration_is_an_answer(run: Command) -> None:
    result = run(*POSITION, "--set", "d=0", "--at", "theta=pi/4", "--at", "q1=pi/2")
    report = analyse((load("unicycle_2r", arguments={"d": 0}), TIP), {"theta": pi / 4, "q1": pi / 2})
    expect_report(result, report)
    found = findings(run, *POSITION, "--set", "d=0", "--at", "theta=pi/4", "--at", "q1=pi/2")
    assert found["rank_lost_here"]["values"]["lost"] == ["0.71 ee.x - 0.71 ee.y"]
    rates = report.by_input.rates
    motions = [["q1", rates[2], "rad", 1], ["q2", rates[3], "rad", 1]]
    assert found["rank_restored"]["values"]["motions"] == motions
    assert found["all_minors_zero"]["values"] == {"count": 6}
    assert "rg_kinematic" in found
    vertical = findings(run, "unicycle_3r", "--task", "position")
    assert vertical["rank_lost_here"]["values"] == {"rank": 2, "rows": 3, "lost": ["ee.z"]}
    assert vertical["given_back"]["values"]["directions"] == ["ee.y"]


def test_only_what_the_wheels_do_not_admit() -> None:
    """No task of the command line needs it: the report says it of a restoration that is made up."""
    from nmm.cli.singularity_report import described
    from nmm.cli.subjects import studied

    given = studied("unicycle_2r", tasks=["position"], at=["q1=pi/2"], settings=["d=0"])
    report = analyse(given.subject, given.q)
    none, sideways = np.zeros(4, np.int64), np.array([0, 1, 0, 0, 0])
    report = replace(
        report,
        by_input=replace(report.by_input, rates=np.zeros(4), regained=none),
        by_coordinate=replace(report.by_coordinate, rates=1.0 * sideways, regained=sideways),
    )
    found = {
        item.code: item.values for item in described(given, report, None, 0) if isinstance(item, Finding)
    }
    assert "rank_not_restored" in found
    assert found["restored_across"] == {"coordinates": ["y"]}


def test_a_scenario_with_its_start_and_its_added_task(run: Command) -> None:
    name = "unicycle_2r_extended_jacobian"
    scenario = Scenario.load(name)
    start = run(name, "--length", "0.8")
    report = analyse(scenario.controller(), scenario.parts.q0, length=0.8)
    expect_report(start, report)
    extended = report.extended
    assert extended is not None
    found = findings(run, name, "--length", "0.8")
    assert found["sizes_in_length"]["values"] == {"length": 0.8}
    matrix = found["ej_matrix"]["values"]
    assert (matrix["determinant"], matrix["rank"], matrix["count"]) == (extended.determinant, 4, 4)
    assert found["ej_angle"]["values"] == {"measure": extended.angle_measure}
    singular = findings(run, name, "--at", f"q1={float(np.arccos(-0.3 / 0.5))}")
    assert singular["nonsingular"]["values"]["rank"] == 2
    assert "ej_algorithmic" in singular


def test_rg_with_the_partitions_of_a_scenario(run: Command) -> None:
    name = "unicycle_2r_switching"
    singular = findings(run, name, "--set", "resolver.partitions=[[v, q2]]", "--at", "q1=pi/2")
    assert singular["rg_exhausted"]["values"] == {"own": True, "singular": [["v", "q2"]], "count": 1}
    fine = findings(run, name, "--at", "q1=0.3")
    assert fine["rg_regular"]["values"]["own"] is True
    other = run(name, "--task", "heading:link1", "--at", "q1=0.3")
    assert "task: link1.heading (rad)" in other.out
    of_rg = findings(run, name, "--task", "heading:link1", "--at", "q1=0.3")
    assert [one["values"]["own"] for code, one in of_rg.items() if code.startswith("rg_")] == [False]


def test_inputs_that_do_nothing_and_the_only_arm_by_its_name(run: Command) -> None:
    result = run("car_steered_by_the_null_space")
    found = findings(run, "car_steered_by_the_null_space")
    assert found["inputs_idle_here"]["values"] == {"inputs": ["steering_rate", "q5"]}
    assert found["some_minors_zero"]["values"]["others"][0] == ["v", "q2", "q3"]
    assert [row["part"] for row in table(result, "part")] == ["platform", "arm (small_arm)", "robot"]
    scenario = Scenario.load("car_steered_by_the_null_space")
    report = analyse(scenario.controller(), scenario.parts.q0)
    assert len(table(result, "value")) == sum(abs(x) > 1e-9 for x in report.minors.values())


def test_which_minors(run: Command) -> None:
    robot = load("unicycle_2r")
    one = run(*POSITION, "--at", "q2=0.7", "--minor", "q2,v", "--minor", "v,omega")
    expected = analyse((robot, TIP), {"q2": 0.7}).minors
    minors = {row["minor"]: printed(row["value"]) for row in table(one, "value")}
    assert minors == pytest.approx(
        {"Δ[q2, v]": -expected["v", "q2"], "Δ[v, omega]": expected["v", "omega"]}, rel=1e-3
    )
    none = run(*POSITION, "--no-minors")
    assert "Δ[" not in none.out
    assert findings(run, *POSITION, "--no-minors")["gram"]["values"]["count"] == 6
    many = run("tiago_pointing")
    first = ["v", "omega", "torso_lift_joint", "arm_1_joint"]
    assert findings(run, "tiago_pointing")["minors_not_listed"]["values"] == {"first": first}
    assert many.out.count("Δ[") == 0
    every = run("tiago_pointing", "--minors")
    # Two rows are the platform's own: only minors with v and omega are not 0, and two of eight joints.
    assert len(table(every, "value")) == 28
    assert len(findings(run, "tiago_pointing", "--minors")["some_minors_zero"]["values"]["others"]) == 182


def test_limits_are_told_but_do_not_hinder(run: Command) -> None:
    result = run("car_base", "--task", "position:base_link", "--at", "steering=0.7")
    assert result.status == 0
    assert result.err.startswith("warning: car_base: outside its limits: steering = 0.7 rad")
    nowhere = run("car_base", "--task", "position:base_link", "--at", "steering=pi/2")
    assert nowhere.status == 1
    assert "wheels" in nowhere.err


# for scripts


def test_json_is_the_report(run: Command) -> None:
    name = "unicycle_2r_extended_jacobian"
    data = parsed(run(name, "--json", "--at", "q1=0.3", "--length", "0.8"))
    scenario = Scenario.load(name)
    q = {**scenario.parts.q0, "q1": 0.3}
    report = analyse(scenario.controller(), q, length=0.8)
    assert data["name"] == name
    assert list(data["q"].values()) == report.q.tolist()
    for key in ("J", "rank", "singular_values", "sigma_min", "condition", "lost", "given_back", "row_sizes"):
        expected = np.asarray(getattr(report, key))
        np.testing.assert_array_equal(np.reshape(data[key], expected.shape), expected, err_msg=key)
    assert data["minors"] == {", ".join(name): value for name, value in report.minors.items()}
    for part, found in data["parts"].items():
        own = report.parts[part]
        assert found["condition"] == (own.condition if np.isfinite(own.condition) else None)
        assert found["lost"] == own.lost.tolist()
    assert data["by_coordinate"]["rates"] == report.by_coordinate.rates.tolist()
    assert data["extended"]["determinant"] == report.extended.determinant
    assert [row["determinant"] for row in data["partitions"]] == report.partitions.determinants.tolist()


def test_json_has_nothing_that_is_not_json(run: Command) -> None:
    data = parsed(run(*POSITION, "--set", "d=0", "--at", "q1=pi/2", "--json"))
    assert data["singular"] is True
    assert data["condition"] is None
    assert data["by_input"]["effective"] == ["q1", "q2"]


# along a run


def test_along_a_run(run: Command, switching: Path) -> None:
    result = run(str(switching))
    assert (result.status, result.err) == (0, "")
    trajectory = Trajectory.load(switching)
    history = analyse_along(Scenario.load(switching / "scenario.yaml").controller(), trajectory)
    for row in table(result, "part"):
        sigma = history.sigma_min[row["part"]]
        assert printed(row["smallest σ_min"]) == pytest.approx(sigma.min(), rel=1e-3, abs=1e-9)
        assert printed(row["at"]) == pytest.approx(history.t[sigma.argmin()])
    crossings = table(result, "at")
    assert len(crossings) == len(history.crossings) > 5
    for row, crossing in zip(crossings, history.crossings, strict=True):
        assert printed(row["at"]) == pytest.approx(crossing.t, rel=1e-3)
        assert row["minor that changes its sign"] == f"Δ[{', '.join(crossing.columns)}]"
        assert (row["to"] == "+") == (crossing.sign > 0)
    used = table(result, "from")
    assert [row["RG's partition"] for row in used] == ["[v, omega]", "[v, q1]"]
    # RG left [v, omega] before its minor changed its sign.
    crossed = next(c.t for c in history.crossings if c.columns == ("v", "omega"))
    assert printed(used[0]["to"]) < crossed
    data = parsed(run(str(switching), "--json"))
    found = {one["code"]: one["values"] for one in data["findings"]}
    assert found["run_regular"]["rows"] == 2
    assert found["arm_dips"] == {"sigma_min": 0.0, "t": 0.0}
    assert data["sigma_min"]["arm"] == history.sigma_min["arm"].tolist()
    assert [one["t"] for one in data["crossings"]] == [one.t for one in history.crossings]


def test_a_run_at_an_instant_and_with_another_task(run: Command, switching: Path) -> None:
    trajectory = Trajectory.load(switching)
    result = run(str(switching), "--time", "3.01", "--json")
    q = np.array([np.interp(3.01, trajectory.t, column) for column in trajectory.q.T])
    np.testing.assert_allclose(list(parsed(result)["q"].values()), q, atol=1e-15)
    other = run(str(switching), "--task", "heading:link2")
    assert "task: link2.heading (rad)" in other.out
    for task in ("heading:link2", "position:link2"):  # RG's partition was of another task
        assert "RG" not in run(str(switching), "--task", task).out.replace("run of RG", "")
    assert findings(run, str(switching), "--task", "heading:link2")["run_regular"]["values"]["rows"] == 1


def test_a_run_through_a_singularity(run: Command, tmp_path: Path) -> None:
    """No resolver goes there: the motion is written by hand, q1 from 1 to pi/2, the arm stretched, d = 0."""
    settings = {"robot.arguments.d": 0, "dt": 0.1, "duration": 1, "resolver.kind": "pg"}
    trajectory = Scenario.load("unicycle_2r_position", settings).run()
    q = np.zeros((len(trajectory), 5))
    q[:, 3] = np.linspace(1.0, pi / 2, len(trajectory))
    replace(trajectory, q=q).save(tmp_path / "through", figures=False)
    found = findings(run, "through")
    expected = {"singular": 1, "samples": 11, "t": 1.0, "rank": 1, "rows": 2}
    assert found["run_singular"]["values"] == expected
    ((t, sigma, at_end),) = found["sigma_dips"]["values"]["dips"]
    assert (t, at_end) == (1.0, True)
    assert sigma < 1e-9
    assert "arm_dips" not in found


def test_a_run_of_ej(run: Command, tmp_path: Path) -> None:
    settings = {"dt": 0.05, "duration": 2}
    Scenario.load("unicycle_2r_extended_jacobian", settings).run().save(tmp_path / "ej", figures=False)
    data = parsed(run("ej", "--json"))
    (found,) = [one["values"] for one in data["findings"] if one["code"] == "ej_sigma"]
    assert found["sigma_min"] == min(data["extended_sigma_min"])


def test_minors_that_are_zero_throughout_have_no_crossings(run: Command, tmp_path: Path) -> None:
    """A column of rounding (q5 turns the tool about itself) changes its sign all the time."""
    Scenario.load("car_steered_by_the_null_space", {"duration": 2}).run().save(
        tmp_path / "car", figures=False
    )
    found = findings(run, "car")
    assert "no_crossing" in found
    assert len(found["zero_throughout"]["values"]["minors"]) == 26


# wrong input

ROWS = "task: expected at most 4 rows, as many as inputs"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Missing argument 'SUBJECT'"),
        (["unicycle_2r"], "unicycle_2r is a robot: expected --task"),
        (["unicycle2r"], "unknown robot or scenario 'unicycle2r' (did you mean 'unicycle_2r'?)"),
        ([*POSITION, "--task", "heading:link2", "--task", "posture"], ROWS),
        ([*POSITION, "--task", "heading:link2", "--task", "posture", "--symbolic"], ROWS),
        (["unicycle_2r", "--task", "position:hand"], "unknown frame 'hand'"),
        ([*POSITION, "--at", "q9=1"], "unknown coordinate 'q9'; available: x, y, theta, q1, q2"),
        ([*POSITION, "--minor", "v,q9"], "unknown input 'q9'; available: v, omega, q1, q2"),
        ([*POSITION, "--minor", "v"], "expected 2 different inputs"),
        ([*POSITION, "--minor", "v,q1", "--minors"], "--minor: expected without"),
        ([*POSITION, "--length", "0"], "length: expected a number above 0"),
        ([*POSITION, "--time", "soon"], "'--time'"),
        ([*POSITION, "--latex"], "--latex: expected --symbolic"),
        ([*POSITION, "--symbolic", "--json"], "--json: expected without --symbolic"),
        ([*POSITION, "--symbolic", "--search"], "--symbolic: expected without --search"),
        ([*POSITION, "--starts", "5"], "--starts: expected with --search"),
        ([*POSITION, "--seed", "5"], "--seed: expected with --search or --nearest"),
        ([*POSITION, "--part", "arm"], "--part: expected with --search or --nearest"),
        ([*POSITION, "--set", "e=1"], "unknown xacro argument 'e'"),
        (["unicycle_2r_position", "--platform", "fixed"], "--platform: of a robot's file"),
        (["RUN", "--symbolic"], "is a run; expected a robot or a scenario"),
        (["RUN", "--symbolic", "--time", "1"], "is a run; expected a robot or a scenario"),
        (["RUN", "--at", "q1=0"], "--at:"),
        (["RUN", "--time", "99"], "--time: expected an instant of the run, 0 to 20 s, got 99"),
        (["RUN", "--set", "dt=1"], "which is as it was; expected a robot or a scenario"),
        (["RUN", "--minor", "v,q9"], "unknown input 'q9'"),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, list) else "",
)
def test_wrong_input_is_one_line(arguments: list[str], message: str, run: Command, switching: Path) -> None:
    result = run(*(str(switching) if text == "RUN" else text for text in arguments))
    assert (result.status, result.out) == (2, "")
    assert result.err.startswith("nmm singularities: ")
    assert result.err.count("\n") == 1
    assert message in result.err


# how it comes


def test_it_imports_what_it_needs(tmp_path: Path) -> None:
    modules = imported(tmp_path, "singularities", *POSITION)
    assert "pinocchio" in modules
    assert not {"sympy", "matplotlib", "meshcat"} & modules


def test_narrow_terminals_lose_nothing(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path, 72, "singularities", "ur5_unicycle_pose")
    lines = re.sub(r"\x1b\[[0-9;]*m", "", terminal.read_until(None)).splitlines()
    assert terminal.process.wait() == 0
    assert max(map(len, lines)) <= 72
    scenario = Scenario.load("ur5_unicycle_pose")
    report = analyse(scenario.controller(), scenario.parts.q0)
    shown = " ".join(" ".join(lines).split())
    for name in report.inputs:
        assert name in shown
    for number in np.abs(report.minors.array[np.abs(report.minors.array) > 1e-6]):
        assert f"{number:.4g}" in shown


def test_help_teaches(run: Command) -> None:
    result = run("--help")
    assert result.status == 0
    for word in ("SUBJECT", "--task", "--at", "--symbolic", "--json", "--search", "--minor", "--length"):
        assert word in result.out
    assert "nmm singularities unicycle_2r --task position --set d=0 --symbolic" in result.out


def test_headings_too(run: Command) -> None:
    """Rows of other units, and a note on what their singular values compare."""
    result = run(*POSITION, "--task", "heading:link2", "--at", "q1=1")
    report = analyse((load("unicycle_2r"), (TIP, Heading("link2"))), {"q1": 1.0})
    expect_report(result, report)
    assert "task: ee.x, ee.y (m); link2.heading (rad)" in result.out
    assert "sizes_mixed" in findings(run, *POSITION, "--task", "heading:link2", "--at", "q1=1")


def test_search_and_nearest_get_what_they_need(run: Command) -> None:
    arm = ("unicycle_2r", "--platform", "fixed", "--task", "position", "--at", "q2=0.4")
    result = run(*arm, "--search", "--starts", "20", "--nearest", "--seed", "3")
    assert (result.status, result.err) == (0, "")
    assert "20 starts" in result.out
    assert "distance 0.4," in result.out  # to the stretched arm
    alone = run(*arm, "--nearest", "--length", "0.5").out
    assert "starts" not in alone.splitlines()[0]
    assert "distance 0.4," in alone
    part = run(*POSITION, "--search", "--part", "arm", "--starts", "20")
    assert "q2 = 0" in part.out
    for wrong in (("--part", "leg"), ("--starts", "0"), ("--length", "-1"), ("--no-minors",)):
        assert run(*arm, "--search", *wrong).status == 2
