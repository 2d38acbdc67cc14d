"""The table of recorded quantities: complete, and enough to add one."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from places import ROOT

import nmm
from nmm.base.arrays import Array, Integers
from nmm.control.step.quantities import QUANTITIES, Curve, Number, Record, RecordedQuantity, saved
from nmm.control.step.recorded import Recorded
from nmm.control.step.step import Step
from nmm.motion.diagnosis.summary import RUN_NUMBERS
from nmm.motion.table import summary_rows
from nmm.plugins.live.running import Growing
from nmm.plugins.sweeps.rows import MEASURED
from nmm.views.playback.channels import channels
from nmm.views.tables import comparison_table

#: What each older version of the files lacks, by the version that has it first.
SINCE = {one.name: one.since for one in saved() if one.since > 1}


def test_the_attributes_of_a_trajectory_are_the_tables() -> None:
    """Arrays are attributes with types, which no table can give them: each is in both, under one name."""
    arrays = {
        one.name: str(one.type) for one in fields(nmm.Trajectory) if str(one.type)[:5] in ("Array", "Integ")
    }
    assert list(arrays.keys() ^ {one.name for one in saved()}) == []
    for one in saved():
        expected = ("Integers" if one.whole else "Array") + (" | None" if one.optional else "")
        assert arrays[one.name] == expected, one.name


def test_a_sample_has_what_is_noted() -> None:
    """`Step` gives some of it a type; the rest is `step[name]`."""
    types = get_type_hints(Step)
    with_type = types.keys() & QUANTITIES.keys()
    assert with_type == {*Recorded._fields, "t"} - {"limited", "unanswered"}
    for name in with_type:
        one = QUANTITIES[name]
        expected = (float, int, Array, Integers)[2 * (len(one.shape) > 1) + one.whole]
        assert types[name] == expected, name
    step = nmm.Scenario.load("unicycle_2r_position").controller().evaluate(0.0, np.zeros(5))
    assert step["u"] is step.u
    assert step["unanswered"] == 0
    assert step["limited"].shape == (0,)


def test_the_numbers_of_the_summary_have_one_key_each() -> None:
    keys = [number.key for one in QUANTITIES.values() for number in one.numbers]
    keys += [number.key for number in RUN_NUMBERS]
    assert len(keys) == len(set(keys))
    assert {number.after for number in RUN_NUMBERS} <= QUANTITIES.keys()
    run = nmm.Scenario.load("unicycle_3r_door", {"duration": 0.1}).run()
    summary = run.summary()
    assert set(keys) - summary.keys() == {"drift", "drift_max"}  # of odometry
    # Any other float is a setting of the run, not a result.
    floats = {key for key, value in summary.items() if isinstance(value, float)}
    assert floats - set(keys) <= {"dt", "kinematics_off", "clearance_asked"}
    plain = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run().summary()
    distances = {"clearance_min", "clearance_min_t", "clearance_min_pair"}
    assert set(keys) - plain.keys() == distances | {"drift", "drift_max"}


def test_tables_and_sweeps_take_their_numbers_from_the_same_place() -> None:
    numbers = [number for one in QUANTITIES.values() for number in one.numbers] + [*RUN_NUMBERS]
    about = {number.key: number.about for number in numbers}
    own = {"outcome", "message", "warnings", "arrival", "effort"}
    assert {one.name for one in MEASURED} == own | {key for key, words in about.items() if words}
    assert all(one.about == about[one.name] for one in MEASURED if one.name not in own)
    docs = (ROOT / "docs" / "sweeps.md").read_text("utf-8").partition("## The page")[0]
    said = {name if name[0] != "_" else f"objective{name}" for name in re.findall(r"`(\w+)`", docs)}
    assert [one.name for one in MEASURED if one.name not in said] == []
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run()
    names = {number.key: number.name for number in numbers}
    for quantity in comparison_table([run]).quantities:
        key = quantity.key.partition(".")[0]
        assert key == "u_max" or quantity.name == names.get(key, "step"), key


def test_slip_and_the_size_of_inputs_are_known_of_each_sample() -> None:
    scenario = nmm.Scenario.load("ur5_differential_line", {"duration": 0.1})
    run, robot, controller = scenario.run(), scenario.robot(), scenario.controller()
    summary = run.summary()
    A = robot.platform.pfaffian(run.q[-1, : robot.platform.n_p])
    last = np.abs(A @ run.q_dot[-1, : robot.platform.n_p]).max()
    assert run["lateral_slip"][-1] == pytest.approx(last, abs=1e-15)
    assert summary["lateral_slip_max"] == run["lateral_slip"].max()
    assert summary["input_peak"] == run["input_norm"].max() == np.linalg.norm(run.u, axis=1).max()
    assert summary["u_max"] == dict(zip(robot.u_names, np.abs(run.u).max(axis=0), strict=True))
    step = controller.evaluate(0.0, run.q[0])
    assert step["input_norm"] == np.linalg.norm(step.u)
    assert step["lateral_slip"] == pytest.approx(run["lateral_slip"][0], abs=1e-15)


def power(record: Record) -> np.ndarray:
    """The one function that computes the quantity that these tests add: ‖u‖² of each sample."""
    assert record.robot.n_u == record["u"].shape[1]
    assert len(record["t"]) == len(record["u"])
    return np.asarray(np.sum(record["u"] ** 2, axis=1))


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two quantities more in the table: one number a sample, and one a row of the task."""
    one = RecordedQuantity(
        "power",
        "‖u‖²",
        "size of the inputs squared",
        fill=0.0,
        since=8,
        of=power,
        column="power",
        place=2,
        curve=Curve("power", "Power", 12),
        numbers=(Number("power_max", lambda t, x: float(x.max()), "‖u‖², largest", r"$\|u\|^2$, largest"),),
        line=("largest ‖u‖²", "{power_max:.3g}"),
    )
    each = RecordedQuantity(
        "pull", "K e", "what feedback asks for", "Ns", "rows", since=8, column="pull_{}", place=2,
        of=lambda record: record["rate"],
    )  # fmt: skip
    monkeypatch.setitem(QUANTITIES, "power", one)
    monkeypatch.setitem(QUANTITIES, "pull", each)


def test_a_quantity_more_is_an_entry_and_a_function(added: None, tmp_path: Path) -> None:
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5})
    run = scenario.run()
    expected = np.sum(run.u**2, axis=1)
    assert np.array_equal(run["power"], expected)
    step = scenario.controller().evaluate(0.0, run.q[0])
    assert step["power"] == pytest.approx(expected[0])
    assert step["error_norm"] == run.error_norm[0]
    assert step["u"] is step.u

    folder = run.save(tmp_path / "run", figures=False, html=True)
    with np.load(folder / "trajectory.npz") as file:
        assert np.array_equal(file["power"], expected)
        assert file["pull"].shape == run.error.shape
    with (folder / "trajectory.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [float(line["power"]) for line in lines] == expected.tolist()
    assert list(lines[0])[-4:] == ["margin", "power", "pull_ee.x", "pull_ee.y"]
    assert json.loads((folder / "summary.json").read_text())["power_max"] == expected.max()
    assert ("largest ‖u‖²", f"{expected.max():.3g}") in list(summary_rows(run, run.summary()))
    assert "‖u‖², largest" in comparison_table([run]).markdown()
    page = channels(run)
    shown = {channel.name: channel for channel in page.channels}
    assert np.array_equal(shown["power"].values, expected[np.searchsorted(run.t, page.t)])
    assert '"Power"' in (folder / "playback.html").read_text("utf-8")
    growing = Growing(scenario.controller())
    assert [channel.panel for channel in growing.channels].count("power") == 1

    back = nmm.Trajectory.load(folder)
    assert np.array_equal(back["power"], expected)
    assert back.summary() == run.summary()


def test_a_folder_of_before_opens_with_what_stands_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    old = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()
    folder = old.save(tmp_path / "run", figures=False)
    request.getfixturevalue("added")
    back = nmm.Trajectory.load(folder)
    assert np.array_equal(back["power"], np.zeros(len(old)))
    assert back["pull"].shape == old.error.shape
    assert np.isnan(back["pull"]).all()
    assert "power" not in {channel.name for channel in channels(back).channels}


def test_legs_that_are_joined_have_it(added: None, tmp_path: Path) -> None:
    scenario = nmm.Scenario.load("unicycle_3r_sequence", {"duration": 9.0, "dt": 0.05})
    run = scenario.run()
    assert len(run.events) > 1
    assert np.array_equal(run["power"], np.sum(run.u**2, axis=1))
    assert run["pull"].shape == run.error.shape
    assert np.array_equal(np.isnan(run["pull"]), np.isnan(run.error))
    back = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False))
    np.testing.assert_array_equal(back["pull"], run["pull"])


#: A quantity that only a step knows: what is added to each file, after which line.
ADDED = {
    "control/step/quantities.py": (
        "_TABLE = (",
        'RecordedQuantity("pivot", "p", "pivot", fill=0.0, since=8, noted=True, column="pivot", place=2,'
        ' curve=Curve("pivot", "Pivot", 12), numbers=(Number("pivot_min", lambda t, x: x.min()),)),',
    ),
    "control/step/recorded.py": (
        "    record.objective[k] = e.H[()]",
        "    record.pivot[k] = e.answer.measure[()]",
    ),
}
#: Run with that: by the compiled loop, and by the one in Python.
USE = """
import csv, sys
import numpy as np, nmm
scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.03, "dt": 0.01})
robot, controller = scenario.robot(), scenario.controller()
objective = nmm.CallableObjective(lambda at: 0.0, lambda at: np.zeros(robot.n))
slow = nmm.Controller(robot, controller.task, controller.resolver, objective)
assert controller.solver.compiles_runs and not slow.solver.compiles_runs
runs = scenario.run(), nmm.simulate(slow, scenario.parts.q0, duration=0.03, dt=0.01)
for one, run in zip((controller, slow), runs):
    last = one.evaluate(0.0, run.q[0])
    assert last["pivot"] == last.measure == run["pivot"][0] > 0.0
    assert (run["pivot"] > 0.0).all() and np.ptp(run["pivot"]) > 0.0
    folder = run.save(sys.argv[1], figures=False)
    with (folder / "trajectory.csv").open() as file:
        assert [float(row["pivot"]) for row in csv.DictReader(file)] == run["pivot"].tolist()
    assert run.summary()["pivot_min"] == run["pivot"].min()
assert np.array_equal(nmm.Trajectory.load(folder, robot)["pivot"], run["pivot"])
many = nmm.rollout(controller, runs[0].q[:1], duration=0.03, dt=0.01, keep=["pivot"])
assert many.kept["pivot"].min() > 0.0
"""


def with_files_changed(folder: Path, names: Iterable[str]) -> subprocess.CompletedProcess[str]:
    """`USE` with a copy of nmm in which those of the files have what is `ADDED`."""
    root = Path(nmm.__file__).parents[1]
    shutil.copytree(root / "nmm", folder / "nmm", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "robots", "scenarios"):
        (folder / name).symlink_to(root / name)
    for name in names:
        path, (after, more) = folder / "nmm" / name, ADDED[name]
        text = path.read_text("utf-8")
        assert text.count(after + "\n") == 1, name
        path.write_text(text.replace(after, f"{after}\n{more}"), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", USE, str(folder / "run")]
    return subprocess.run(command, env=environment, capture_output=True, text=True, cwd=folder)


def test_a_quantity_that_a_step_knows_is_two_files(tmp_path: Path) -> None:
    """Those that docs/architecture.md names, by the loops and in a sample alone."""
    docs = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    (said,) = re.findall(r"^\*\*A recorded quantity\*\*.*?\n\n", docs, re.M | re.S)
    assert re.findall(r"`([\w/]+\.py)`", said) == [*ADDED]
    ran = with_files_changed(tmp_path, ADDED)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.thorough
def test_one_that_nothing_writes_is_refused(tmp_path: Path) -> None:
    ran = with_files_changed(tmp_path, ["control/step/quantities.py"])
    last = ran.stderr.strip().splitlines()[-1]
    assert last == "TypeError: pivot is noted of each sample, but note_sample does not write it"


@pytest.mark.parametrize("lacking", sorted(set(SINCE.values())))
def test_a_folder_of_each_older_version_opens(lacking: int, tmp_path: Path) -> None:
    """Without what came with a version and after it: `fill` stands there."""
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.2}).run()
    folder = run.save(tmp_path / "run", figures=False)
    with np.load(folder / "trajectory.npz") as file:
        older = {name: file[name] for name in file.files if SINCE.get(name, 1) < lacking}
    assert "t" in older
    np.savez(folder / "trajectory.npz", **older)
    back = nmm.Trajectory.load(folder)
    for one in saved():
        if one.name in older or one.optional:
            continue
        assert np.all(back[one.name] == one.fill) or one.shape == "NL" or one.fill != one.fill, one.name
    assert np.array_equal(back.q, run.q)
    assert len(back.scale) == len(run)


def test_what_is_no_quantity_is_refused_by_name() -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run()
    with pytest.raises(nmm.InputError) as found:
        run["sigma_mim"]
    assert found.value.got == "sigma_mim"
    with pytest.raises(nmm.InputError):
        run["J"]  # noted of each sample, not kept
    assert np.array_equal(run["crossed"], np.zeros(len(run)))


def test_a_folder_written_before_the_table_is_read_and_written_as_it_was(tmp_path: Path) -> None:
    """tests/folders/run_1: `unicycle_2r_position` for 0.02 s, v at most 0.7, as nmm 0.1.0 wrote it."""
    old = ROOT / "tests" / "folders" / "run_1"
    run = nmm.Trajectory.load(old)
    new = run.save(tmp_path / "run", figures=False)
    assert (new / "trajectory.csv").read_bytes() == (old / "trajectory.csv").read_bytes()
    with np.load(old / "trajectory.npz") as before, np.load(new / "trajectory.npz") as after:
        assert after.files == before.files
        for name in before.files:
            assert after[name].dtype == before[name].dtype
            assert after[name].tobytes() == before[name].tobytes(), name
    summaries = [json.loads((folder / "summary.json").read_text()) for folder in (old, new)]
    found = summaries[1].pop("findings")
    # There were none of these then: it has the sentence.
    (said,) = [one for one in found if one["line"] != "motors"]
    (sentence,) = summaries[0]["warnings"]
    assert (said["code"], said["values"], said["text"]) == ("said", {"text": sentence}, sentence)
    assert (said["where"], said["line"]) == ({}, "warnings.0")
    assert [*summaries[1]] == [*summaries[0]]
    for key, value in summaries[0].items():
        expected = pytest.approx(value, rel=1e-12) if isinstance(value, float) else value
        assert summaries[1][key] == expected, key
