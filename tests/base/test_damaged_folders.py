"""Run folders that were damaged: refused in one line that names file and entry, or read as what they are."""

from __future__ import annotations

import io
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import refused
from fuzz.damaging import copied, whole_folders

import nmm
from nmm.base.bundled import bundled_robots
from nmm.cli.exit_status import status_of
from nmm.model.robots.loading.description import describe
from nmm.plugins.live.cli import runs_in


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return whole_folders(tmp_path_factory.mktemp("whole"))


def arrays_of(folder: Path) -> dict[str, Any]:
    with np.load(folder / "trajectory.npz") as file:
        return dict(file)


def with_array(name: str, change: Callable[[Any], Any]) -> Callable[[Path], object]:
    def damaged(folder: Path) -> None:
        arrays = arrays_of(folder)
        arrays[name] = change(arrays[name])
        np.savez(folder / "trajectory.npz", **{key: one for key, one in arrays.items() if one is not None})

    return damaged


def with_value(*keys: str, value: Any = None) -> Callable[[Path], object]:
    def damaged(folder: Path) -> None:
        content = json.loads((folder / "summary.json").read_text())
        place = content
        for key in keys[:-1]:
            place = place[int(key)] if isinstance(place, list) else place[key]
        if value is None:
            del place[keys[-1]]
        else:
            place[keys[-1]] = value
        (folder / "summary.json").write_text(json.dumps(content))

    return damaged


def truncated(folder: Path) -> None:
    content = (folder / "trajectory.npz").read_bytes()
    (folder / "trajectory.npz").write_bytes(content[: len(content) // 2])


def flipped(folder: Path) -> None:
    content = bytearray((folder / "trajectory.npz").read_bytes())
    content[400] ^= 1
    (folder / "trajectory.npz").write_bytes(content)


def nan_at(place: int) -> Callable[[Any], Any]:
    def change(array: Any) -> Any:
        array[place] = np.nan
        return array

    return change


def written(name: str, content: bytes) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_bytes(content)


def to_device(folder: Path) -> None:
    (folder / "trajectory.npz").unlink()
    (folder / "trajectory.npz").symlink_to("/dev/zero")


OBJECTS = io.BytesIO()
np.savez(OBJECTS, t=np.array([{"a": 1}], dtype=object))

EXAMPLES: dict[str, tuple[Callable[[Path], object], str]] = {
    "truncated npz": (truncated, r"trajectory\.npz: damaged, or not what nmm wrote"),
    "empty npz": (written("trajectory.npz", b""), r"trajectory\.npz: damaged"),
    "a bit flipped": (flipped, r"trajectory\.npz: \w+: damaged.*Bad CRC"),
    "pickled npz": (
        written("trajectory.npz", OBJECTS.getvalue()),
        r"trajectory\.npz: t: damaged.*allow_pickle",
    ),
    "a pickle": (written("trajectory.npz", pickle.dumps([1.0])), r"trajectory\.npz: damaged"),
    "no npz": (lambda folder: (folder / "trajectory.npz").unlink(), r"trajectory\.npz: this file is missing"),
    "a device": (to_device, r"trajectory\.npz: cannot be read: expected a file, this is a device"),
    "no array": (with_array("q", lambda q: None), r"trajectory\.npz: q: this array is missing"),
    "a sample less": (
        with_array("q", lambda q: q[:-1]),
        r"npz: q: expected shape \(\d+, 6\), got shape \(\d+, 6\)",
    ),
    "an axis more": (with_array("u", lambda u: u[None]), r"npz: u: expected 2 axes, got shape \(1, "),
    "whole numbers": (
        with_array("u", lambda u: u.astype(int)),
        r"npz: u: expected numbers of 64 bits, got 'int64'",
    ),
    "text": (with_array("r", lambda r: r.astype(str)), r"npz: r: expected numbers of 64 bits, got '<U32'"),
    "t not a number": (with_array("t", nan_at(3)), r"npz: t: expected finite numbers"),
    "t unsorted": (with_array("t", lambda t: t[::-1]), r"npz: t: expected numbers that increase"),
    "q infinite": (with_array("q", lambda q: q + np.inf), r"npz: q: expected finite numbers"),
    "u 1e300": (with_array("u", lambda u: u + 1e300), r"npz: u: expected finite numbers, none beyond 1e\+30"),
    "far columns": (
        with_array("partition", lambda p: p + 99),
        r"partition: columns of the inputs: .* -1 to 4, got",
    ),
    "far names": (with_array("clearance_pairs", lambda p: p + 99), r"clearance_pairs: .* from -1 to 25"),
    "a name less": (with_value("clearance_names", value=[]), r"npz: clearance: expected shape \(0,\)"),
    "no placements": (
        with_array("obstacle_0_places", lambda p: None),
        r"npz: obstacle_0_places: this array is",
    ),
    "no rotations": (
        with_array("obstacle_0_places", lambda p: 2 * p),
        r"obstacle_0_places: expected rotations",
    ),
    "no key": (with_value("dt"), r"summary\.json: dt: this key is missing"),
    "no key within": (with_value("robot", "source"), r"summary\.json: robot\.source: this key is missing"),
    "another kind": (
        with_value("warnings", value=3),
        r"summary\.json: warnings: input should be a valid array",
    ),
    "no outcome": (
        with_value("outcome", value="fine"),
        r"summary\.json: outcome: input should be 'completed'",
    ),
    "no shape": (
        with_value("obstacles", "0", "shape", "kind", value="blob"),
        r"obstacles\.0\.shape: unknown kind",
    ),
    "no frame": (with_value("frame", value="nose"), r"summary\.json: frame: .*unknown frame 'nose'"),
    "other samples": (
        with_value("samples", value=7),
        r"summary\.json: samples: expected \d+, as in traj.* got 7",
    ),
    "other rows": (with_value("r_names", value=["a"]), r"summary\.json: r_names: expected 3, .* got 1"),
    "another version": (
        with_value("format", value="nmm run 2"),
        r"summary\.json: format: written by another version of nmm; expected 'nmm run 1', got 'nmm run 2'",
    ),
    "deep JSON": (written("summary.json", b"[" * 100_000), r"summary\.json: not valid JSON: recursion limit"),
    "empty JSON": (written("summary.json", b""), r"summary\.json: not valid JSON: EOF"),
    "a long value": (with_value("frame", value="x" * 5000), r"unknown frame 'x{10,60}…"),
    "deep YAML": (
        written("scenario.yaml", b"[" * 3000),
        r"scenario\.yaml:1: not valid YAML: nested too deeply",
    ),
    "no robot": (
        lambda folder: (folder / "scenario.yaml").write_text(
            (folder / "scenario.yaml").read_text().replace("source: unicycle_3r", "source: /gone/r.urdf")
        ),
        r"scenario\.yaml:\d+: robot: /gone/r\.urdf: no such file",
    ),
}


@pytest.mark.parametrize("example", EXAMPLES)
def test_damage_is_named(
    folders: dict[str, Path], tmp_path: Path, example: str, capsys: pytest.CaptureFixture[str]
) -> None:
    do, words = EXAMPLES[example]
    folder = copied(folders["unicycle_3r_crossing"], tmp_path / "run")
    do(folder)
    with pytest.raises(nmm.InputError, match=words) as caught:
        runs_in(folder)
    assert str(folder) in str(caught.value)
    assert status_of(["play", str(folder), "--no-open"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("nmm play: ")


def test_a_robot_whose_file_is_gone_is_named(tmp_path: Path) -> None:
    """Of a run made in Python, too; given the robot, the folder is read."""
    file = tmp_path / "mine.urdf"
    file.write_text(describe(bundled_robots()["unicycle_2r"], {}, ()).xml)
    robot = nmm.load(file)
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 1.0])
    run = nmm.simulate(nmm.Controller(robot, task, nmm.ProjectedGradient()), {}, 0.05)
    folder = run.save(tmp_path / "run", figures=False)
    file.unlink()
    with refused("run"):
        nmm.Trajectory.load(folder)
    np.testing.assert_array_equal(nmm.Trajectory.load(folder, robot).q, run.q)


def test_a_comparison_holds_folders_of_its_own(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = copied(folders["compared"], tmp_path / "compared")
    assert [run.resolver for run in runs_in(folder)] == ["rg", "pg"]
    content = json.loads((folder / "summary.json").read_text())
    content["runs"]["../../elsewhere"] = {}
    (folder / "summary.json").write_text(json.dumps(content))
    with refused("summary.json: runs", got="../../elsewhere"):
        runs_in(folder)
