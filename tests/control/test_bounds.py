"""Work has bounds: what would take for ever, or more memory than there is, is refused by name."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from findings import refused

import nmm
from nmm.analysis.null_space.moving import self_motion
from nmm.base import machine
from nmm.base.errors import RunError
from nmm.cli.exit_status import status_of
from nmm.control import integrators
from nmm.control.integrators import Adaptive

ROBOT = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{}<link name="base_link"/></robot>'


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_adaptive_steps_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A motion that comes to rest within 0.1 µs takes six million steps to follow for a second."""
    monkeypatch.setattr(integrators, "MOST_STEPS", 500)
    q = np.array([1.0])
    with pytest.raises(
        RunError, match=r"500 adaptive steps did not lead from t = 2 s to the next sample at 3 s"
    ):
        Adaptive(1e-9).advance(lambda t, q: -1e7 * (q - np.cos(t)), 2.0, q, q, q, 1.0)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (
            {"duration": 1e6},
            r"duration: 1e\+06 s in steps of 0\.01 s are 1e\+08 samples; expected at most 100000",
        ),
        ({"speed": 1e308}, r"speed: a way of inf m and rad .* takes inf steps; expected at most 1000000"),
        (
            {"speed": 1e5},
            r"speed: a way of 2\.55e\+05 m and rad .* takes 8e\+07 steps; expected at most 1000000",
        ),
        ({"dt": 1e-300}, r"duration: 4 s in steps of 1e-300 s are 4e\+300 samples"),
    ],
)
def test_a_self_motion_has_so_many_samples(robot_2r: nmm.Robot, asked: dict[str, float], words: str) -> None:
    subject = robot_2r, nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.0])
    with pytest.raises(nmm.InputError, match=words):
        self_motion(subject, {"q2": 1.0}, **asked)  # type: ignore[arg-type]  # numbers by keyword


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        (
            "a.xacro",
            ROBOT.format('<xacro:include filename="/dev/zero"/>'),
            "a.xacro: in /dev/zero: cannot be read (expected a file, this is a device or a pipe)",
        ),
        ("a.xacro", "<a>" * 100_000, "a.xacro: line 1: elements stand more than 200 deep in one another"),
        ("a.urdf", ROBOT.format("<a>" * 100_000), "a.urdf: line 1: elements stand more than 200 deep"),
        (
            "a.yaml",
            "robot: " + "[" * 3000,
            "a.yaml:1: not valid YAML: nested too deeply, beyond 100",
        ),
        ("a.yaml", "robot: " + "{a: " * 3000, "a.yaml:1: not valid YAML: nested too deeply"),
        ("a.yaml", "- " * 3000, "a.yaml:1: not valid YAML: nested too deeply"),
    ],
    ids=["include without end", "deep xacro", "deep URDF", "deep lists", "deep mappings", "deep items"],
)
def test_files_without_end_or_bottom(
    tmp_path: Path, name: str, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, name, text)
    command = {".yaml": ["run"], ".urdf": ["info"], ".xacro": ["info", "--trust"]}[file.suffix]
    assert status_of([*command, str(file)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert f"{tmp_path}/{words}" in err


@pytest.mark.parametrize("kind", ["device", "pipe", "long"])
@pytest.mark.parametrize("suffix", [".yaml", ".urdf", ".xacro"])
def test_files_that_are_none(
    tmp_path: Path,
    kind: str,
    suffix: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / f"a{suffix}"
    if kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "pipe":
        subprocess.run(["mkfifo", str(file)], check=True)
    else:
        monkeypatch.setattr("nmm.scenario.document.LONGEST", 1000)
        monkeypatch.setattr("nmm.model.robots.loading.xml_tree.LONGEST", 1000)
        file.write_text(" " * 1001)
    assert status_of(["run" if suffix == ".yaml" else "info", str(file)]) == 2
    err = capsys.readouterr().err
    assert str(file) in err
    assert (
        "longer than 0.001 MB" if kind == "long" else "expected a file, this is a device or a pipe"
    ) in err


def test_values_are_counted_as_they_are_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("nmm.scenario.yaml_text.MOST_NODES", 1000)
    file = written(tmp_path, "a.yaml", f"robot: [{'1, ' * 2000}1]")
    with refused("a.yaml:1", kind=nmm.ScenarioError):
        nmm.Scenario.load(file)


def test_memory_is_asked_for_before_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 1.0})
    monkeypatch.setattr(machine, "free_memory", lambda: 200_000.0)
    with refused("unicycle_2r_position.yaml") as caught:
        scenario.run()
    assert re.search(r"201 samples .* 0\.000\d+ GB", caught.value.what)
    assert scenario.override("dt", 0.1).run().complete is not None


def test_free_memory_is_what_the_system_says() -> None:
    said = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
    assert machine.free_memory() == pytest.approx(1024 * float(said["MemAvailable"].split()[0]), rel=0.5)


@pytest.mark.parametrize("given", ["0:1e20", "-1e7:0"])
def test_a_range_where_digits_are_lost(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["map", "unicycle_2r", "--task", "position", f"--range=q1={given}"]
    assert status_of(command) == 2
    assert "nmm map: range of q1: expected no more than 1e+06 to either side" in capsys.readouterr().err


def test_a_long_table_is_written_in_parts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run()
    whole = (run.save(tmp_path / "whole", figures=False) / "trajectory.csv").read_text()
    monkeypatch.setattr("nmm.views.folders.run.ROWS", 7)
    assert (run.save(tmp_path / "parts", figures=False) / "trajectory.csv").read_text() == whole


def check(make: Callable[[], object], words: str) -> None:
    with pytest.raises(nmm.NmmError, match=words):
        make()


def test_numbers_are_not_flags_and_flags_no_numbers() -> None:
    check(lambda: nmm.Collisions(True), "collisions: distance: expected a number, got True")
    task = nmm.Position("ee")
    check(
        lambda: nmm.Task(task, [0, 0, 0], priority=True),
        "priority: expected a whole number above 0, got True",
    )
    check(
        lambda: nmm.Task(task, [0, 0, 0], priority=2.5), "priority: expected a whole number above 0, got 2.5"
    )
    check(
        lambda: nmm.Task(task, [0, 0, 0], priority=float("nan")), "priority: expected a whole number above 0"
    )
    priority = nmm.Task(task, [0, 0, 0], priority=2.0).priority
    assert (priority, type(priority)) == (2, int), "as in a scenario"


def test_a_motion_that_raises_is_named() -> None:
    def motion(t: float) -> list[float]:
        return [1.0 / (t - 0.5), 0.0, 3.0]

    check(
        lambda: nmm.Obstacle(nmm.Sphere(0.2), motion=lambda t: 1 / 0, name="cart"),
        r"obstacle cart: motion\(0\) raised ZeroDivisionError: division by zero",
    )
    cart = nmm.Obstacle(nmm.Sphere(0.2), motion=motion, name="cart")
    check(lambda: cart.placement(0.5), r"obstacle cart: motion\(0\.5\) raised ZeroDivisionError")


def test_a_description_is_no_srdf(tmp_path: Path, robot_3r: nmm.Robot) -> None:
    task = nmm.Task(nmm.Position("ee"), [1.0, 0.0, 0.5])

    def controller(file: Path) -> nmm.Controller:
        return nmm.Controller(robot_3r, task, nmm.ProjectedGradient(), collisions=nmm.Collisions(srdf=file))

    check(
        lambda: controller(written(tmp_path, "a.urdf", ROBOT.format(""))),
        r"srdf: .*a\.urdf: expected an SRDF .* this is a URDF",
    )
    check(lambda: controller(written(tmp_path, "a.xml", "<html/>")), r"expected an SRDF .* this is <html>")
    check(lambda: controller(Path("/dev/zero")), r"srdf: /dev/zero.*a device or a pipe")
    check(lambda: controller(tmp_path / "none"), r"srdf: there is no file")
