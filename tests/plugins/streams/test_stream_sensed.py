"""Streams of what a sensor sees again and again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop_faults import PERIOD, make_loop
from ports import wait_for
from streamed import by_foxglove, by_rerun

import nmm
from nmm.base.arrays import Array

pytest.importorskip("foxglove")
pytest.importorskip("mcap_protobuf")
WALL = "wall"


def scanned(k: int) -> Array:
    """A patch that comes nearer, (N, 3), m."""
    rows = np.array([[3.0, 0.1 * i, 0.1 * j] for i in range(10) for j in range(10)])
    rows[:, 0] -= 0.001 * k
    return rows


class Seen:
    """A loop among a wall, two scans and a ball that moves, streamed into a file."""

    def __init__(self, tool: str, folder: Path) -> None:
        if tool == "rerun":
            pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
        robot = make_loop().controller.robot
        self.clouds = [nmm.PointCloud(scanned(0), 0.01, name) for name in ("scan", "other scan")]
        wall = nmm.Obstacle(nmm.Box([0.1, 1.0, 1.0]), [5.0, 0.0, 0.5], name=WALL)
        ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [5.0, 1.0 - t, 0.5], name="ball")
        apart = nmm.Collisions(0.03, self_collisions=False, obstacles=[*self.clouds, wall, ball])
        task = nmm.Task(nmm.Position("ee", "xy"), [0.6, 0.3])
        controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), collisions=apart)
        self.loop, self.q, self.k = nmm.Loop(controller, PERIOD), robot.q({"q1": 0.1, "q2": 0.5}), 0
        self.file = folder / ("loop.rrd" if tool == "rerun" else "loop.mcap")
        self.shown: Any = nmm.stream(self.loop, tool, file=self.file, rate=1000.0, start=0.0)

    def step(self, count: int = 1, scans: int = 0) -> None:
        for _ in range(count):
            for cloud in self.clouds[:scans]:
                cloud.update(scanned(self.k), wait=True)
            self.loop.step(self.k * PERIOD, self.q)
            self.shown(self.loop)
            self.k += 1
        wait_for(lambda: self.shown.sent + self.shown.dropped >= self.k)


def places(update: Any) -> dict[str, float]:
    """The least x of each entity."""
    return {
        one.id: min(point.x for point in surface.points) + surface.pose.position.x
        for one in update.entities
        for surface in one.triangles
    }


def test_what_is_sensed_is_sent_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once a second at most; the process that drives makes no surface of it."""
    made = list[str]()

    def here(*of: Any) -> None:
        made.append("here")
        raise AssertionError

    seen = Seen("foxglove", tmp_path)
    for name in ("nmm.model.collisions.elements.boxes.cell_mesh", "nmm.plugins.streams.robot_scene.surface"):
        monkeypatch.setattr(name, here)
    monkeypatch.setattr("nmm.plugins.streams.bodies.surface", here)
    with seen.shown:
        for _ in range(25):
            seen.step(10, scans=1)
    assert made == []
    assert seen.shown.trouble == ""
    found = by_foxglove(seen.file)
    scans, balls = found["/moving/scan"], found["/moving/ball"]
    assert len(scans) == 3  # of 250
    assert {name for _, update in scans for name in places(update)} == {"obstacle scan"}
    at = [places(update)["obstacle scan"] for _, update in scans]
    assert np.all(np.diff(at) < -0.05)  # it comes nearer by 0.1 m between two of them
    times = [1e-9 * stamp for stamp, _ in scans]
    np.testing.assert_allclose(times, times[0] + np.arange(3), atol=1e-6)
    assert [[*places(update)] for _, update in balls] == [["obstacle ball"]]
    assert len([tree for _, tree in found["/tf"] if "obstacle ball" in str(tree)]) >= 249
    assert "/moving/other scan" not in found
    first, *later = found["/scene"]
    assert {*places(first[1])} == {f"obstacle {name}" for name in ("scan", "other scan", WALL, "ball")}
    assert len(later) == 2  # each goes from there once
    assert {*places(later[-1][1])} == {"obstacle other scan", f"obstacle {WALL}"}


def test_a_client_that_takes_nothing_is_kept_some_megabytes(tmp_path: Path) -> None:
    """So many messages as wait for it at most, of their mean size beside a large scan and what moves."""
    from mcap.reader import make_reader

    from nmm.plugins.streams.foxglove_sink import BACKLOG

    robot, rng = make_loop().controller.robot, np.random.default_rng(1)
    scan = nmm.PointCloud(rng.uniform(2.0, 4.0, (4000, 3)), 0.01, "scan")
    ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [5.0, 1.0 - t, 0.5], name="ball")
    apart = nmm.Collisions(0.03, self_collisions=False, obstacles=[scan, ball])
    task = nmm.Task(nmm.Position("ee", "xy"), [0.6, 0.3])
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), collisions=apart)
    run = nmm.simulate(controller, robot.q({"q2": 0.5}), 0.5, 0.005)
    nmm.stream(run, "foxglove", file=tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as file:
        sizes = [len(message.data) for _, _, message in make_reader(file).iter_messages()]
    assert max(sizes) > 500_000  # the scan is there
    assert BACKLOG * np.mean(sizes) < 64e6


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_what_is_not_seen_any_more_is_taken_away(tool: str, tmp_path: Path) -> None:
    """Nothing is said of what is gone, once of what cannot be drawn; and both may come again."""
    seen = Seen(tool, tmp_path)
    with seen.shown:
        for rows in (scanned(0), np.zeros((0, 3)), scanned(0)):
            seen.clouds[0].update(rows, wait=True)
            seen.step(110)
        for _ in range(2):
            seen.clouds[1].update(scanned(0), wait=True)
            seen.clouds[1].shape.cell = np.full(3, np.nan)  # type: ignore[attr-defined]
            seen.step(110)
    assert seen.shown.trouble == ""
    if tool == "foxglove":
        found = by_foxglove(seen.file)
        drawn = [len(update.entities) for _, update in found["/moving/scan"]]
        gone = [one.id for _, update in found["/moving/scan"] for one in update.deletions]
        assert gone == ["obstacle scan"]
        assert [len(update.entities) for _, update in found["/moving/other scan"]] == [0, 0]
        told = [message.message for _, message in found["/log"]]
    else:
        rows = by_rerun(seen.file)
        drawn = [int(len(row) > 0) for row in rows["/world/obstacles/scan"]["Mesh3D:vertex_positions"]][-3:]
        other = [row for name, of in rows.items() if "other" in name for row in of["Mesh3D:vertex_positions"]]
        assert [len(row) > 0 for row in other] == [True, False, False]
        told = [row[0] for row in rows["/log"]["TextLog:text"]]
    assert drawn == [1, 0, 1]
    assert len([text for text in told if "other scan is not drawn: no surface can be made" in text]) == 1
    assert not [text for text in told if text.startswith("scan is not drawn")]
