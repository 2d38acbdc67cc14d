"""nmm map: what it writes and prints, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_pictures import draw_only

from nmm.base.errors import InputError
from nmm.cli.exit_status import status_of
from nmm.cli.mapping import map_measures
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load

POSITION: dict[str, Any] = {"task": ["position:ee:xy"], "samples": "24"}


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    draw_only([], monkeypatch)


def test_a_map_is_written_and_told(capsys: pytest.CaptureFixture[str]) -> None:
    map_measures(
        "unicycle_2r",
        task=["position:ee:xy"],
        over="q1, q2",
        ranges=["q1=-pi/2:pi/2"],
        samples="30x20",
        measure="sigma_min,weighted",
        at=["theta=pi/6"],
        alpha=0.25,
        weight=["platform=4"],
    )
    folder = Path("runs/unicycle_2r-map")
    written = json.loads((folder / "map.json").read_text(encoding="utf-8"))
    assert written["axes"][0] == {
        "name": "q1", "unit": "rad", "from": -np.pi / 2, "to": np.pi / 2, "samples": 30
    }  # fmt: skip
    assert written["held"]["theta"] == pytest.approx(np.pi / 6)
    assert written["weights"] == {"v": 4.0, "omega": 4.0}
    assert written["alpha"] == 0.25
    arrays = np.load(folder / "map.npz", allow_pickle=False)
    assert arrays["sigma_min"].shape == arrays["weighted"].shape == (20, 30)
    assert (folder / "weighted.png").exists()
    out = capsys.readouterr().out
    smallest = written["measures"]["weighted"]["smallest"]
    assert smallest["value"] == arrays["weighted"].min()
    row = next(line for line in out.splitlines() if line.startswith("weighted"))
    assert f"{smallest['value']:.4g}" in row
    assert "robot singular      none found" in out
    assert "arm alone singular  lines\n" in out
    assert written["arm_singular"] == {"lines": True, "points": 0, "everywhere": False}


def test_the_arguments_of_the_robot_count(capsys: pytest.CaptureFixture[str]) -> None:
    map_measures(
        "unicycle_2r",
        task=["position:ee:xy", "heading:link2"],
        settings=["d=0"],
        samples="40",
        out=Path("here"),
    )
    assert "robot singular  lines" in capsys.readouterr().out
    assert Path("here/sigma_min.png").exists()


def test_a_scenario_has_its_own_task_and_start() -> None:
    map_measures("unicycle_3r_position", over="q2,q3", samples="12")
    written = json.loads(Path("runs/unicycle_3r_position-map/map.json").read_text(encoding="utf-8"))
    assert written["task"] == ["ee.x", "ee.y", "ee.z"]
    assert set(written["held"]) == {"x", "y", "theta", "q1"}


def test_a_workspace_is_mapped(capsys: pytest.CaptureFixture[str]) -> None:
    map_measures("unicycle_2r", workspace="xy", at=["x=2"], **POSITION)
    written = json.loads(Path("runs/unicycle_2r-map/map.json").read_text(encoding="utf-8"))
    assert written["kind"] == "workspace"
    assert written["frame"] == "ee"
    assert written["held"] == {"x": 2.0, "y": 0.0, "theta": 0.0}
    first, second = written["axes"]
    assert first["from"] > 1.0  # around where the platform stands
    assert max(first["samples"], second["samples"]) == 24
    out = capsys.readouterr().out
    assert "reached" in out
    arrays = np.load("runs/unicycle_2r-map/map.npz", allow_pickle=False)
    assert arrays["best_q_sigma_min"].shape == (second["samples"], first["samples"], 5)


def test_a_folder_of_a_map_is_replaced_and_no_other(tmp_path: Path) -> None:
    map_measures("unicycle_2r", out=Path("map"), **POSITION)
    map_measures("unicycle_2r", out=Path("map"), measure="inverse_condition", **POSITION)
    assert not Path("map/sigma_min.png").exists()
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("mine")
    with pytest.raises(InputError, match="is not what this writes"):
        map_measures("unicycle_2r", out=Path("mine"), **POSITION)
    assert Path("mine/notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"samples": "1"}, "samples: expected a whole number from 2, got 1$"),
        ({"samples": "many"}, "--samples: expected a whole number"),
        ({"samples": "20x20x20"}, "--samples"),
        ({"samples": "20x30", "workspace": "xy"}, "--samples: expected one number with --workspace"),
        ({"over": "q1"}, "expected two coordinates"),
        ({"over": "q1,q7"}, "unknown coordinate 'q7'"),
        ({"over": ","}, "--over: expected names"),
        ({"over": "q1,q2", "workspace": "xy"}, "--over: expected with a map over two coordinates"),
        ({"ranges": ["q1=0"]}, r"--range: q1: expected LOWER:UPPER, as in -pi:pi, got '0'"),
        ({"ranges": ["q1"]}, "--range: expected NAME=LOWER:UPPER"),
        ({"ranges": ["q1=0:pie"]}, "--range: q1: unknown name 'pie'; expected a number"),
        ({"ranges": ["q1=1:0"]}, "range of q1: expected lower below upper"),
        ({"ranges": ["q1=0:1", "q1=0:2"]}, "q1 is given twice"),
        ({"frame": "ee"}, "--frame: expected with --workspace"),
        ({"height": "0:1"}, "--height: expected with --workspace"),
        ({"measure": "speed"}, "unknown measure 'speed'"),
        ({"part": "leg"}, "unknown part 'leg'"),
        ({"weight": ["leg=2"]}, "unknown input or group 'leg'"),
        ({"alpha": 2.0}, "alpha"),
        ({"task": None}, "expected --task"),
    ],
    ids=str,
)
def test_bad_input_is_named_and_nothing_is_written(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        map_measures("unicycle_2r", **(POSITION | wrong))
    assert not Path("runs").exists()


# Through the command line


LINES: list[tuple[list[str], str]] = [
    (["unicycle_2r", "--over", "q1,q9"], "unknown coordinate 'q9'"),
    (["unicycle_2r", "--over", "q1,q1"], "two different coordinates, got q1 twice"),
    (["unicycle_2r", "--range", "q1=1:1"], "range of q1: expected lower below upper"),
    (["unicycle_2r", "--measure", "sigma"], "unknown measure 'sigma'"),
    (["unicycle_2r", "--samples", "1"], "samples: expected a whole number from 2, got 1"),
    (
        ["unicycle_2r", "--task", "heading:link2", "--platform", "fixed"],
        "at most 2 rows, as many as inputs",
    ),
    (["unicycle_2r", "--out", "mine"], "is not what this writes"),
    (["unicycle_2r", "--workspace", "xw"], "plane: expected two of x, y, z"),
    (["unicycle_2r", "--workspace", "xy", "--frame", "hand"], "unknown frame 'hand'"),
    (["unicycle_2r", "--alpha", "half"], "--alpha"),
    (
        ["unicycle_2r", "--samples", "100000"],
        "expected at most 16000000 in all, as in 4000 x 4000, got 100000",
    ),
    (["unicycle_2r", "--samples", "4001", "--workspace", "xy"], "expected at most 16000000 in all"),
    (["unicycle_2r", "--range", "theta=0:1"], "theta is not on an axis of the map (q1, q2)"),
    (["unicycle_2r", "--range", "q9=0:1"], "unknown coordinate 'q9'; available: x, y, theta, q1, q2"),
    (
        ["unicycle_2r", "--at", "q2=1", "--workspace", "xy"],
        "--at: q2 is varied over the workspace (q1, q2)",
    ),
    (["unicycle_2r", "--at", "q2=1"], "--at: q2 is on an axis of the map (q1, q2)"),
    (
        ["unicycle_2r", "--part", "platform", "--platform", "fixed"],
        "platform of robot unicycle_2r has no inputs",
    ),
    (["unicycle_2r", "--measure", "condition"], "'inverse_condition'"),
    (["unicycle_9r"], "unicycle_9r"),
    ([], "SUBJECT"),
]


@pytest.mark.parametrize(("arguments", "message"), LINES, ids=lambda value: " ".join(value) or "nothing")
def test_bad_input_is_one_line_and_status_2(
    arguments: list[str], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("mine")
    task = ["--task", "position:ee:xy"] if arguments else []
    lock = ["--lock", "left_wheel_joint=0", "--lock", "right_wheel_joint=0"] if "fixed" in arguments else []
    refused(["map", *arguments[:1], *task, *arguments[1:], *lock], message, capfd)
    assert [str(path) for path in Path().iterdir()] == ["mine"]
    assert [path.name for path in Path("mine").iterdir()] == ["notes.txt"]


def test_a_robot_without_an_arm_has_no_workspace(capfd: pytest.CaptureFixture[str]) -> None:
    line = ["map", "differential_base", "--task", "position:base_footprint:xy", "--workspace", "xy"]
    refused(line, "expected a robot with an arm", capfd)


@pytest.mark.parametrize("plane", ["xz", "zy"])
def test_a_plane_seen_edge_on_is_refused(plane: str, capfd: pytest.CaptureFixture[str]) -> None:
    line = ["map", "unicycle_2r", "--task", "position", "--workspace", plane]
    z = Configuration(load("unicycle_2r"), np.zeros(5)).placement("ee").translation[2]
    refused(line, f"ee moves in a horizontal plane, z = {z:.4g} m only; try --workspace xy\n", capfd)


@pytest.mark.parametrize("measure", ["arm_manipulability", "weighted"])
def test_a_robot_without_an_arm_has_no_measure_of_it(measure: str, capfd: pytest.CaptureFixture[str]) -> None:
    line = ["map", "differential_base", "--task", "position:base_footprint:xy", "--over", "x,y"]
    message = f"measure {measure}: arm of robot differential_base has no inputs"
    refused([*line, "--measure", f"sigma_min,{measure}"], message, capfd)


def test_a_constant_map_has_its_value_everywhere(capfd: pytest.CaptureFixture[str]) -> None:
    """The angle of the platform turns J and changes no σ but by rounding."""
    line = ["map", "unicycle_2r", "--task", "position:ee:xy", "--over", "x,theta", "--at", "q2=pi/3"]
    assert status_of([*line, "--samples", "15"]) == 0
    written = json.loads(Path("runs/unicycle_2r-map/map.json").read_text(encoding="utf-8"))
    values = np.load("runs/unicycle_2r-map/map.npz", allow_pickle=False)["sigma_min"]
    assert np.ptp(values) < 1e-12
    for end, value in (("smallest", values.min()), ("largest", values.max())):
        assert written["measures"]["sigma_min"][end] == {"value": value, "at": None, "on": "everywhere"}
    out, _ = capfd.readouterr()
    row = next(line for line in out.splitlines() if line.startswith("sigma_min"))
    assert row.split().count("everywhere") == 2
    assert "=" not in row


def test_what_is_zero_everywhere_is_told_without_rounding(capfd: pytest.CaptureFixture[str]) -> None:
    """A folded arm loses rank, whatever its first joint and the platform do."""
    line = ["map", "unicycle_2r", "--task", "position:ee:xy", "--part", "arm", "--over", "theta,q1"]
    assert status_of([*line, "--at", "q2=pi", "--samples", "15", "--measure", "sigma_min,eccentricity"]) == 0
    written = json.loads(Path("runs/unicycle_2r-map/map.json").read_text(encoding="utf-8"))
    assert written["singular"]["everywhere"]
    for name, value in (("sigma_min", 0.0), ("eccentricity", 1.0)):
        for end in ("smallest", "largest"):
            assert written["measures"][name][end] == {"value": value, "at": None, "on": "everywhere"}
    assert "robot singular" not in capfd.readouterr().out


def refused(line: list[str], message: str, capfd: pytest.CaptureFixture[str]) -> None:
    status = status_of(line)
    out, err = capfd.readouterr()
    assert status == 2, err
    assert out == ""
    assert err.count("\n") == 1, err
    assert err.startswith("nmm map")
    assert message in err


def test_a_scenario_and_the_folder_of_its_run_are_subjects(capfd: pytest.CaptureFixture[str]) -> None:
    assert status_of(["run", "unicycle_2r_position", "--set", "duration=0.2", "--out", "run"]) == 0
    line = ["--over", "q1,q2", "--samples", "9x7"]
    assert status_of(["map", "unicycle_2r_position", *line, "--out", "of_scenario"]) == 0
    assert status_of(["map", "run", *line, "--out", "of_run"]) == 0
    out, _ = capfd.readouterr()
    assert "files in" in out
    scenario, run = (np.load(f"{name}/map.npz", allow_pickle=False) for name in ("of_scenario", "of_run"))
    for name in ("sigma_min", "q", "axis_0", "rank"):
        np.testing.assert_array_equal(scenario[name], run[name])
    # At another instant of the run the platform is elsewhere; J turns with it, and its σ do not change.
    assert status_of(["map", "run", *line, "--time", "0.2", "--out", "later"]) == 0
    later = np.load("later/map.npz", allow_pickle=False)
    assert np.abs(later["q"] - run["q"]).max() > 1e-4
    np.testing.assert_allclose(later["sigma_min"], run["sigma_min"], atol=1e-12)


def test_the_smallest_value_is_between_the_nodes(capfd: pytest.CaptureFixture[str]) -> None:
    line = ["--task", "position:ee:xy", "--task", "heading:link2", "--set", "d=0", "--samples", "20"]
    assert status_of(["map", "unicycle_2r", *line]) == 0
    row = next(line for line in capfd.readouterr().out.splitlines() if line.startswith("sigma_min"))
    assert row.split()[1:5] == ["0", "the", "singular", "lines"]
