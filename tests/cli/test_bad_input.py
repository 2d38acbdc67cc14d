"""Bad input: exit status 2, one line on standard error with the cause and its place, nothing written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nmm.cli.exit_status import status_of

SCENARIO = """\
robot: unicycle_2r
q0: {q1: 0.3}
duration: 1
task: {kind: position, frame: ee, axes: xy, reference: [1, 1]}
resolver: {kind: rg}
"""


def joint(name: str, kind: str, parent: str, child: str, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 0 1"/>{more}</joint>'
    )


def robot(links: str, *joints: str) -> str:
    return (
        '<robot name="r">'
        + "".join(f'<link name="{name}"/>' for name in links)
        + "".join(joints)
        + "</robot>"
    )


MESH = '<visual><geometry><mesh filename="nowhere.stl"/></geometry></visual>'
ROBOTS = {
    "malformed.urdf": '<robot name="r"><link name="a"></robot>',
    "empty.urdf": "",
    "foreign.urdf": "<html/>",
    "cyclic.urdf": robot("abc", joint("j1", "continuous", "b", "c"), joint("j2", "continuous", "c", "b")),
    "roots.urdf": robot("abc", joint("j1", "continuous", "a", "b")),
    "mesh.urdf": f'<robot name="r"><link name="a">{MESH}</link><link name="b"/>'
    + joint("j1", "continuous", "a", "b")
    + "</robot>",
    "limit.urdf": robot("ab", joint("j1", "revolute", "a", "b")),
    "slider.urdf": robot("ab", joint("j1", "prismatic", "a", "b")),
    "planar.urdf": robot("abc", joint("j1", "continuous", "a", "b"), joint("j2", "planar", "b", "c")),
    "floating.urdf": robot("abc", joint("j1", "continuous", "a", "b"), joint("j2", "floating", "b", "c")),
    "broken.xacro": '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    '<link name="${nobody}"/></robot>',
}

#: As many rows as inputs, and one more.
FIVE_ROWS = (
    "task=[{kind: position, frame: ee, axes: xy, reference: [1, 1]}, "
    "{kind: coordinates, of: [q1, q2, theta], reference: [0, 0, 0]}]"
)

#: Changes to the scenario above, by `--set`, and what the line has to say.
SETTINGS: list[tuple[str, list[str]]] = [
    # unknown robot, frame, joint, coordinate, input, kind
    ("robot=unicycle_2", ["robot", "unknown robot 'unicycle_2'", "available: car_base, "]),
    ("robot=nowhere.urdf", ["robot", "nowhere.urdf", "no such file"]),
    ("robot.platform=hover", ["robot.platform", "unknown platform 'hover'", "available: unicycle"]),
    ("robot.arguments.dd=1", ["robot.arguments.dd", "unknown", "'dd'", "wheel_radius"]),
    ("robot.arguments.l1=-1", ["robot.arguments.l1", "l1", "-1"]),
    ("robot.lock.q9=1", ["robot.lock.q9", "unknown", "'q9'", "available: q1, q2"]),
    ("robot.wheels=[q9]", ["robot.wheels", "unknown", "'q9'"]),
    ("task.frame=eee", ["task.frame", "unknown frame 'eee' (did you mean 'ee'?)", "more"]),
    ("task.frame=EE", ["task.frame", "unknown frame 'EE' (did you mean 'ee'?)"]),
    ("task.kind=posed", ["task.kind", "unknown kind 'posed' (did you mean 'pose'?)", "available: "]),
    ("task={kind: coordinates, of: q9, reference: 0}", ["task.of", "unknown coordinate 'q9'", "q1, q2"]),
    ("q0.q9=1", ["q0.q9", "unknown coordinate 'q9'", "available: x, y, theta, q1, q2"]),
    ("objective={kind: quadratic, terms: [{of: {q9: 1}}]}", ["objective.terms.0.of", "'q9'", "q1, q2"]),
    ("objective={kind: manipulability, frame: hand}", ["objective.frame", "unknown frame 'hand'", "ee"]),
    ("objective={kind: joint_range, joints: [q9]}", ["objective.joints", "unknown coordinate 'q9'"]),
    ("resolver.partitions=[[v, q9]]", ["resolver.partitions", "unknown input 'q9'", "v, omega, q1, q2"]),
    ("resolver={kind: pg, weights: {q9: 1}}", ["resolver.weights", "unknown input or group 'q9'"]),
    ("resolver.kind=sqp", ["resolver.kind", "unknown kind 'sqp'", "available: rg, pg, ej"]),
    ("method=rk5", ["method", "'rk5'", "did you mean 'rk4'", "zoh"]),
    # unknown key, missing key, unknown unit
    ("speed=1", ["speed", "unknown key 'speed'", "available: "]),
    ("resolver.alfa=1", ["resolver.alfa", "unknown key 'alfa' (did you mean 'alpha'?)", "threshold"]),
    ("resolver.added_task=1", ["resolver.added_task", "unknown key 'added_task', a key of ej", "threshold"]),
    ("task.reference={kind:circle, radius: 1}", ["unknown key 'kind:circle': a blank after the colon"]),
    ("resolver={kind: pg, alpha:1}", ["unknown key 'alpha:1': a blank after the colon, alpha: 1"]),
    ("task.reference={kind: circle, radius: 1}", ["task.reference.center", "missing"]),
    ("task.reference={radius: 1}", ["task.reference.kind", "missing", "circle, line"]),
    ("task.reference={kind: constant, value: [1, 1], unit: mile}", ["task.reference.unit", "'mile'", "rad"]),
    ("task.reference={kind: constant, value: [1, 1], unit: rad}", ["task.reference", "expected m", "rad"]),
    ("q0.theta=90 deg", ["q0.theta", "expected a number", "'90 deg'"]),
    # wrong lengths
    ("q0=[0, 0, 0]", ["q0", "expected 5 numbers", "x, y, theta, q1, q2"]),
    ("task.reference=[1, 2, 3]", ["task.reference", "expected 2 components", "got 3"]),
    ("task.gain=[1, 2, 3]", ["task.gain", "expected a number, 2 numbers or a 2 x 2 matrix"]),
    ("task.reference={kind: circle, center: [1], radius: 1, rate: 1}", ["reference.center", "2 or 3"]),
    ("task.reference={kind: line, start: [0, 0], end: [1], duration: 1}", ["reference.end", "2 numbers"]),
    ("task.reference={kind: spline, times: [0, 1], points: [[1, 1]]}", ["task.reference", "as times, 2"]),
    ("resolver.partitions=[[v]]", ["resolver.partitions", "expected 2 different inputs"]),
    ("resolver={kind: pg, weights: [1, 2]}", ["resolver.weights", "expected 4 numbers"]),
    (
        "task={kind: heading, frame: ee, reference: {kind: bearing, of: [1, 2], towards: [1]}}",
        ["task.reference.towards", "2 or 3 numbers"],
    ),
    ("resolver.kind=ej", ["resolver.added_task", "expected 2 rows"]),
    # NaN, infinite and other numbers
    ("q0.x=nan", ["q0.x", "expected a finite number", "'nan'"]),
    ("q0=[0, 0, 0, 0, .inf]", ["q0", "expected a finite number", "'.inf'"]),
    ("duration=1e999", ["duration", "expected a finite number", "'1e999'"]),
    ("resolver.alpha=-inf", ["resolver.alpha", "expected a finite number"]),
    ("task.reference=[nan, 0]", ["task.reference", "expected a finite number"]),
    ("task.gain=1/0", ["task.gain", "division by zero"]),
    ("duration=true", ["duration", "expected a number", "true"]),
    ("duration=two", ["duration", "expected a number", "unknown name 'two'"]),
    ("dt=0", ["dt", "expected a number above 0", "'0'"]),
    ("dt=-1e-3", ["dt", "expected a number above 0"]),
    ("duration=0", ["duration", "expected a number above 0"]),
    ("dt=1e-12", ["dt", "1e-12", "samples"]),
    ("resolver.alpha=0", ["resolver.alpha", "expected a number above 0"]),
    ("resolver.threshold=2", ["resolver.threshold", "expected below 1"]),
    ("task.gain=-1", ["task.gain", "positive definite"]),
    ("task.reference={kind: circle, center: [0, 0], radius: 0, rate: 1}", ["reference.radius", "above 0"]),
    ("task.reference={kind: spline, times: [1, 0], points: [[1, 1], [2, 2]]}", ["times", "increase"]),
    # too many rows, nothing, wrong shapes
    (FIVE_ROWS, ["task", "expected at most 4 rows", "v, omega, q1, q2", "got 5"]),
    ("task=[]", ["task", "expected at least 1"]),
    ("task=go there", ["task", "expected a mapping"]),
    ("resolver=rg", ["resolver", "expected a mapping", "'rg'"]),
    ("name=../elsewhere", ["name", "letters"]),
    # --set itself
    ("dt", ["--set", "KEY=VALUE", "'dt'"]),
    ("=1", ["--set", "KEY=VALUE"]),
    ("dt.x.y=1", ["dt"]),
    ("task={kind: position", ["task", "not valid YAML"]),
    ("task=!!python/name:os.system", ["task", "tag"]),
]  # fmt: skip

#: Files in place of the scenario.
FILES: list[tuple[str, list[str]]] = [
    ("", ["expected a mapping"]),
    ("[1, 2]", ["expected a mapping"]),
    ("words", ["expected a mapping", "'words'"]),
    ("robot: !!python/object/apply:os.system ['touch hacked']", ["given.yaml:1", "tag"]),
    ("robot: [", ["given.yaml:1", "not valid YAML"]),
    (" x: 1\n" + SCENARIO, ["given.yaml:2", "'robot' begins in column 1, 'x' above it in column 2"]),
    (SCENARIO + "a:\n  - b: 1\n    c: 2\n   d: 3\n", ["given.yaml:9", "'d' begins in column 4", "'c'", "5"]),
    (SCENARIO + "  a: 1\n", ["given.yaml:6", "'a' begins in column 3", "in column 1"]),
    (SCENARIO + "a\n  b: 1\n", ["given.yaml:7", "no colon behind 'a' in line 6"]),
    ("a\n  b: 1\n", ["given.yaml:2", "no colon behind 'a' in a line before"]),
    (SCENARIO + "a:\n\tb: 1\n", ["given.yaml:7", "a tab: indent with spaces"]),
    (SCENARIO + "title: a: b\n", ["given.yaml:6", "a second colon in one line"]),
    (SCENARIO + "title: @b\n", ["given.yaml:6", "text that begins with @ needs quotes"]),
    (SCENARIO + "title: 'b\n", ["the quote of line 6 is not closed"]),
    (SCENARIO + "a: {b: 1\nc: 2\n", ["given.yaml:7", "a comma or } is missing behind what line 6 opens"]),
    (SCENARIO + "duration: 2\n", ["given.yaml:6", "duration", "once"]),
    (SCENARIO.replace("duration: 1\n", ""), ["duration", "missing"]),
    (SCENARIO.replace("duration", "duraton"), ["given.yaml:3", "duraton", "did you mean 'duration'"]),
    (SCENARIO.replace("frame: ee", "frame: hand"), ["given.yaml:4", "task.frame", "unknown frame 'hand'"]),
    (SCENARIO + SCENARIO.replace("robot", "---\nrobot"), ["given.yaml:6", "one YAML document"]),
]  # fmt: skip

#: Robots in place of the scenario's, as `robot=FILE`, and for `nmm info FILE`.
ROBOT_CAUSES: list[tuple[str, list[str]]] = [
    ("malformed.urdf", ["mismatched tag"]),
    ("empty.urdf", ["empty"]),
    ("foreign.urdf", ["<html>"]),
    ("cyclic.urdf", ["cycle", "b", "c"]),
    ("roots.urdf", ["one root", "a", "c"]),
    ("mesh.urdf", ["nowhere.stl", "no such file"]),
    ("limit.urdf", ["'j1'", "<limit>"]),
    ("slider.urdf", ["'j1'", "<limit>"]),
    ("planar.urdf", ["'j2'", "planar"]),
    ("floating.urdf", ["'j2'", "floating"]),
    ("broken.xacro", ["nobody"]),
]

#: Other command lines.
COMMANDS: list[tuple[list[str], list[str]]] = [
    (["run", "unicycle_2r_positon"], ["unknown scenario", "did you mean 'unicycle_2r_position'"]),
    (["run", "nowhere.yaml"], ["nowhere.yaml", "No such file"]),
    (["run", "."], ["unknown scenario '.'"]),
    (["run", "given.yaml", "--resolver", "sqp"], ["resolver.kind", "unknown kind 'sqp'", "rg, pg, ej, dls"]),
    (["run", "given.yaml", "--out", "theirs"], ["theirs", "not what this writes"]),
    (["run", "given.yaml", "--out", "given.yaml"], ["given.yaml", "not what this writes"]),
    (["run", "given.yaml", "--out", "given.yaml/below"], ["given.yaml/below", "cannot be written"]),
    (["compare", "nowhere"], ["unknown scenario 'nowhere'"]),
    (["compare", "given.yaml", "--resolvers", "rg,sqp"], ["unknown kind 'sqp'", "rg, pg, ej"]),
    (["compare", "given.yaml", "--resolvers", "rg,ej"], ["resolver.added_task", "expected 2 rows"]),
    (["compare", "given.yaml", "--resolvers", ","], ["--resolvers", "rg,pg"]),
    (["compare", "given.yaml", "--resolvers", "rg,pg,rg"], ["--resolvers", "rg is given twice"]),
    (["run", "given.yaml", "--port", "7001"], ["--port", "only with --play"]),
    (["run", "given.yaml", "--no-open"], ["--no-open", "only with --play"]),
    (["compare", "given.yaml", "--out", "theirs"], ["theirs", "not what this writes"]),
    (["paper", "--out", "theirs"], ["theirs", "not what this writes"]),
    (["play", "theirs"], ["theirs", "expected a run's folder"]),
    (["play", "nowhere"], ["nowhere", "expected a run's folder"]),
    (["play", "theirs", "--port", "many"], ["--port", "integer"]),
    (["info", "nobody"], ["unknown robot 'nobody'", "available: car_base"]),
    (["info", "nowhere.urdf"], ["nowhere.urdf", "no such file"]),
    (["info", "unicycle_2r", "--platform", "hover"], ["unknown platform 'hover'", "available: unicycle"]),
    (["info", "unicycle_2r", "--scenario", "nowhere"], ["unknown scenario 'nowhere'"]),
    # wrong usage
    (["run"], ["SCENARIO", "nmm run --help"]),
    (["run", "given.yaml", "--speed", "3"], ["--speed"]),
    (["run", "given.yaml", "again.yaml"], ["again.yaml"]),
    (["run", "given.yaml", "--out"], ["--out"]),
    (["runn"], ["runn", "did you mean 'run'"]),
    (["--speed"], ["--speed"]),
]  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder: a good scenario, bad robots, and somebody's folder."""
    (tmp_path / "given.yaml").write_text(SCENARIO, encoding="utf-8")
    for name, text in ROBOTS.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis.tex").write_text("years of work", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(
    arguments: list[str], expected: list[str], folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The command line is refused, for the reason expected, and leaves everything as it was."""
    before, names = contents(folder), sorted(path.name for path in folder.iterdir())
    status = status_of(arguments)
    out, err = capfd.readouterr()  # of the file descriptors: what C++ libraries print counts too
    assert status == 2, err
    assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1, err
    assert err.startswith("nmm")
    assert "\x1b" not in err
    for text in expected:
        assert text.lower() in err.lower(), f"{text!r} is not in {err!r}"
    assert contents(folder) == before
    assert sorted(path.name for path in folder.iterdir()) == names


@pytest.mark.parametrize(("setting", "expected"), SETTINGS, ids=[setting for setting, _ in SETTINGS])
def test_settings(setting: str, expected: list[str], folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    place = [] if "--set" in expected else ["given.yaml"]
    refused(["run", "given.yaml", "--set", setting], place + expected, folder, capfd)


@pytest.mark.parametrize(("text", "expected"), FILES)
def test_files(text: str, expected: list[str], folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (folder / "given.yaml").write_text(text, encoding="utf-8")
    refused(["run", "given.yaml"], ["given.yaml", *expected], folder, capfd)


@pytest.mark.parametrize(("name", "expected"), ROBOT_CAUSES, ids=[name for name, _ in ROBOT_CAUSES])
def test_robots(name: str, expected: list[str], folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    refused(
        ["run", "given.yaml", "--set", f"robot={name}"],
        ["given.yaml", "robot", name, *expected],
        folder,
        capfd,
    )
    if name != "mesh.urdf":  # `info` lists what is missing
        refused(["info", name], [name, *expected], folder, capfd)


@pytest.mark.parametrize(("arguments", "expected"), COMMANDS, ids=[" ".join(line) for line, _ in COMMANDS])
def test_commands(
    arguments: list[str], expected: list[str], folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    refused(arguments, expected, folder, capfd)


def test_a_folder_without_permission(
    folder: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system's answer is replaced: tests may run as root, who may write everywhere."""
    monkeypatch.setattr("os.access", lambda path, mode: not str(path).endswith("theirs"))
    refused(["run", "given.yaml", "--out", "theirs/run"], ["theirs", "cannot be written"], folder, capfd)


@pytest.mark.parametrize(
    "arguments",
    [["run", "given.yaml", "--set", "dt=0"], ["run", "given.yaml", "--set", "robot=cyclic.urdf"], ["run"]],
)
def test_a_process_says_the_same(arguments: list[str], folder: Path) -> None:
    """Nothing is added between `status_of` and the shell."""
    done = subprocess.run(
        [sys.executable, "-m", "nmm", *arguments], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert not (folder / "runs").exists()
