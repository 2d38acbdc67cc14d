"""The bundled scenarios among a scan and on a map: kept off, drawn as cells, in small pages."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import nmm
from nmm.base.bundled import bundled_scenarios

#: Three standard deviations of the scan's noise, m.
NOISE = 3 * 0.003


def least(run: nmm.Trajectory, obstacles: list[nmm.Obstacle]) -> float:
    """The least true distance of a run's samples, by Coal, m."""
    queries = nmm.Collisions(0.03, self_collisions=False, obstacles=obstacles).on(run.robot).queries
    return min(queries.nearest(0.0, q)[0] for q in run.q)


def true_boxes(root: Path) -> list[nmm.Obstacle]:
    """What was scanned."""
    boxes = runpy.run_path(str(root / "docs" / "make_sensed.py"))["BOXES"]
    return [nmm.Obstacle(nmm.Box(box[3:]), box[:3], name=f"box {k}") for k, box in enumerate(boxes)]


def test_the_scanned_door_is_kept_off_as_it_truly_is(pytestconfig: pytest.Config, tmp_path: Path) -> None:
    given = nmm.Scenario.load("unicycle_3r_scanned_door")
    run = given.run()
    assert run.outcome is nmm.Outcome.COMPLETED
    true = true_boxes(pytestconfig.rootpath)
    assert least(run, true) >= 0.03 - NOISE
    assert least(given.override("collisions", "null").run(), true) < 0.0
    page = run.save(tmp_path / "run", figures=False, html=True) / "playback.html"
    assert page.stat().st_size < 2_000_000


def test_the_mapped_rooms_are_kept_off_pixel_by_pixel(pytestconfig: pytest.Config, tmp_path: Path) -> None:
    """Each black pixel near the robot's way is a box of its own."""
    from PIL import Image

    given = nmm.Scenario.load("unicycle_3r_mapped_rooms")
    run = given.run()
    assert run.outcome is nmm.Outcome.COMPLETED
    folder = bundled_scenarios()["unicycle_3r_mapped_rooms"].parent / "sensed"
    with Image.open(folder / "rooms.png") as picture:
        pixels = np.array(picture)
    rows, columns = np.nonzero(pixels == 0)
    centres = np.column_stack(
        [-1.0 + 0.05 * (columns + 0.5), -2.5 + 0.05 * (len(pixels) - rows - 0.5), np.full(len(rows), 0.4)]
    )
    inner = (np.abs(centres[:, 0] - 2.35) < 0.1) | (np.hypot(*(centres[:, :2] - [3.6, 0.7]).T) < 0.6)
    cells = centres[inner][::3]
    boxes = [nmm.Obstacle(nmm.Box([0.05, 0.05, 0.8]), at, name=f"{k}") for k, at in enumerate(cells)]
    assert len(boxes) > 50
    assert least(run, boxes) >= 0.03 - 1e-6
    assert least(given.override("collisions", "null").run(), boxes) < 0.0
    page = run.save(tmp_path / "run", figures=False, html=True) / "playback.html"
    assert page.stat().st_size < 2_000_000


def test_a_figure_draws_the_cells_of_a_scan_and_not_a_box_around_them() -> None:
    """The door is open in it."""
    from matplotlib.collections import PolyCollection

    run = nmm.Scenario.load("unicycle_3r_scanned_door").run()
    axes = nmm.figures.stroboscopic(run).axes[0]
    (drawn,) = [
        part for part in axes.collections if isinstance(part, PolyCollection) and part.get_rasterized()
    ]
    corners = np.vstack([path.vertices for path in drawn.get_paths()])
    assert corners[:, 0].min() == pytest.approx(1.95, abs=0.06)
    assert corners[:, 0].max() == pytest.approx(4.6, abs=0.06)
    free = [path for path in drawn.get_paths() if 2.3 < path.vertices[:, 0].mean() < 3.3]
    assert free == []
