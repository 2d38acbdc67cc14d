"""`nmm redundancy` and `nmm laps`: what they print and write, and what they refuse."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_scenario import MINIMAL

import nmm
import nmm.cli.redundancy
from nmm.analysis.null_space.moving import self_motion
from nmm.analysis.null_space.report import redundancy as report_of
from nmm.base.errors import InputError, SingularError
from nmm.cli.redundancy import direction_of, laps, redundancy
from nmm.control.functions.tasks import Position

BENT = ["theta=0.3", "q1=0.4", "q2=0.7"]
ROUND = "{kind: circle, center: [1.2, 0.2], radius: 0.1, rate: pi}"

Printed = pytest.CaptureFixture[str]


@pytest.fixture
def round_path(tmp_path: Path) -> Path:
    """A scenario that goes round in two seconds."""
    path = tmp_path / "round.yaml"
    path.write_text(MINIMAL.replace("[1, 0.5]", ROUND), encoding="utf-8")
    return path


def test_the_report_is_the_librarys(capsys: Printed) -> None:
    redundancy("unicycle_2r", task=["position"], at=BENT)
    q = dict(text.split("=") for text in BENT)
    robot = nmm.load("unicycle_2r")
    expected = report_of((robot, Position("ee", "xy")), {name: float(value) for name, value in q.items()})
    out = capsys.readouterr().out
    assert out.strip() == expected.text()
    for part in (
        "n - s = 5 - 2 = 3",
        "n_u - s = 4 - 2 = 2",
        "n = 5 coordinates, n_u = 4 inputs, s = 2 rows",
        "the wheels withhold 1 of them, which",
        *expected.texts,
    ):
        assert part in out


def test_options_of_the_robot_and_of_a_scenario(capsys: Printed) -> None:
    redundancy("unicycle_2r", task=["position"], at=["q1=pi/2"], settings=["d=0"])
    assert "J is singular" in capsys.readouterr().out
    redundancy("unicycle_3r_position")
    assert "n - s = 6 - 3 = 3" in capsys.readouterr().out
    redundancy("unicycle_2r", task=["position"], platform="omnidirectional")
    assert "every self-motion" not in capsys.readouterr().out


def test_a_self_motion_is_told_and_written(capsys: Printed, tmp_path: Path) -> None:
    page = tmp_path / "motion.html"
    redundancy("unicycle_2r", task=["position"], at=BENT, self_motion="1", duration=1.0, speed=0.4, html=page)
    out = capsys.readouterr().out
    robot = nmm.load("unicycle_2r")
    q0 = robot.q({"theta": 0.3, "q1": 0.4, "q2": 0.7})
    moved = self_motion((robot, Position("ee", "xy")), q0, direction=1, duration=1.0, speed=0.4)
    assert f"self-motion: {moved.text}, and back" in out
    q2 = next(line.split() for line in out.splitlines() if line.startswith("q2 "))
    q = moved.trajectory.q[:, 4]
    expected = [q[0], q[moved.turning], q.min(), q.max()]
    np.testing.assert_allclose([float(text) for text in q2[2:]], expected, rtol=1e-3)
    assert "the task stays within" in out
    assert f"written: {page}" in out
    text = page.read_text(encoding="utf-8")
    assert f"<title>unicycle_2r: {moved.text}" in text


@pytest.mark.parametrize(
    ("text", "direction"),
    [("0", 0), (" 3", 3), ("-1", -1), ("v", "v"), ("v=-1,q2=pi/2", {"v": -1.0, "q2": np.pi / 2})],
)
def test_directions(text: str, direction: Any) -> None:
    assert direction_of(text) == direction


def test_what_ends_a_self_motion_is_warned_of(capsys: Printed) -> None:
    redundancy("kinova_car", self_motion="steering_rate", duration=8.0, speed=0.5)
    printed = capsys.readouterr()
    assert "turns back early: steering at the limit" in printed.err


def test_what_is_rounding_is_printed_as_zero(capsys: Printed) -> None:
    """Along its own axis the platform of a motion straight ahead neither slides nor turns."""
    redundancy("unicycle_2r", task=["position"], at=["q2=pi/3"], self_motion="0", duration=1.0)
    cells = {line.split()[0]: line.split() for line in capsys.readouterr().out.splitlines() if line}
    assert cells["y"][2:] == cells["theta"][2:] == ["0"] * 4
    assert float(cells["x"][5]) > 0.01


def test_a_short_motion_has_samples_of_its_own(capsys: Printed) -> None:
    redundancy("unicycle_2r", task=["position"], at=BENT, self_motion="0", duration=0.01)
    assert "over 0.02 s" in capsys.readouterr().out


def test_a_motion_that_cannot_begin_comes_after_the_report(capsys: Printed) -> None:
    with pytest.raises(SingularError, match="q is singular"):
        redundancy("unicycle_2r", task=["position"], at=["q1=pi/2"], settings=["d=0"], self_motion="0")
    assert "J is singular" in capsys.readouterr().out


@pytest.mark.parametrize("width", [60, 80])
def test_lines_go_on_below_themselves_on_a_terminal(
    width: int, capsys: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Breaks are between words alone, and what goes on is indented deeper than what begins."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(width))
    redundancy("car_steered_by_the_null_space")
    narrow = capsys.readouterr().out
    for name in ("FORCE_COLOR", "COLUMNS"):
        monkeypatch.delenv(name)
    redundancy("car_steered_by_the_null_space")
    wide = capsys.readouterr().out
    assert narrow.split() == wide.split()
    assert max(len(line) for line in narrow.splitlines()) <= width
    begins = [line for line in wide.splitlines() if line]
    rest = iter(line for line in narrow.splitlines() if line)
    for line in begins:
        first = next(rest)
        got = first.split()
        indent = len(line) - len(line.lstrip())
        assert len(first) - len(first.lstrip()) == indent
        while len(got) < len(line.split()):
            more = next(rest)
            assert len(more) - len(more.lstrip()) == indent + 2
            got += more.split()


def test_a_long_sentence_is_no_title(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    redundancy("ur5_unicycle_pose", self_motion="v", duration=0.5, html=page)
    assert "<title>differential_base with ur5: self-motion" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: redundancy("unicycle_2r"), "expected --task"),
        (lambda: redundancy("unicycle_2r", task=["position"], play=True), "expected --self-motion"),
        (lambda: redundancy("unicycle_2r", task=["position"], html=Path("x.html")), "expected --self-motion"),
        (
            lambda: redundancy("unicycle_2r", task=["position"], self_motion="9"),
            "--self-motion: .*from 0 to 1, got 9",
        ),
        (
            lambda: redundancy("unicycle_2r", task=["position"], self_motion="w"),
            "--self-motion: unknown input 'w'",
        ),
        (lambda: redundancy("unicycle_2r", task=["position"], self_motion="v=x"), "--self-motion: v"),
        (lambda: redundancy("unicycle_2r", task=["position"], self_motion="v,q2=1"), "INPUT=RATE"),
        (lambda: redundancy("unicycle_2r", task=["position"], self_motion="0", speed=0.0), "^--speed"),
        (lambda: redundancy("unicycle_2r", task=["position"], self_motion="v="), "--self-motion: v"),
        (lambda: redundancy("unicycle_2r", task=["position"], self_motion=" "), "--self-motion: expected"),
        (lambda: redundancy("unicycle_2r", task=["position"], duration=-1.0), "^--duration"),
        (
            lambda: redundancy(
                "unicycle_2r", task=["position"], at=["q1=pi/2"], settings=["d=0"], self_motion="w"
            ),
            "--self-motion: unknown input 'w'",
        ),
        (
            lambda: redundancy(
                "unicycle_2r", task=["position"], self_motion="0", html=Path("nowhere") / "x.html"
            ),
            "--html: nowhere/x.html cannot be written",
        ),
        (lambda: redundancy("unicycle_2r", task=["position"], self_motion="0", html=Path()), "is a folder"),
        (lambda: redundancy("unicycle_2r", task=["pose"]), "expected at most 4"),
        (lambda: redundancy("no_such_robot", task=["position"]), "no_such_robot"),
        (lambda: laps("unicycle_2r_position", resolvers=" , "), "--resolvers"),
        (lambda: laps("unicycle_2r_position", resolvers="rg,best"), "best"),
        (lambda: laps("unicycle_2r_manipulability", resolvers="rg,ej"), "--set resolver.kind=ej --set 'res"),
        (lambda: laps("unicycle_2r_position", number=0), "^--laps: expected a whole number"),
        (lambda: laps("unicycle_2r_position", period=7.0), "^--period: .* not where it was 7 s before"),
        (lambda: laps("unicycle_3r_spline"), "^--period: .* does not say its period"),
        (lambda: laps("no_such_scenario"), "no_such_scenario"),
    ],
)
def test_bad_input(
    call: Callable[[], int], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        call()
    assert capsys.readouterr().out == ""
    assert list(tmp_path.iterdir()) == []


def test_laps_are_printed_and_written(capsys: Printed, round_path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "laps"
    assert laps(str(round_path), number=3, out=folder) == 0
    out = capsys.readouterr().out
    assert "period 2 s" in out
    assert "lap 1 begins" in out
    assert sorted(path.name for path in folder.iterdir()) == [
        "laps.csv",
        "laps.png",
        "pg",
        "rg",
        "summary.json",
    ]
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["complete"]
    assert list(summary["laps"]) == ["rg", "pg"]
    with (folder / "laps.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["resolver"], row["lap"]) for row in rows] == [
        (k, str(lap)) for k in ("rg", "pg") for lap in range(4)
    ]
    for kind in ("rg", "pg"):
        run = nmm.Trajectory.load(folder / kind)
        steps = (len(run) - 1) // 3
        own = [row for row in rows if row["resolver"] == kind]
        np.testing.assert_array_equal([float(row["q2"]) for row in own], run.q[::steps, 4])
        drift = np.diff(run.q[::steps], axis=0)
        np.testing.assert_array_equal([float(row["drift_x"]) for row in own[1:]], drift[:, 0])
        distance = summary["laps"][kind]["distance"]
        np.testing.assert_array_equal([float(row["posture_drift"]) for row in own[1:]], distance)
        assert own[0]["drift_x"] == own[0]["posture_drift"] == ""
        assert summary["laps"][kind]["verdict"] in out
    assert f"files in  {folder}" in out
    assert (folder / "laps.png").read_bytes().startswith(b"\x89PNG")


def test_settings_and_periods_reach_the_laps(round_path: Path, tmp_path: Path, capsys: Printed) -> None:
    settings = ["task.reference.rate=2*pi", "dt=0.02"]
    status = laps(
        str(round_path), resolvers="pg", settings=settings, number=1, period=3.0, out=tmp_path / "a"
    )
    assert status == 0
    run = nmm.Trajectory.load(tmp_path / "a" / "pg")
    assert run.t[-1] == pytest.approx(3.0)
    assert run.dt == pytest.approx(0.02)
    assert "period 3 s" in capsys.readouterr().out


def test_the_folder_is_replaced_if_it_is_ours(round_path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "laps"
    for kind in ("pg", "rg"):
        assert laps(str(round_path), resolvers=kind, settings=["dt=0.05"], number=1, out=folder) == 0
    assert not (folder / "pg").exists()
    other = tmp_path / "other"
    other.mkdir()
    (other / "precious.txt").write_text("mine")
    with pytest.raises(InputError, match="exists and is not what this writes"):
        laps(str(round_path), resolvers="pg", number=1, out=other)
    assert (other / "precious.txt").read_text() == "mine"


def test_laps_that_end_early_are_written_and_fail(tmp_path: Path, capsys: Printed) -> None:
    """An extended Jacobian whose constraint is the task's own row: singular at once."""
    path = tmp_path / "stuck.yaml"
    text = MINIMAL.replace("[1, 0.5]", ROUND).replace(
        "{kind: rg}", "{kind: ej, added_task: [{kind: position, frame: ee, axes: xy, reference: [1.2, 0.2]}]}"
    )
    path.write_text(text, encoding="utf-8")
    assert laps(str(path), resolvers="ej", number=2, out=tmp_path / "out") == 1
    printed = capsys.readouterr()
    assert "ended in lap 1" in printed.err
    assert "nmm laps: EJ ended" in printed.err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert not summary["complete"]
    assert not (tmp_path / "out" / "laps.png").exists()


def test_laps_that_end_in_the_middle_of_the_first_are_written(
    tmp_path: Path, capsys: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C a tenth of the way through two laps."""

    def ctrl_c(fraction: float) -> None:
        if fraction > 0.1:
            raise KeyboardInterrupt

    monkeypatch.setattr(nmm.cli.redundancy, "progress", lambda label: nullcontext(ctrl_c))
    out = tmp_path / "out"
    assert laps("unicycle_2r_position", resolvers="rg", number=2, out=out) == 1
    assert "RG ended in lap 1" in capsys.readouterr().err
    lines = (out / "laps.csv").read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[:2] for line in lines[1:]] == [["rg", "0"]]
    assert (out / "rg" / "trajectory.npz").exists()


def test_tasks_that_come_and_go_are_told_to_be_left_out(capsys: Printed) -> None:
    """Those are looked at that are active at the start, or where a condition on q holds."""
    redundancy("unicycle_3r_sequence")
    seen = capsys.readouterr()
    assert "this is about first, active there at t = 0 s, and not about second and turn" in seen.err
    assert "s = 3 rows of the task" in seen.out
    redundancy("unicycle_3r_sequence", at=["x=-3", "y=2.5"])
    seen = capsys.readouterr()
    assert "this is about first and turn, active there" in seen.err
    assert "base_footprint.heading" in seen.out
    redundancy("unicycle_3r_position")
    assert capsys.readouterr().err == ""
