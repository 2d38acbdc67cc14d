"""Every summary tells the versions and the machine, and nothing that names a person or a place."""

from __future__ import annotations

import getpass
import importlib.metadata
import json
import os
import platform
import socket
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from findings import refused

import nmm
from nmm.base.machine import made_with, versions
from nmm.cli.exit_status import status_of

KEYS = ["nmm", "python", "numpy", "pinocchio", "numba", "system", "processor", "cores"]
SHORT = ("--set", "duration=0.1")
CASE = "unicycle_2r_position"
COMMANDS = {
    "summary.json of a run": (("run", CASE, *SHORT), "summary.json"),
    "of a comparison": (("compare", CASE, *SHORT), "summary.json"),
    "of laps": (("laps", CASE, "--laps", "1", "--set", "dt=0.1", "--resolvers", "pg"), "summary.json"),
    "of a map": (("map", CASE, "--samples", "5"), "map.json"),
    "of a sweep": (("sweep", CASE, *SHORT, "--vary", "task.0.gain=1,2"), "sweep.json"),
}


@pytest.mark.parametrize("kind", COMMANDS)
def test_every_summary_tells_it(kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """That of `nmm paper` is in test_paper."""
    command, file = COMMANDS[kind]
    assert status_of([*command, "--out", str(tmp_path / "out")]) == 0, capfd.readouterr().err
    told = json.loads((tmp_path / "out" / file).read_text(encoding="utf-8"))
    assert told["made_with"] == made_with()
    assert all(one["made_with"] == made_with() for one in told.get("runs", {}).values())


def test_what_it_tells() -> None:
    told = made_with()
    assert list(told) == KEYS
    assert told["nmm"] == nmm.__version__
    assert told["python"] == platform.python_version()
    for name, package in (("numpy", "numpy"), ("pinocchio", "pin"), ("numba", "numba")):
        assert told[name] == importlib.metadata.version(package)
    assert told["cores"] == os.cpu_count()
    if sys.platform == "linux":
        assert str(told["processor"]) in Path("/proc/cpuinfo").read_text(encoding="utf-8")
    text = json.dumps(told)
    for private in (socket.gethostname(), getpass.getuser(), str(Path.home()), platform.release()):
        assert len(private) < 3 or private not in text
    told["nmm"] = "changed"
    assert made_with()["nmm"] == nmm.__version__


def test_a_library_that_pip_did_not_install_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(package: str) -> str:
        if package == "pin":
            raise importlib.metadata.PackageNotFoundError(package)
        return "1.2"

    monkeypatch.setattr("importlib.metadata.version", version)
    assert versions().endswith(", pin not known to pip, numpy 1.2, numba 1.2")


def test_a_run_keeps_what_made_it(tmp_path: Path) -> None:
    """Another machine that reads a run and writes it again is not the one that computed it."""
    run = nmm.Scenario.load(CASE, {"duration": 0.1}).run()
    elsewhere = {**made_with(), "processor": "another", "cores": 64}
    folder = replace(run, made_with=elsewhere).save(tmp_path / "a", figures=False)
    again = nmm.Trajectory.load(folder)
    assert again.made_with == again.summary()["made_with"] == elsewhere
    file = folder / "summary.json"
    summary = json.loads(file.read_text(encoding="utf-8"))
    summary["made_with"] = [1]
    file.write_text(json.dumps(summary), encoding="utf-8")
    with refused("summary.json: made_with", got=[1]):
        nmm.Trajectory.load(folder)
    del summary["made_with"]  # as folders before had it
    file.write_text(json.dumps(summary), encoding="utf-8")
    older = nmm.Trajectory.load(folder)
    assert older.made_with == older.summary()["made_with"] == {}
