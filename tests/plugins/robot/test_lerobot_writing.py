"""Runs as data sets of LeRobot's, held against the rules of the format v3.0 by pyarrow alone."""

from __future__ import annotations

import json
import os
import re
import runpy
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import DATA, ROOT
from planar_arms import planar_arm

pytest.importorskip("pyarrow")
from command_line import refused
from lerobot_sets import Checked, changed, moved

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.lerobot import layout


@pytest.fixture(scope="module")
def run() -> nmm.Trajectory:
    return nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()


@pytest.fixture(scope="module")
def other() -> nmm.Trajectory:
    """The same robot for longer, from elsewhere."""
    return nmm.Scenario.load("unicycle_2r_position", {"duration": 0.83, "q0.q1": 0.3}).run()


@pytest.fixture(scope="module")
def folder(run: nmm.Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run's folder."""
    return run.save(tmp_path_factory.mktemp("runs") / "one", figures=False)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_a_data_set_keeps_the_rules_and_states_its_units(
    run: nmm.Trajectory, other: nmm.Trajectory, tmp_path: Path
) -> None:
    found = Checked(
        nmm.write_lerobot([run, other, run], tmp_path / "set", task=["circle", "wider", "circle"], fps=20)
    )
    assert found.info["fps"] == 20
    assert found.info["robot_type"] == "unicycle_2r"
    assert [row["length"] for row in found.episodes.to_pylist()] == [11, 17, 11]
    assert [row["tasks"] for row in found.episodes.to_pylist()] == [["circle"], ["wider"], ["circle"]]
    state, action = (found.info["features"][name] for name in ("observation.state", "action"))
    assert dict(zip(state["names"], state["units"], strict=True)) == {
        "x.pos": "m", "y.pos": "m", "theta.pos": "rad", "q1.pos": "rad", "q2.pos": "rad",
    }  # fmt: skip
    assert dict(zip(action["names"], action["units"], strict=True)) == {
        "v.vel": "m/s", "omega.vel": "rad/s", "q1.vel": "rad/s", "q2.vel": "rad/s",
    }  # fmt: skip
    for name, told in found.info["features"].items():
        own = name in ("timestamp", "frame_index", "episode_index", "index", "task_index")
        assert len(told.get("units", ())) == (0 if own else told["shape"][0])
    own = json.loads((tmp_path / "set" / "meta" / "nmm.json").read_text())
    assert own["robot"]["fingerprint"] == run.robot.fingerprint


def test_frames_are_the_run_at_the_rate_asked_for(run: nmm.Trajectory, tmp_path: Path) -> None:
    found = Checked(nmm.write_lerobot(run, tmp_path / "set", fps=30))
    assert found.episodes.column("tasks").to_pylist() == [[run.scenario["title"]]]
    times = np.arange(16) / 30
    for name, rows in (
        ("observation.state", run.q),
        ("action", run.u),
        ("observation.environment_state", run.desired),
    ):
        for written, values in zip(found.rows(name).T, rows.T, strict=True):
            assert np.abs(written - np.interp(times, run.t, values)).max() < 1e-6


def test_inputs_that_are_held_are_those_of_the_sample_before(tmp_path: Path) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5, "method": "zoh", "dt": 0.01}).run()
    found = Checked(nmm.write_lerobot(run, tmp_path / "set", fps=30))
    before = np.floor(np.arange(16) / 30 * 100 + 1e-6).astype(int)
    assert np.array_equal(found.rows("action"), run.u[before].astype(np.float32))


def test_samples_that_come_late_make_no_gap(run: nmm.Trajectory, tmp_path: Path) -> None:
    found = Checked(nmm.write_lerobot(paused(run, 0.33), tmp_path / "set", fps=30))
    assert len(found.frames) == 25
    before, after = run.q[run.t <= 0.2][-1], run.q[run.t > 0.2][0]
    for k in range(6, 16):  # linear in between
        share = (k / 30 - 0.2) / 0.33
        assert found.rows("observation.state")[k] == pytest.approx(
            before + share * (after - before), abs=1e-6
        )


def test_one_number_a_frame_is_no_list(tmp_path: Path) -> None:
    run = moved(planar_arm(tmp_path, 0.5))
    found = Checked(nmm.write_lerobot(run, tmp_path / "set", task="turn", fps=20))
    for name, column in (("observation.state", "q1.pos"), ("action", "q1.vel")):
        assert found.info["features"][name]["shape"] == [1]
        assert found.info["features"][name]["names"] == [column]
        assert str(found.frames.schema.field(name).type) == "float"
        assert found.rows(name).shape == (20,)
        assert len(found.stats[name]["mean"]) == 1
    (read,) = nmm.read_lerobot(tmp_path / "set", run.robot)
    assert np.abs(read.q - run.q).max() < 1e-6
    assert np.abs(read.u - run.u).max() < 1e-6


def test_files_and_chunks_are_filled_one_after_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(layout, "MB_A_FILE", 0.0035)  # 58 frames, of which a run has 20
    monkeypatch.setattr(layout, "FILES_A_CHUNK", 2)
    run = moved(nmm.load("omni_base"))
    found = Checked(nmm.write_lerobot([run] * 6, tmp_path / "set", task="drive", fps=20))
    places = [(row["data/chunk_index"], row["data/file_index"]) for row in found.episodes.to_pylist()]
    assert places == [(0, 0), (0, 0), (0, 1), (0, 1), (1, 0), (1, 0)]
    numbers = sum(found.rows(name).nbytes for name in found.info["features"])
    assert numbers == 3 * 2400  # a third run would be beyond 3500
    assert len([*(tmp_path / "set" / "data").rglob("*.parquet")]) == len({*places})
    read = nmm.read_lerobot(tmp_path / "set", run.robot)
    assert all(np.abs(episode.q - run.q).max() < 1e-6 for episode in read)
    (last,) = nmm.read_lerobot(tmp_path / "set", run.robot, episodes=5)
    assert last.label == "episode 5"


def test_a_target_is_written_where_each_sample_has_one(run: nmm.Trajectory, tmp_path: Path) -> None:
    none = replace(run, desired=None)
    assert (
        "observation.environment_state"
        not in Checked(nmm.write_lerobot(none, tmp_path / "a")).info["features"]
    )
    gone = run.desired.copy()
    gone[40] = np.nan
    assert (
        "observation.environment_state"
        not in Checked(nmm.write_lerobot(replace(run, desired=gone), tmp_path / "b")).info["features"]
    )
    with pytest.raises(InputError, match=r"runs\[1\] \(RG\): expected a target at every sample"):
        nmm.write_lerobot([run, none], tmp_path / "c")
    with pytest.raises(InputError, match=r"runs\[1\] \(RG\): expected no target"):
        nmm.write_lerobot([none, run], tmp_path / "c")


def with_nan(run: nmm.Trajectory, name: str) -> nmm.Trajectory:
    rows = getattr(run, name).copy()
    rows[40:, 1] = np.nan
    return replace(run, **{name: rows})


def paused(run: nmm.Trajectory, lasts: float) -> nmm.Trajectory:
    """With nothing said from 0.2 s on."""
    return replace(run, t=run.t + np.where(run.t > 0.2, lasts - run.t[1], 0.0))


def cut(run: nmm.Trajectory, count: int) -> nmm.Trajectory:
    arrays = {name: getattr(run, name)[:count] for name in ("t", "q", "u", "desired")}
    return replace(run, **arrays)


@pytest.mark.parametrize(
    ("runs", "options", "said"),
    [
        (lambda run: [], {}, "runs: expected at least one run"),
        (lambda run: [run, "runs/one"], {}, r"runs\[1\]: expected a run"),
        (lambda run: [run, moved(nmm.load("car_base"))], {}, r"runs\[1\] \(moved\): runs of several robots; expected unicycle_2r \(5"),
        (lambda run: [run, nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1, "robot.arguments": {"d": 0.4}}).run()], {}, "runs of several robots"),
        (lambda run: [run, cut(run, 1)], {}, r"runs\[1\] \(RG\): expected at least two samples, got 1"),
        (lambda run: [run, cut(run, 0)], {}, r"runs\[1\] \(RG\): expected at least two samples, got 0"),
        (lambda run: [cut(run, 6)], {}, r"runs\[0\] \(RG\): lasts 0.025 s; expected at least two frames, 0.0333 s"),
        (lambda run: [run], {"fps": 250}, r"runs\[0\] \(RG\): fps: expected at most 200"),
        (lambda run: [paused(run, 10.0)], {}, r"runs\[0\] \(RG\): no sample from t = 0.2 to 10.2 s; expected one every 10 frames"),
        (lambda run: [paused(run, 0.35)], {}, r"no sample from t = 0.2 to 0.55 s"),
        (lambda run: [run], {"fps": 0}, "fps: expected a whole number above 0"),
        (lambda run: [run], {"fps": 29.97}, "fps: expected a whole number above 0"),
        (lambda run: [run], {"fps": 10**9}, "fps: expected at most"),
        (lambda run: [with_nan(run, "q")], {}, r"runs\[0\] \(RG\): y.pos at t = 0.2 s: expected a finite number of 32 bits, got nan"),
        (lambda run: [with_nan(run, "u")], {}, r"omega.vel at t = 0.2 s"),
        (lambda run: [replace(run, q=1e39 + run.q)], {}, r"x.pos at t = 0 s: expected a finite number of 32 bits, got 1e\+39"),
        (lambda run: [run], {"task": " "}, r"runs\[0\] \(RG\): task: expected words"),
        (lambda run: [run], {"task": 3}, "task: expected words, or words for each run, got 3"),
        (lambda run: [run], {"task": "two\nlines"}, "words on one line"),
        (lambda run: [run, run], {"task": ["one"]}, "task: expected a task for each run"),
        (lambda run: [run], {"task": ["one", "two"]}, "task: expected a task for each of 1 runs"),
    ],
)  # fmt: skip
def test_runs_that_make_no_data_set_are_refused(
    runs: Any, options: dict[str, Any], said: str, run: nmm.Trajectory, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=said) as caught:
        nmm.write_lerobot(runs(run), tmp_path / "set", **options)
    assert len(str(caught.value)) <= 300
    assert not [*tmp_path.iterdir()]


def test_a_data_set_is_replaced_whole_or_not_at_all(run: nmm.Trajectory, tmp_path: Path) -> None:
    place = tmp_path / "set"

    def stopped() -> Iterator[nmm.Trajectory]:
        yield run
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        nmm.write_lerobot(stopped(), place)
    assert not [*tmp_path.iterdir()]
    nmm.write_lerobot(run, place, fps=20)
    before = contents(place)
    with pytest.raises(KeyboardInterrupt):
        nmm.write_lerobot(stopped(), place)
    assert contents(place) == before
    assert [*tmp_path.iterdir()] == [place]
    nmm.write_lerobot([run, run], place, fps=20)
    assert Checked(place).info["total_episodes"] == 2


def test_what_others_wrote_or_went_on_with_is_not_replaced(run: nmm.Trajectory, tmp_path: Path) -> None:
    place = nmm.write_lerobot(run, tmp_path / "set")
    changed(place, total_episodes=2)  # LeRobot recorded another one
    with pytest.raises(InputError, match="exists and is not what this writes"):
        nmm.write_lerobot(run, place)
    (place / "meta" / "nmm.json").unlink()
    changed(place, total_episodes=1)
    with pytest.raises(InputError, match="exists and is not what this writes"):
        nmm.write_lerobot(run, place)


@pytest.mark.parametrize(
    "change", ["a note", "a picture", "another task", "a file less", "a link", "brackets", "a pipe"]
)
def test_a_data_set_that_somebody_changed_is_not_replaced(
    change: str, run: nmm.Trajectory, tmp_path: Path
) -> None:
    place = nmm.write_lerobot(run, tmp_path / "set")
    info, tasks, stats = (place / name for name in (layout.INFO, layout.TASKS, layout.STATS))
    if change == "a note":
        (place / "README.md").write_text("# Circles\n")
    elif change == "a picture":
        (place / "images" / "front").mkdir(parents=True)
        (place / "images" / "front" / "0.png").write_bytes(b"")
    elif change == "another task":
        other = nmm.write_lerobot(run, tmp_path / "other", task="follow a wide circle")
        tasks.write_bytes((other / layout.TASKS).read_bytes())
    elif change == "a file less":
        stats.unlink()
    elif change == "a link":
        stats.rename(tmp_path / "blob")
        stats.symlink_to(tmp_path / "blob")
    elif change == "brackets":
        info.write_text("[" * 200_000)
    else:
        info.unlink()
        os.mkfifo(info)
    there = [*place.rglob("*")]
    with pytest.raises(InputError, match="exists and is not what this writes"):
        nmm.write_lerobot(run, place)
    assert [*place.rglob("*")] == there


def test_export_writes_runs_by_their_folders(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = refused(
        capsys, "export", str(folder), str(folder), "--lerobot", "set", "--task", "circle", "--fps", "20"
    )
    assert (done.status, done.out.strip()) == (0, "written: set")
    found = Checked(Path("set"))
    assert found.info["total_episodes"] == 2
    assert found.info["fps"] == 20
    assert found.tasks.column("task").to_pylist() == ["circle"]
    assert refused(capsys, "export", str(folder), "log.mcap", "--mcap").status == 0
    assert Path("log.mcap").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("RUN",), "say what to write; expected --mcap or --lerobot DIR"),
        (("RUN", "--mcap", "--lerobot", "set"), "say what to write"),
        (("RUN", "--mcap", "--fps", "20"), "--fps: expected --lerobot, which it is of"),
        (("RUN", "--mcap", "--task", "circle"), "--task: expected --lerobot"),
        (("RUN", "--lerobot", "set", "--start", "3"), "--start: expected --mcap"),
        (("RUN", "a.mcap", "b.mcap", "--mcap"), "--mcap: expected a run, and a file"),
        (("RUN", "nowhere", "--lerobot", "set"), "nowhere: expected a run's folder"),
        (("RUN", "--lerobot", "set", "--fps", "999"), "runs[0] (RUN): fps: expected at most 200"),
        (("RUN", "--lerobot", "RUN"), "exists and is not what this writes"),
    ],
)
def test_export_says_what_is_wrong(
    arguments: tuple[str, ...], said: str, folder: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    done = refused(capsys, "export", *(str(folder) if each == "RUN" else each for each in arguments))
    assert done.status == 2
    assert said.replace("RUN", str(folder)) in done.err
    assert "Traceback" not in done.err
    assert not [*tmp_path.iterdir()]


def test_a_robot_like_lekiwi_picks(tmp_path: Path) -> None:
    """docs/tutorials/lekiwi_picks.py, three episodes: the tip is where the cube is while the jaw closes."""
    script = runpy.run_path(str(ROOT / "docs" / "tutorials" / "lekiwi_picks.py"))
    robot, runs = script["ROBOT"], [*script["picks"](3)]
    for run in runs:
        assert run.complete
        cube = run.desired[np.searchsorted(run.t, 6.5)]
        assert cube[2] == pytest.approx(script["CUBE"])
        for t in (6.5, 7.3):
            k = int(np.searchsorted(run.t, t))
            tip = nmm.Configuration(robot, run.q[k]).placement("tip").translation
            assert np.abs(tip - cube).max() < 0.002
        jaw = run.q[:, robot.q_names.index("arm_gripper")]
        assert jaw[np.searchsorted(run.t, 6.4)] > script["CLOSED"] + 0.9
        assert jaw[-1] == pytest.approx(script["CLOSED"], abs=0.01)
        lifted = nmm.Configuration(robot, run.q[-1]).placement("tip").translation
        assert lifted[2] - cube[2] > 0.09
        spins = [robot.wheel_speeds(u, q) for u, q in zip(run.u[::20], run.q[::20], strict=True)]
        assert max(abs(speed) for each in spins for speed in each.values()) < 4.6 + 1e-6
    found = Checked(nmm.write_lerobot(runs, tmp_path / "picks", task="pick up the cube", fps=30))
    assert found.info["total_frames"] == 3 * 271
    assert len(found.info["features"]["observation.state"]["names"]) == 9
    read = nmm.read_lerobot(tmp_path / "picks", robot, frame="tip")
    assert all(np.abs(one.q - run.q[::2]).max() < 1e-6 for one, run in zip(read, runs, strict=True))


def test_the_arm_like_lekiwis_is_as_long_as_so_101() -> None:
    own = nmm.load(ROOT / "docs" / "tutorials" / "lekiwi.urdf.xacro")
    arm = nmm.load(f"{DATA}so_arm_description/urdf/so101.urdf", platform="fixed")
    for name in ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"):
        ends = own.q_limits[own.q_names.index(f"arm_{name}")]
        assert ends == pytest.approx(arm.q_limits[arm.q_names.index(name)], abs=0.005)

    def apart(robot: nmm.Robot, one: str, other: str) -> float:
        at = nmm.Configuration(robot, np.zeros(robot.n))
        return float(np.linalg.norm(at.placement(one).translation - at.placement(other).translation))

    for one, other in (("shoulder_lift", "elbow_flex"), ("elbow_flex", "wrist_flex")):
        length = apart(arm, one, other)
        assert length > 0.1
        assert apart(own, f"arm_{one}", f"arm_{other}") == pytest.approx(length, abs=0.001)
    length = apart(arm, "wrist_roll", "gripper_frame_joint")
    assert apart(own, "arm_wrist_roll", "tip") == pytest.approx(length, abs=0.001)


def test_the_python_on_data_sets_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "data_sets.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.S)
    known: dict[str, Any] = {}
    exec(code, known)
    assert f"# {known['first']}" in code
