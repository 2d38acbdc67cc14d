"""The command line: help, listings, pipes and terminals."""

from __future__ import annotations

import platform
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path

import pytest
from command_line import Result, Terminal, imported, process
from ports import MOST

import nmm
from nmm.analysis.maps.measures import MEASURES
from nmm.base import kinds
from nmm.base.bundled import bundled_robots, bundled_scenarios
from nmm.cli.exit_status import status_of

Command = Callable[..., Result]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run a command line in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: Result(status_of(arguments), *capfd.readouterr())


# Help


@pytest.mark.parametrize("arguments", [["--help"], ["-h"], []])
def test_help_names_every_command_and_teaches(run: Command, arguments: Sequence[str]) -> None:
    result = run(*arguments)
    assert result.status == 0
    for word in (
        "run",
        "compare",
        "paper",
        "play",
        "info",
        "check",
        "view",
        "scenarios",
        "robots",
        "--version",
        "Exit status",
    ):
        assert word in result.out


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (
            "run",
            ["--resolver", "--set", "--out", "--html", "--play", "trajectory.npz", "scenario.yaml", "Ctrl-C"],
        ),
        ("compare", ["--resolvers", "--set", "--out", "comparison.png", "playback.html"]),
        ("paper", ["--out", "index.html"]),
        ("play", ["RUN_DIR", "--port", "--no-open"]),
        ("info", ["ROBOT", "--platform", "--scenario"]),
        ("scenarios", ["--keys"]),
        ("robots", []),
    ],
)
def test_help_of_a_command(run: Command, command: str, words: Sequence[str]) -> None:
    result = run(command, "--help")
    assert result.status == 0
    for word in words:
        assert word in result.out
    assert "\x1b" not in result.out


@pytest.mark.parametrize(
    ("command", "names"),
    [
        ("run", kinds.RESOLVERS),
        ("compare", kinds.RESOLVERS),
        ("laps", kinds.RESOLVERS),
        ("info", kinds.PLATFORMS),
        ("redundancy", kinds.TASKS),
        ("map", MEASURES),
    ],
)
def test_help_lists_what_there_is(run: Command, command: str, names: Sequence[str]) -> None:
    text = " ".join(run(command, "--help").out.split())
    assert [name for name in names if not re.search(rf"\b{name}\b", text)] == []


def test_version(run: Command) -> None:
    first, second = run("--version").out.splitlines()
    assert first == f"nmm {nmm.__version__}"
    assert second.split(", ") == [
        f"Python {platform.python_version()}",
        *(f"{package} {metadata.version(package)}" for package in ("pin", "numpy", "numba")),
    ]


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["run", "--help"], ["scenarios"], ["robots"]]
)
def test_light_commands_import_nothing_heavy(tmp_path: Path, arguments: Sequence[str]) -> None:
    assert not imported(tmp_path, *arguments) & {"pinocchio", "numba", "matplotlib", "scipy", "meshcat"}


# Listings


def test_scenarios_lists_them_all(run: Command) -> None:
    result = run("scenarios")
    assert result.status == 0
    lines = result.out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == sorted(bundled_scenarios())
    assert all(line == line.rstrip() for line in lines)
    assert "paper, section VI, case 3" in result.out


def test_scenarios_lists_the_keys(run: Command) -> None:
    result = run("scenarios", "--keys")
    assert result.status == 0
    for word in ("duration", "reference, kind: spline", "towards", "partitions", "planning mode"):
        assert word in result.out


def test_robots_lists_them_with_their_arguments(run: Command) -> None:
    result = run("robots")
    assert result.status == 0
    assert [line.split()[0] for line in result.out.splitlines()[1:]] == sorted(bundled_robots())
    assert "planar 2R" in result.value("unicycle_2r")
    assert "d=0.3, h=0.3, l1=0.5, l2=0.3" in result.value("unicycle_2r")
    assert "l3=0.4" in result.value("unicycle_3r")


def test_info_describes_a_robot(run: Command) -> None:
    result = run("info", "unicycle_3r")
    assert result.status == 0
    assert result.value("theta").split()[:2] == ["rad", "platform"]
    assert result.value("v ").split()[0] == "m/s"
    assert "ee" in re.split(r"[,\s]+", result.value("frames:"))
    assert "left_wheel_joint" in result.out
    # n = 6 coordinates, 5 inputs.
    assert result.value("position in the plane").split() == ["2", "4", "3"]
    assert result.value("position in space").split() == ["3", "3", "2"]
    assert result.value("pose in space").split() == ["6", "0", "-"]


def test_info_counts_for_a_scenario_and_takes_a_path(run: Command, tmp_path: Path) -> None:
    result = run("info", str(bundled_robots()["unicycle_2r"]), "--scenario", "unicycle_2r_pointing")
    assert result.status == 0
    assert result.value("unicycle_2r_pointing").split() == ["3", "2", "1"]
    assert run("info", "unicycle_2r", "--platform", "unicycle").status == 0


# Pipes and terminals


def test_a_closed_pipe_is_no_error_to_read_about(tmp_path: Path) -> None:
    command = f"{sys.executable} -m nmm scenarios --keys | head -1"
    done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("the file")
    assert done.stderr == ""


def test_a_pipe_that_knows_no_greek_is_written_to(tmp_path: Path) -> None:
    listing = process(tmp_path, "scenarios", "--keys", PYTHONIOENCODING="ascii")
    out, err = listing.communicate(timeout=MOST)
    assert (listing.returncode, err) == (0, "")
    assert "duration" in out


def test_tables_fold_on_a_narrow_terminal(tmp_path: Path) -> None:
    shown = re.sub(r"\x1b\[[\d;]*m", "", Terminal(tmp_path, 50, "robots").read_until(None))
    assert max(len(line.rstrip()) for line in shown.splitlines()) <= 50
    assert "…" not in shown
    assert "wheel_radius" in re.sub(r"\s", "", shown)


def test_there_is_a_progress_bar_on_a_terminal_only(tmp_path: Path) -> None:
    shown = Terminal(tmp_path, 100, "run", "unicycle_2r_position", "--set", "duration=2").read_until(None)
    assert "━" in shown
    assert "unicycle_2r_position, RG" in shown
    assert "completed, 2 s" in shown
