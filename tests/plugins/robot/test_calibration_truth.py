"""Calibrations beside another engine's truth, and beside least squares of a plain model."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

import nmm

sys.path.insert(0, str(ROOT / "benchmarks"))

import calibration_plain  # a script, found by the path above

pytest.importorskip("mujoco")

import calibration_drives  # after what they need
import calibration_squares  # after what they need
import calibration_truth  # after what they need
import calibration_worlds  # after what they need

#: How far numbers of drives without noise are off: steps of MuJoCo, tyres that give, servos, ticks.
#: Radii as shares of them.
NEAR = {"radius": 4e-4, "track": 1e-3, "wheelbase": 1e-3, "half_length_plus_width": 2e-4, "ratio": 1e-3}


@pytest.mark.parametrize("name", ["differential_base", "car_base"])
def test_least_squares_of_a_plain_model_by_numeric_derivatives_ends_where_ours_does(name: str) -> None:
    """Nothing of nmm's kernels is in it: the same residuals, and the same numbers, from the file's on."""
    robot, log = calibration_plain.log_of(name, 20.0)
    found = nmm.calibrate(robot, log)
    plain = calibration_plain.Plain(found)
    values, one = found.fit.values[found.fit.free], found.fit.filtered[0]
    ours = np.concatenate([one.w[one.taken].ravel(), one.agreement.over])
    theirs = plain.residuals(values)
    begins = np.repeat(~one.taken, 3)
    theirs = np.concatenate([theirs[: len(begins)][~begins], theirs[len(begins) :]])
    np.testing.assert_allclose(theirs, ours, rtol=0, atol=5e-3)
    solved = plain.solved()
    assert np.abs(solved.x - values).max() < np.abs(solved.x - plain.first).max()
    assert (np.abs(solved.x - values) / found.fit.deviations).max() < 0.05


@pytest.mark.parametrize("platform", ["differential", "car", "mecanum"])
def test_drives_in_mujoco_without_noise_show_the_numbers_of_its_file(platform: str) -> None:
    """Radii to 0.04 %; a delay to 0.2 ms."""
    rng = np.random.default_rng(5)
    world = calibration_worlds.PLATFORMS[platform](rng)
    log, reference = calibration_drives.drive(world, 30.0, rng, noise=False)
    found = nmm.calibrate(world.robot, log)
    for name, true in world.truth.items():
        number = found.numbers[name]
        assert number.why == "learned"
        kind = name.split(".")[0]
        near = NEAR.get(kind, 1e-3) * (true if kind == "radius" else 1.0)
        assert number.after == pytest.approx(true, rel=0.0, abs=near), name
    assert found.numbers["delay"].after == pytest.approx(reference["delay"], abs=2e-4)
    assert found.numbers["reference.x"].after == pytest.approx(reference["reference.x"], abs=5e-4)


def test_a_drive_that_mujoco_warns_of_is_no_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And it leaves no file, which MuJoCo else writes where it runs."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    world = calibration_worlds.PLATFORMS["differential"](rng)
    with pytest.raises(RuntimeError, match=r"MuJoCo: .*unstable"):
        calibration_drives.drive(world, 2.0, rng, inputs=lambda t, _: np.full((len(t), 2), 1e12))
    assert [*tmp_path.iterdir()] == []


def test_a_run_of_the_table_is_read_again(tmp_path: object) -> None:
    made = [calibration_truth.run("differential", seed, 20.0) for seed in range(2)]
    lines = calibration_truth.table(made)
    assert lines[2].startswith("| differential | radius.left_wheel_joint | 2 |")
    (row,) = [row for row in calibration_truth.rows(made) if row[1] == "track"]
    off = [
        (one["numbers"]["track"][1] - one["numbers"]["track"][0]) / one["numbers"]["track"][2] for one in made
    ]
    assert row[3:5] == (np.mean(np.abs(off) < 2.0), np.mean(off))


def test_hitches_that_slipping_wheels_turn_show_lengths_of_trailers_to_a_millimetre() -> None:
    """Their noise goes with that of the wheels: taken by itself, deviations were six times as large."""
    numbers = calibration_truth.run("tractor, two trailers", 0)["numbers"]
    for name, near in (("H1", 4e-4), ("L1", 2e-3), ("H2", 2e-3), ("L2", 1e-3)):
        true, after, deviation = numbers[name]
        assert deviation < near, name
        assert after == pytest.approx(true, abs=4.0 * deviation), name


@pytest.mark.thorough
@pytest.mark.parametrize("platform", calibration_worlds.PLATFORMS)
def test_deviations_hold_in_mujoco_as_often_as_they_claim(platform: str) -> None:
    """All numbers of twelve runs together within two of their deviations in 95 %, at most four of the
    binomial's deviations of the runs off, since numbers of a run go together; none off on average."""
    made = [calibration_truth.run(platform, seed) for seed in range(12)]
    rows = calibration_truth.rows(made)
    share = float(np.mean([row[3] for row in rows]))
    assert share > 0.954 - 4.0 * np.sqrt(0.954 * 0.046 / 12)
    off = {row[1]: abs(row[4]) / max(row[5], 1.0) for row in rows}
    assert max(off.values()) < 4.0 / np.sqrt(12)


@pytest.mark.thorough
def test_squares_in_mujoco_show_what_umbmark_shows() -> None:
    told = calibration_squares.squares_run(0)["numbers"]
    for name, near in (("E_d", 2e-3), ("track", 5e-3)):
        for by in ("the ends", "UMBmark"):
            true, after, _ = told[f"{name} by {by}"]
            assert after == pytest.approx(true, abs=near), (name, by)
