"""Sightings that do not fit to an arm: what they would have to be is said."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from helpers import simulated_sightings as sim

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.arm.causes import expected_instead
from nmm.plugins.robot.calibration.arm.guess import board_poses
from nmm.plugins.robot.calibration.arm.model import ArmModel

Array = np.ndarray


@cache
def log_of(kind: str) -> nmm.Sightings:
    import tempfile
    from pathlib import Path

    made: Callable[..., nmm.Sightings] = getattr(sim, kind)
    readings = sim.looking(20) if kind == "corners" else sim.postures(24)
    return made(sim.Arm(sim.TRUTH, Path(tempfile.mkdtemp())), readings)


def told(kind: str, seen: Array | None = None, **more: Any) -> nmm.Sightings:
    """The log, with other pixels, places or poses, or another board."""
    log = log_of(kind)
    own = {"camera": log.camera, "board": log.board, "sensor": log.sensor} if kind == "corners" else {}
    rows = log.seen if seen is None else seen
    return nmm.Sightings("log", log.readings, rows, log.kind, log.on, log.by, **(own | more))


def expected(log: nmm.Sightings) -> str:
    model = ArmModel(sim.ur5(), [log])
    seen = board_poses(log) if log.kind == "corners" else log.seen if log.kind == "poses" else None
    return expected_instead(log, model.nominal(model.views[0], model.first), seen)


def grid(columns: int, rows: int) -> Array:
    return np.array([[0.03 * i, 0.03 * j, 0.0] for j in range(rows) for i in range(columns)])


def turned(every: int) -> Array:
    seen = np.array(log_of("corners").seen)
    seen[::every] = seen[::every, ::-1]
    return seen


def w_first() -> Array:
    from scipy.spatial.transform import Rotation

    M = log_of("poses").seen
    return np.column_stack([M[:, :3, 3], Rotation.from_matrix(M[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]]])


def in_mm(kind: str) -> Array:
    seen = np.array(log_of(kind).seen)
    if kind == "poses":
        seen[:, :3, 3] *= 1000.0
        return seen
    return 1000.0 * seen


CASES: list[tuple[Callable[[], nmm.Sightings], str]] = [
    (lambda: told("poses", np.linalg.inv(log_of("poses").seen)), "their inverse would fit"),
    (lambda: told("poses", w_first()), "w, x, y, z would fit"),
    (lambda: told("poses", in_mm("poses")), "what was seen in m: 0.001 times"),
    (lambda: told("points", in_mm("points")), "what was seen in m: 0.001 times"),
    (lambda: told("corners", board=1000.0 * sim.GRID), "the board's points in m: 0.001 times"),
    (lambda: told("corners", turned(2)), "from the other in 10 of 20 pictures would fit"),
    (lambda: told("corners", turned(3)), "from the other in 7 of 20 pictures would fit"),
    (lambda: told("corners", board=grid(6, 9)), "columns and rows the other way round it would fit"),
    (lambda: told("corners", board=grid(18, 3)), "single pictures are"),
    (lambda: told("points", log_of("points").seen[::-1]), "each joint's readings in its column"),
]  # fmt: skip


@pytest.mark.parametrize(("log", "text"), CASES)
def test_what_would_fit_is_said(log: Callable[[], nmm.Sightings], text: str) -> None:
    assert text in expected(log())


def test_pictures_with_the_board_from_its_other_end_are_told() -> None:
    seen = np.array(log_of("corners").seen)
    some = [3, 8, 15]
    seen[some] = seen[some, ::-1]
    found = nmm.calibrate(sim.ur5(), told("corners", seen), hold=("origin", "offset"))
    (finding,) = [one for one in found.findings if one.code == "board_turned"]
    assert finding.values["count"] == 3
    assert finding.values["sample"] == 3
    assert "board_turned" not in {
        one.code for one in nmm.calibrate(sim.ur5(), told("corners"), hold=("origin", "offset")).findings
    }


@pytest.mark.parametrize("case", [1, 7])
def test_what_cannot_be_fitted_is_refused_with_it(case: int) -> None:
    log, text = CASES[case]
    with pytest.raises(InputError, match=r"disagree by .* (px|mm)") as error:
        nmm.calibrate(sim.ur5(), log(), hold=("origin", "offset"))
    assert text in str(error.value)
    assert len(str(error.value)) <= 300
