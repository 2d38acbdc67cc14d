"""LeRobot's own loader, tools and recorder beside nmm's data sets.

They run in the Python that the variable NMM_LEROBOT_PYTHON names, or in this one if it has LeRobot, which,
with torch, is no dependency of nmm's tests.
"""

from __future__ import annotations

import json
import os
import runpy
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import ROOT
from planar_arms import planar_arm

pytest.importorskip("pyarrow")
from lerobot_sets import Checked, moved

import nmm

PYTHON = os.environ.get("NMM_LEROBOT_PYTHON") or (sys.executable if find_spec("lerobot") else "")
pytestmark = pytest.mark.skipif(not PYTHON, reason="needs LeRobot: NMM_LEROBOT_PYTHON=/its/python")
SCRIPT = ROOT / "tests" / "helpers" / "lerobot_itself.py"
GRIPPER = {"arm_gripper": (0.0, 1.5)}


def by_lerobot(job: str, folder: Path, out: Path) -> dict[str, Any]:
    """What a job of the script answers, without a network."""
    offline = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(out.parent / "hub"), "PYTHONPATH": ""}
    done = subprocess.run(
        [PYTHON, str(SCRIPT), job, str(folder), str(out)],
        env=os.environ | offline, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


@pytest.fixture(scope="module")
def lekiwi() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "docs" / "tutorials" / "lekiwi_picks.py"))


def compare(place: Path, out: Path) -> dict[str, Any]:
    """All columns, frames and episodes as LeRobot has them against pyarrow; statistics against its own."""
    told, found = by_lerobot("load", place, out / "frames.npz"), Checked(place)
    loaded = np.load(out / "frames.npz")
    assert {*loaded.files} == {*found.info["features"]}
    for name in loaded.files:
        assert np.array_equal(loaded[name], found.rows(name)), name
    rows = found.episodes.to_pylist()
    assert told["episodes"] == [
        [row["dataset_from_index"], row["dataset_to_index"], row["length"]] for row in rows
    ]
    assert told["frames"] == found.info["total_frames"]
    assert told["fps"] == found.info["fps"]
    assert told["robot_type"] == found.info["robot_type"]
    assert told["names"] == {name: feature["names"] for name, feature in found.info["features"].items()}
    words = found.tasks.column("task").to_pylist()
    assert told["tasks"] == [words[k] for k in found.rows("task_index")]
    assert all(padded[0] is False for padded in told["padded"])
    assert all(padded[1:] == [True, True] for padded in told["padded"])
    assert told["batch"][:2] == [4, 3]
    assert told["subset"] == rows[-1]["length"]
    whole = [found.rows(name) for name in loaded.files]
    for name, rows_of in zip(loaded.files, whole, strict=True):
        check_stats(told["stats"][name], told["own"][name], name)
        for row, own in zip(rows, told["each"], strict=True):
            part = rows_of[row["dataset_from_index"] : row["dataset_to_index"]]
            stats = {key: row[f"stats/{name}/{key}"] for key in own[name]}
            check_stats(stats, own[name], name)
            check_quantiles(own[name], part.reshape(len(part), -1))
    return told


def check_stats(ours: dict[str, Any], own: dict[str, Any], name: str) -> None:
    """The same numbers but for quantiles, in the same shapes."""
    assert {*ours} == {*own}, name
    span = np.array(own["max"]) - np.array(own["min"])
    for key, value in own.items():
        assert np.shape(ours[key]) == np.shape(value), (name, key)
        if not key.startswith("q"):
            scale = np.abs(value).max() + span.max() + 1e-3
            assert np.all(np.abs(np.array(ours[key]) - value) < 2e-3 * scale), (name, key)


def check_quantiles(own: dict[str, Any], rows: np.ndarray) -> None:
    """LeRobot's are read off a histogram of 5000 bins: as many rows are below and above them as `Checked`
    asks of nmm's, to within a bin."""
    slack = 1e-3 * (rows.max(axis=0) - rows.min(axis=0)) + 1e-6
    for share in (0.01, 0.1, 0.5, 0.9, 0.99):
        value = np.array(own[f"q{100 * share:02.0f}"])
        assert np.all((rows < value - slack).sum(axis=0) <= share * len(rows) + 1)
        assert np.all((rows > value + slack).sum(axis=0) <= (1 - share) * len(rows) + 1)


def test_lerobot_opens_runs_of_a_simulated_lekiwi(lekiwi: dict[str, Any], tmp_path: Path) -> None:
    place = nmm.write_lerobot(
        lekiwi["picks"](3), tmp_path / "picks", task=["pick", "pick again", "pick"], fps=30
    )
    told = compare(place, tmp_path)
    assert told["frames"] == 3 * 271


def test_lerobot_opens_one_number_a_frame_and_several_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nmm.plugins.robot.lerobot.layout.MB_A_FILE", 0.01)
    run = moved(planar_arm(tmp_path, 0.5), count=150)
    told = compare(nmm.write_lerobot([run] * 3, tmp_path / "turns", task="turn", fps=20), tmp_path)
    assert told["frames"] == 450
    assert len([*(tmp_path / "turns" / "data").rglob("*.parquet")]) > 1


def test_lerobots_tools_keep_the_units(tmp_path: Path) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()
    place = nmm.write_lerobot([run, run], tmp_path / "set", fps=20)
    (tmp_path / "out").mkdir()
    assert by_lerobot("edit", place, tmp_path / "out") == {"left": 1, "both": 3}
    for name in ("left", "both"):
        read = nmm.read_lerobot(tmp_path / "out" / name, run.robot)
        assert all(np.abs(one.q - run.q[::10]).max() < 1e-6 for one in read)


def test_lerobot_goes_on_with_a_data_set(tmp_path: Path) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()
    place = nmm.write_lerobot(run, tmp_path / "set", fps=20)
    by_lerobot("go_on", place, tmp_path)
    first, second = nmm.read_lerobot(place, run.robot)
    assert np.abs(first.q - run.q[::10]).max() < 1e-6
    assert second.q[:, 0] == pytest.approx(0.01 * np.arange(5))
    assert second.u[:, 1:] == pytest.approx(0.2)  # what q did; the actions are 0, 0.01, ...
    with pytest.raises(nmm.InputError, match="exists and is not what this writes"):
        nmm.write_lerobot(run, place, fps=20)


def test_what_lerobot_records_of_lekiwi_is_read(lekiwi: dict[str, Any], tmp_path: Path) -> None:
    by_lerobot("record", tmp_path / "set", tmp_path)
    robot = lekiwi["ROBOT"]
    units = {"?.vel": "m/s", "theta.vel": "deg/s", "*.pos": "deg", "arm_gripper.pos": "0..100"}
    with pytest.raises(nmm.InputError, match=r"no unit is stated of arm_shoulder_pan\.pos and 8 more"):
        nmm.read_lerobot(tmp_path / "set", robot)
    with pytest.warns(RuntimeWarning, match="actions ask for up to 1.5 times"):
        read = nmm.read_lerobot(tmp_path / "set", robot, units=units, ranges=GRIPPER)
    assert [len(one) for one in read] == [21, 6]
    assert read[0].q[-1, :3] == pytest.approx([0.5, 0.5, np.pi / 2], abs=1e-6)
    assert read[0].q[-1, 3:] == pytest.approx([*np.radians([-30, 30, 50, 0, 0]), 0.375], abs=1e-6)


@pytest.mark.browser
def test_lerobot_decodes_pictures_at_their_frames(tmp_path: Path) -> None:
    from test_lerobot_video import ISO, SIZE, decoded, runs

    place = nmm.write_lerobot(runs(), tmp_path / "set", fps=10, video="iso", size=SIZE)
    told = by_lerobot("pictures", place, tmp_path / "pictures.npz")
    if "lacks" in told:
        pytest.skip(f"LeRobot has no decoder here: {told['lacks']}")
    assert told["keys"] == [ISO]
    found = np.load(tmp_path / "pictures.npz")[ISO]
    files = sorted((place / "videos" / ISO).rglob("*.mp4"))
    expected = np.concatenate([decoded(file) for file in files]).transpose(0, 3, 1, 2)
    assert found.shape == expected.shape == (12, 3, SIZE[1], SIZE[0])
    apart = np.abs(found[:, None] - expected[None]).mean(axis=(2, 3, 4))
    assert apart.argmin(axis=1).tolist() == [*range(12)]
    assert np.diag(apart).max() < 0.02
