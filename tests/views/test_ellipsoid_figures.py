"""Manipulability ellipsoids in figures and in the page's commands, and where they are asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ellipsoid_examples import directions, jacobian, load, swing
from figure_examples import PAPER, check_legible, cut, drawn_points, run
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from nmm.analysis.singular.ellipsoids import drawn_ellipsoids, drawn_scale, ellipsoids_along
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.cli.exit_status import status_of
from nmm.model.robots.motion import Motion
from nmm.views.figures.ellipses import ellipses
from nmm.views.playback.ellipsoids import CLOSE, EllipsoidOptions, SceneEllipsoids, between_error
from nmm.views.playback.extent import extent_of
from nmm.views.playback.keyframes import Keyframes

# What the page shows between its frames


def test_the_page_is_close_between_its_frames() -> None:
    """Frames half a radian apart are made denser until the page, which turns and scales evenly, is close."""
    robot = load("unicycle_3r")
    t = np.arange(0.0, 8.0, 0.35)
    motion = Motion(robot, t, swing(robot, t), np.zeros((len(t), robot.n_u)), frame="ee")
    frames = Keyframes(t, motion.q, np.zeros((len(t), 2)))
    scene = SceneEllipsoids([motion], [frames], EllipsoidOptions(scale=0.3))
    assert set(t) < set(scene.t[0])
    assert len(t) < len(scene.t[0]) <= 32 * len(t)
    q = np.array([np.interp(scene.t[0], t, column) for column in motion.q.T]).T
    middle = 0.5 * (q[1:] + q[:-1])
    largest = max(found.radii.max() for found in scene.parts[0].values())
    coarse = []
    for part, found in scene.parts[0].items():
        error = between_error(found, ellipsoids_along(robot, "ee", middle, part), 0.3)
        assert error.max() <= CLOSE * 0.3 * largest
        before = ellipsoids_along(robot, "ee", motion.q, part)
        between = ellipsoids_along(robot, "ee", 0.5 * (motion.q[1:] + motion.q[:-1]), part)
        coarse.append(between_error(before, between, 0.3).max())
    assert max(coarse) > 5.0 * CLOSE * 0.3 * largest


# Figures


def shapes(axes: Axes, label: str) -> list[Array]:
    (found,) = (one for one in axes.collections if one.get_label() == label)
    assert isinstance(found, PolyCollection)
    return [np.asarray(path.vertices) for path in found.get_paths()]


@pytest.mark.parametrize("name", PAPER)
def test_figures_are_legible_and_to_scale(name: str) -> None:
    trajectory = run(name)
    made = ellipses(trajectory, EllipsoidOptions(scale=0.25))
    check_legible(made)
    assert len(made.axes) == (2 if name == "unicycle_3r_position" else 1)
    assert "1 m/s is drawn as 0.25 m" in made.texts[0].get_text()
    for axes, view in zip(made.axes, ([0, 1], [0, 2]), strict=False):
        points = drawn_points(axes)
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        assert np.all((points > [left, low]) & (points < [right, high]))
        box = axes.get_position().transformed(made.transSubfigure)
        assert box.width / (right - left) == pytest.approx(box.height / (high - low), rel=1e-6)
        for label, part in (("whole robot", "robot"), ("arm alone", "arm")):
            drawn = shapes(axes, label)
            assert 6 <= len(drawn) <= 12
            for outline in drawn:
                # Around a point of the path, as far to all sides as the robot there moves in a second.
                middle = 0.5 * (outline.min(axis=0) + outline.max(axis=0))
                assert trajectory.path is not None
                k = int(np.argmin(np.linalg.norm(trajectory.path[:, view] - middle, axis=1)))
                np.testing.assert_allclose(trajectory.path[k, view], middle, atol=1e-3)
                if view == [0, 1]:
                    d = directions(8, 2)
                    reach = np.linalg.norm(
                        d @ jacobian(trajectory.robot, "ee", trajectory.q[k], part)[:2], axis=1
                    )
                    np.testing.assert_allclose(
                        ((outline - middle) @ d.T).max(axis=0), 0.25 * reach, atol=0.25 * 0.02
                    )


def test_figures_of_short_and_strange_runs() -> None:
    for count in (1, 2, 40):
        check_legible(ellipses(cut(run(PAPER[0]), count)))
    check_legible(ellipses(run(PAPER[0], method="euler", resolver__alpha=900)))
    with pytest.raises(InputError, match="at least one sample"):
        ellipses(cut(run(PAPER[0]), 0))


def test_the_scale_is_readable_and_round() -> None:
    trajectory = run(PAPER[0])
    robot = trajectory.robot
    found = drawn_ellipsoids(EllipsoidOptions(), robot, "ee", trajectory.q)
    extent = extent_of(robot, trajectory.q[0])
    scale = drawn_scale(EllipsoidOptions(), extent, [found])
    assert 0.15 * extent < scale * found["robot"].radii.max() <= extent / 3.0
    assert f"{scale:.0e}"[0] in "12345"
    assert float(f"{scale:.0e}") == pytest.approx(scale)
    assert drawn_scale(EllipsoidOptions(scale=0.07), extent, [found]) == 0.07


# Where they are asked for


def test_a_run_draws_them_when_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    short = ("--set", "duration=0.3")
    assert status_of(["run", "unicycle_2r_position", *short, "--out", "with", "--html", "--ellipsoids"]) == 0
    assert (tmp_path / "with" / "ellipses.png").read_bytes().startswith(b"\x89PNG")
    assert '"type":"ellipsoid"' in (tmp_path / "with" / "playback.html").read_text()
    assert status_of(["run", "unicycle_2r_position", *short, "--out", "without", "--html"]) == 0
    assert not (tmp_path / "without" / "ellipses.png").exists()
    assert '"type":"ellipsoid"' not in (tmp_path / "without" / "playback.html").read_text()
    scaled = ["compare", "unicycle_2r_position", *short, "--out", "both", "--ellipsoid-scale", "0.125"]
    assert status_of(scaled) == 0
    page = (tmp_path / "both" / "playback.html").read_text()
    assert page.count('"type":"ellipsoid"') == 4
    assert "1 m/s is drawn as 0.125 m" in page
    wrong = ["run", "unicycle_2r_position", *short, "--out", "wrong", "--ellipsoid-scale", "0"]
    assert status_of(wrong) == 2
    assert not (tmp_path / "wrong").exists()


def test_from_python(tmp_path: Path) -> None:
    trajectory = run(PAPER[0], duration=0.15)
    made = trajectory.plot_ellipses(tmp_path / "mine.png", EllipsoidOptions(frame="link2", scale=0.5))
    assert isinstance(made, Figure)
    assert "path of link2" in made.axes[0].get_legend_handles_labels()[1]
    assert (tmp_path / "mine.png").exists()
    trajectory.save(tmp_path / "run", ellipsoids=True)
    assert (tmp_path / "run" / "ellipses.png").exists()
    with pytest.raises(InputError, match="unknown frame 'hand'"):
        trajectory.save(tmp_path / "other", ellipsoids=EllipsoidOptions(frame="hand"))
    with pytest.raises(InputError, match="ellipsoids: expected True, False or EllipsoidOptions"):
        trajectory.save(tmp_path / "other", ellipsoids="yes")  # type: ignore[arg-type]  # wrong on purpose
    assert not (tmp_path / "other").exists()
