"""A robot's own frame that sees or is seen, and one that is taken for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import simulated_sightings as sim
from scipy.spatial.transform import Rotation

import nmm
from nmm.base.errors import InputError

MOUNTS = ("origin", "offset")


def by(frame: str, tmp_path: Path, **more: str) -> nmm.Sightings:
    """A body in the hall as UR5's tool0 sees it, told to be what another frame sees."""
    readings = sim.postures(16)
    hand = sim.Arm({}, tmp_path).placements(readings, "tool0")
    seen = np.linalg.inv(hand) @ sim.matrix(sim.BOARD)
    seen[:, :3, 3] += 1e-4 * np.random.default_rng(2).normal(size=(16, 3))
    return nmm.Sightings("seen.csv", readings, seen, "poses", on="world", by=frame, **more)


def test_another_frame_than_the_one_that_sees_is_refused_with_the_one_that_fits(tmp_path: Path) -> None:
    """ee_link is at the same place as tool0 and turned by 120 degrees."""
    expected = r"ee_link would stand .* m and 2\.\d* rad .*expected by='tool0', which .*or sensor= a name"
    with pytest.raises(InputError, match=expected) as error:
        nmm.calibrate(sim.ur5(), by("ee_link", tmp_path), hold=MOUNTS)
    assert len(str(error.value)) <= 300
    assert "seen.csv" in str(error.value)
    found = nmm.calibrate(sim.ur5(), by("tool0", tmp_path), hold=MOUNTS)
    assert abs(found.numbers["origin.tool0.roll"].after) < 1e-3
    mounted = nmm.calibrate(sim.ur5(), by("ee_link", tmp_path, sensor="eye"), hold=MOUNTS)
    assert "eye.roll" in mounted.learned


def test_a_frame_that_only_carries_what_sees_is_refused(tmp_path: Path) -> None:
    """tool0 carries a camera that no frame is near to."""
    log = sim.corners(sim.Arm({}, tmp_path), sim.looking(12), sensor="")
    with pytest.raises(InputError, match=r"tool0 would stand .* expected sensor= a name .*with_numbers"):
        nmm.calibrate(sim.ur5(), log, hold=MOUNTS)


def test_a_frame_may_be_elsewhere_where_it_is_told_to_be(tmp_path: Path) -> None:
    file = nmm.Configuration(sim.ur5(), sim.ur5().rest)
    at = file.placement("ee_link").inverse() * file.placement("tool0")
    parts = [*at.translation, *Rotation.from_matrix(at.rotation).as_euler("xyz")]
    about = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), parts, strict=True))
    angles = {f"origin.ee_link.{part}": about[part] for part in ("roll", "pitch", "yaw")}
    held = nmm.calibrate(sim.ur5(), by("ee_link", tmp_path), hold=dict.fromkeys(MOUNTS) | angles)
    assert [held.numbers[name].after for name in angles] == [*angles.values()]
    about = {f"origin.ee_link.{part}": value + 0.02 for part, value in about.items()}
    told = nmm.with_numbers(sim.ur5(), about)
    found = nmm.calibrate(told, by("ee_link", tmp_path), hold=MOUNTS)
    assert all(
        found.numbers[name].after == pytest.approx(value - 0.02, abs=1e-3) for name, value in about.items()
    )
