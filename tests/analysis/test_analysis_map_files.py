"""What a map tells, writes and draws, and what it refuses."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nmm.analysis.maps.coordinates import singularity_map
from nmm.analysis.maps.singular_set import SingularSet
from nmm.analysis.maps.workspace import workspace_map
from nmm.base.errors import InputError
from nmm.control.functions.tasks import Heading, Position
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot
from nmm.views.folders.map import is_map

PLANAR = Position("ee", "xy")
WITH_HEADING = (PLANAR, Heading("link2"))


def test_extremes_count_the_singular_places_that_the_grid_misses(robot_2r: Robot) -> None:
    measures = ("sigma_min", "eccentricity", "arm_manipulability", "platform_manipulability", "weighted")
    made = singularity_map((robot_2r, PLANAR), samples=20, measures=measures)
    assert made.singular.empty
    found = made.extremes("sigma_min")
    assert found["smallest"].value == made.values["sigma_min"].min()
    assert found["smallest"].on == ""
    smallest = made.extremes("arm_manipulability")["smallest"]
    assert smallest.value == 0.0
    assert smallest.on == "the arm's singular lines"
    assert np.sin(smallest.at[1]) == pytest.approx(0.0, abs=1e-9)

    robot = load("unicycle_2r", arguments={"d": 0.0})
    made = singularity_map((robot, WITH_HEADING), samples=20, measures=(*measures, "manipulability"))
    assert made.values["sigma_min"].min() > 1e-3  # no node is on a line
    for name in made.values:
        end, value = ("largest", 1.0) if name == "eccentricity" else ("smallest", 0.0)
        found = made.extremes(name)
        assert found[end].value == value
        written = made.summary()["measures"][name][end]
        if name in ("arm_manipulability", "platform_manipulability"):  # two inputs, three rows
            assert np.all(made.values[name] == 0.0)
            assert written == {"value": 0.0, "at": None, "on": "everywhere"}
            continue
        assert np.cos(found[end].at[0]) == pytest.approx(0.0, abs=1e-9)
        assert written == {"value": value, "at": list(found[end].at), "on": "the singular lines"}


def test_equal_nodes_beside_a_singular_line_are_no_constant_map(robot_2r: Robot) -> None:
    """The arm's w is l1 l2 |sin q2|: the same at -1 and 1, and 0 between them."""
    ranges = {"q1": (0.0, 1.0), "q2": (-1.0, 1.0)}
    made = singularity_map(
        (robot_2r, PLANAR), samples=2, ranges=ranges, measures="manipulability", part="arm"
    )
    assert np.ptp(made.values["manipulability"]) < 1e-12
    made = dataclasses.replace(made, singular=SingularSet((np.array([[0.0, 0.0], [1.0, 0.0]]),)))
    found = made.extremes("manipulability")
    assert found["smallest"][::2] == (0.0, "the singular lines")
    assert found["largest"].on == ""


def test_only_the_worst_postures_of_a_workspace_are_singular(robot_2r: Robot) -> None:
    made = workspace_map(
        (robot_2r, PLANAR), samples=30, configurations=1024, measures=("sigma_min", "arm_manipulability")
    )
    name = "arm_manipulability"
    best = np.nanmin(made.values[name])
    assert made.extremes(name)["smallest"][::2] == (best, "")
    assert made.extremes(name, worst=True)["smallest"][::2] == (0.0, "the arm's singular lines")
    assert made.summary()["measures"][name]["worst"]["smallest"]["value"] == 0.0


def test_a_map_is_written_and_replaced_only_by_another(tmp_path: Path, robot_2r: Robot) -> None:
    made = singularity_map((robot_2r, PLANAR), samples=20, measures=("sigma_min", "weighted"))
    folder = made.save(tmp_path / "map")
    assert is_map(folder)
    assert {file.name for file in folder.iterdir()} == {
        "map.npz", "map.json", "sigma_min.png", "weighted.png"
    }  # fmt: skip
    arrays = np.load(folder / "map.npz", allow_pickle=False)
    np.testing.assert_array_equal(arrays["weighted"], made.values["weighted"])
    np.testing.assert_array_equal(arrays["axis_1"], made.axes[1])
    lines = arrays["arm_singular_lines"]
    assert np.isnan(lines).all(axis=1).sum() == 3
    made.save(folder)
    other = tmp_path / "other"
    other.mkdir()
    (other / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="is not what this writes"):
        made.save(other)
    with pytest.raises(InputError, match="unknown measure 'condition'"):
        made.plot("condition")


def test_a_figure_says_what_is_singular(robot_2r: Robot, tmp_path: Path) -> None:
    made = singularity_map((robot_2r, PLANAR), samples=20)
    figure = made.plot("sigma_min", tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 10_000
    axes, bar = figure.axes
    names = axes.get_legend_handles_labels()[1]
    assert names == ["arm alone singular", "robot singular: none found"]
    assert axes.get_xlabel() == "q₁ [rad]"
    assert bar.get_ylabel() == r"$\mathregular{σ_{min}}$ [mixed units]"
    figure.canvas.draw()
    assert "π/2" in [tick.get_text() for tick in axes.get_xticklabels()]


def test_a_workspace_shows_the_robot_in_its_extreme_postures(robot_2r: Robot) -> None:
    """To scale and in the map's plane: from joint to joint to the frame, which is in the extreme cell."""
    name = "sigma_min"
    for plane in ("xy", "yx"):
        made = workspace_map(
            (robot_2r, PLANAR), plane=plane, samples=20, configurations=1024, at={"x": 2.0, "theta": 0.5}
        )
        ends = [("largest", made.best_q), ("smallest", made.worst_q)]
        for axes, (end, q) in zip(made.plot(name).axes, ends, strict=False):
            at = made.extremes(name, worst=end == "smallest")[end].at
            cell = [int(np.argmin(np.abs(axis - x))) for axis, x in zip(made.axes, at, strict=True)]
            here = Configuration(robot_2r, q[name][cell[1], cell[0]])
            rows = ["xyz".index(axis) for axis in plane]
            points = [here.placement(frame).translation[rows] for frame in ("link1", "link2", "ee")]
            drawn = [np.asarray(line.get_xydata()) for line in axes.lines]
            for a, b in pairwise(points):
                assert any(
                    len(line) == 2 and min(np.abs(line - [a, b]).max(), np.abs(line - [b, a]).max()) < 1e-9
                    for line in drawn
                )
            half = np.diff(made.axes[0][:2]) * 0.51
            assert np.all(np.abs(points[-1] - at) <= half)


def test_progress_rises_to_one(robot_2r: Robot) -> None:
    for make in (
        lambda report: singularity_map((robot_2r, PLANAR), samples=100, progress=report),
        lambda report: workspace_map((robot_2r, PLANAR), samples=20, configurations=8192, progress=report),
    ):
        seen: list[float] = []
        make(seen.append)
        assert seen == sorted(seen)
        assert seen[0] >= 0.0
        assert seen[-1] == 1.0
        assert np.diff(seen).max() < 0.2
        # Of the last tenth, where singular places are searched, too.
        assert sum(0.9 < done < 1.0 for done in seen) >= 3


BAD: list[tuple[dict[str, Any], str]] = [
    ({"over": ("q1", "q9")}, r"unknown coordinate 'q9'.*available: x, y, theta, q1, q2"),
    ({"over": ("q1", "q1")}, "two different coordinates, got q1 twice"),
    ({"over": ("q1",)}, "expected two coordinates"),
    ({"ranges": {"q1": (1.0, 1.0)}}, "range of q1: expected lower below upper, got 1 to 1"),
    ({"ranges": {"q1": (1.0, np.inf)}}, "range of q1: expected finite numbers"),
    ({"ranges": {"theta": (0.0, 1.0)}}, r"theta is not on an axis of the map \(q1, q2\)"),
    ({"ranges": {"q9": (0.0, 1.0)}}, "unknown coordinate 'q9'"),
    ({"at": {"q1": 1.0}}, r"at: q1 is on an axis of the map \(q1, q2\)"),
    ({"samples": (4000, 4001)}, "samples: expected at most 16000000 in all"),
    ({"samples": 1}, "samples: expected a whole number from 2, got 1"),
    ({"samples": (20, 1)}, "samples: expected a whole number from 2, got 1"),
    ({"samples": 2.5}, "samples: expected a whole number from 2, got 2.5"),
    ({"samples": "64"}, "samples: expected a whole number from 2, got '64'"),
    ({"samples": (20, 20, 20)}, r"samples: expected a whole number, or two, got \(20, 20, 20\)"),
    ({"measures": ("sigma_max",)}, r"unknown measure 'sigma_max' \(did you mean 'sigma_min'\?\)"),
    ({"measures": ()}, "at least one"),
    ({"part": "leg"}, "unknown part 'leg'"),
    ({"alpha": 1.2}, "alpha: expected a number from 0 to 1"),
    ({"weights": {"leg": 2.0}}, "unknown input or group 'leg'"),
    ({"weights": {"arm": 0.0}}, "above 0"),
    ({"at": [1.0]}, "expected 5 numbers"),
]


@pytest.mark.parametrize(("wrong", "message"), BAD, ids=[str(wrong) for wrong, _ in BAD])
def test_bad_input_is_named(robot_2r: Robot, wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        singularity_map((robot_2r, PLANAR), **wrong)


def test_a_task_of_more_rows_than_inputs_has_no_map(fixed_2r: Robot) -> None:
    with pytest.raises(InputError, match=r"task: expected at most 2 rows.*, got 3$"):
        singularity_map((fixed_2r, WITH_HEADING))
