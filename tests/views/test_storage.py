"""Run folders: the contract's arrays, written whole or not at all, read back as they were."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from findings import refused
from places import UR5

import nmm
from nmm.control.step.quantities import saved
from nmm.views.folders.whole import replaced_folder


@pytest.fixture(scope="module")
def run() -> nmm.Trajectory:
    return nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()


def test_the_arrays_are_the_contracts(run: nmm.Trajectory, tmp_path: Path) -> None:
    run.save(tmp_path / "run", figures=False)
    with np.load(tmp_path / "run" / "trajectory.npz", allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    N, n, m, s = 101, 5, 4, 2
    shapes = {"t": (N,), "q": (N, n), "u": (N, m), "r": (N, s), "r_d": (N, s), "error": (N, s)}
    shapes |= {"objective": (N,), "sigma_min": (N,), "partition": (N, s)}
    for name, shape in shapes.items():
        assert arrays[name].shape == shape, name
    assert list(arrays["q_names"]) == ["x", "y", "theta", "q1", "q2"]
    assert list(arrays["u_names"]) == ["v", "omega", "q1", "q2"]
    # With a straight arm |Δ12| = d + l1 + l2 exceeds |Δ13| = l1 + l2: the rule starts with [v, omega].
    assert np.all(arrays["partition"] == [0, 1])


def test_the_csv_says_the_same_as_the_npz(run: nmm.Trajectory, tmp_path: Path) -> None:
    run.save(tmp_path / "run", figures=False)
    with (tmp_path / "run" / "trajectory.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(run)
    assert [float(row["theta"]) for row in rows] == run.q[:, 2].tolist()
    assert [float(row["u_omega"]) for row in rows] == run.u[:, 1].tolist()
    assert [float(row["error_ee.y"]) for row in rows] == run.error[:, 1].tolist()


def test_a_folder_is_read_back_as_it_was(run: nmm.Trajectory, tmp_path: Path) -> None:
    back = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False))
    for name in (one.name for one in saved()):
        np.testing.assert_array_equal(back[name], run[name], err_msg=name)
    assert back.robot.q_names == run.robot.q_names
    assert back.outcome is run.outcome
    assert back.summary() == run.summary()


def test_a_run_made_by_hand_is_read_back_too(robot_3r: nmm.Robot, tmp_path: Path) -> None:
    task = nmm.Task(nmm.Position("ee"), [1.0, 0.5, 0.6])
    run = nmm.simulate(nmm.Controller(robot_3r, task, nmm.ProjectedGradient()), {"q2": 1.0}, 0.1)
    assert run.scenario is None
    back = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False))
    assert np.array_equal(back.q, run.q)
    assert back.robot.name == "unicycle_3r"


def test_the_scenario_in_the_folder_runs_again_to_the_same_numbers(
    run: nmm.Trajectory, tmp_path: Path
) -> None:
    run.save(tmp_path / "run", figures=False)
    again = nmm.Scenario.load(tmp_path / "run" / "scenario.yaml").run()
    assert np.array_equal(again.q, run.q)
    assert yaml.safe_load((tmp_path / "run" / "scenario.yaml").read_text())["name"] == "unicycle_2r_position"


def test_an_older_run_of_ours_is_replaced_and_nothing_else_is(run: nmm.Trajectory, tmp_path: Path) -> None:
    run.save(tmp_path / "run", figures=False)
    (tmp_path / "run" / "left_behind").write_text("old")
    run.save(tmp_path / "run", figures=False)
    assert not (tmp_path / "run" / "left_behind").exists()

    foreign = tmp_path / "thesis"
    foreign.mkdir()
    (foreign / "chapter1.tex").write_text("years of work")
    with refused("thesis"):
        run.save(foreign)
    assert [path.name for path in foreign.iterdir()] == ["chapter1.tex"]
    file = tmp_path / "file"
    file.write_text("x")
    with refused("file"):
        run.save(file)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "run", "thesis"]


def test_a_failure_while_writing_leaves_the_old_folder(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()

    def fail_halfway() -> None:
        with replaced_folder(folder, lambda path: True) as temporary:
            (temporary / "half").write_text("x")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_halfway()
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert list(folder.iterdir()) == []


def test_an_incomplete_run_is_written_and_marked(robot_2r: nmm.Robot, tmp_path: Path) -> None:
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 1.0])

    def interrupt(fraction: float) -> None:
        if fraction >= 0.5:
            raise KeyboardInterrupt

    controller = nmm.Controller(robot_2r, task, nmm.ProjectedGradient())
    run = nmm.simulate(controller, {}, 1.0, progress=interrupt)
    run.save(tmp_path / "run", figures=False)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["complete"] is False
    assert summary["outcome"] == "interrupted"
    assert summary["samples"] == len(run) < 201


@pytest.mark.parametrize("damage", ["npz", "summary", "folder"])
def test_a_folder_that_is_no_run_is_named(run: nmm.Trajectory, tmp_path: Path, damage: str) -> None:
    folder = run.save(tmp_path / "run", figures=False)
    if damage == "npz":
        (folder / "trajectory.npz").write_bytes(b"not a zip")
    elif damage == "summary":
        (folder / "summary.json").write_text("{}")
    else:
        folder = tmp_path / "nowhere"
    with pytest.raises(nmm.InputError, match=str(folder.name)):
        nmm.Trajectory.load(folder)


def test_no_redundancy_left_is_legal_and_said(robot_2r: nmm.Robot) -> None:
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.3])
    posture = nmm.Task(nmm.LinearCoordinates("q1", "q2"), [0.5, -0.7])
    for resolver in (nmm.ProjectedGradient(), nmm.ReducedGradient()):
        run = nmm.simulate(nmm.Controller(robot_2r, [task, posture], resolver), {"q2": 0.3}, 8.0)
        assert run.complete
        assert run.error_norm[-1] < 1e-3 * run.error_norm[0]
        assert [one["code"] for one in run.summary()["findings"]][-1] == "no_redundancy"


@pytest.mark.parametrize(
    "made",
    [
        lambda: nmm.mount("car_base", "small_arm", prefix="a_"),
        lambda: nmm.load("unicycle_3r", lock={"q3": 0.4}),
        lambda: nmm.load(UR5, platform="fixed"),
        lambda: nmm.load("unicycle_2r", platform="differential"),
        lambda: nmm.load("car_base", platform="front_drive_car"),
        lambda: nmm.load("differential_base", platform=nmm.DifferentialDrive(0.2, 0.5)),
        lambda: nmm.load("unicycle_2r", axle=(0.1, 0.0)),
    ],
    ids=["mounted", "locked", "fixed", "by wheel speeds", "by its front", "other wheels", "other axle"],
)
def test_a_robot_put_together_in_python_is_asked_for(made: Callable[[], nmm.Robot], tmp_path: Path) -> None:
    """Its file alone would be another robot: that is refused, not taken silently."""
    robot = made()
    task = nmm.Task(nmm.LinearCoordinates(robot.q_names[-1]), nmm.Line([0.0], [0.1], 0.2))
    run = nmm.simulate(nmm.Controller(robot, task, nmm.ProjectedGradient()), np.zeros(robot.n), 0.2, 0.1)
    run.save(tmp_path / "run", figures=False)
    with pytest.raises(nmm.InputError, match=r"give the robot that it ran on: Trajectory\.load"):
        nmm.Trajectory.load(tmp_path / "run")
    again = nmm.Trajectory.load(tmp_path / "run", made())
    np.testing.assert_array_equal(again.q, run.q)
    assert again.robot.u_names == robot.u_names
    with refused("run"):
        nmm.Trajectory.load(tmp_path / "run", nmm.load("unicycle_3r"))
