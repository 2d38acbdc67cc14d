"""A plugin of one's own, installed as users do: docs/own_plugin, and others that fail."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from places import ROOT

SOURCE = ROOT / "docs" / "own_plugin"

SCENARIO = """
robot: unicycle_2r
q0: {q1: 0.4, q2: 0.8}
duration: 6
dt: 0.02
task: {kind: position, frame: ee, axes: xy, reference: [0, 0]}
resolver: {kind: least_norm}
patrol: {places: [[1.5, 0.5], [2, 1/2]]}
"""

#: What its finding says.
UNFINISHED = "at t = 6 s the patrol ends, after 1 of 2 places: it takes 8 s"

PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "NAME"
version = "1.0"
[project.entry-points."nmm.plugins"]
NAME = "NAME:PLUGIN"
"""

#: Plugins that fail, by their modules, and how the line about each begins.
FAULTS = {
    "broken": ("raise OSError('no such\\nsensor')", "plugin broken: OSError: no such sensor"),
    "nonsense": (
        "PLUGIN = 3",
        "plugin nonsense: InputError: nonsense:PLUGIN: expected an nmm.extending.Plugin",
    ),
    "misspelled": (
        "from nmm.extending import Plugin\nPLUGIN = Plugin('misspelled', kinds={'resolvr': {}})",
        "plugin misspelled: InputError: kinds: unknown kind 'resolvr' (did you mean 'resolver'?)",
    ),
    "thief": (
        "from nmm.extending import Plugin\n"
        "PLUGIN = Plugin('thief', kinds={'resolver': {'pg': 'thief:A'}}, commands={'run': 'thief:A'},\n"
        "    sections={'plan': 'thief:A'}, findings=('thief:WORDS',), front={'load': 'thief:A'})\n"
        "WORDS = {'singular': 'stolen'}\n",
        "plugin thief: command run is nmm's already; this one is left out",
    ),
    "hollow": (
        "from nmm.extending import Plugin\n"
        "PLUGIN = Plugin('hollow', kinds={'resolver': {'hollow': 'hollow:Nothing'}},\n"
        "                commands={'hollow': 'hollow:command', 'odd': 'hollow:odd'},\n"
        "                sections={'hollow': 'hollow:PLUGIN'}, front={'hollow_name': 'hollow:Nothing'})\n"
        "def odd(x: complex): ...\n",
        "plugin hollow: AttributeError: module 'hollow' has no attribute 'command'; hollow:command is left",
    ),
}


#: A plugin with what docs/own_plugin does without.
DOORS = """
from dataclasses import dataclass
from typing import ClassVar
import typer
from nmm.extending import OptionGroup, Plugin

PLUGIN = Plugin(
    "doors",
    options={"singularities.search": "doors:Loud", "compare": "doors:Taken"},
    folders={"map": "doors:recognised", "survey": "doors:recognised"},
    front={"twice": "doors:twice"},
)

@dataclass
class Loud(OptionGroup):
    answers: ClassVar[tuple[str, ...]] = ("--loud",)
    loud: bool = typer.Option(False, "--loud", help="Say it loudly.")

    def asked(self):
        return "--loud" if self.loud else ""

    def answer(self, studied, length):
        print("SINGULAR?", studied.robot.name)
        return 0

@dataclass
class Taken(OptionGroup):
    out: bool = typer.Option(False, "--out")

def recognised(folder):
    return (folder / "survey.txt").exists()

def twice(x):
    return 2 * x
"""


#: Command lines, a list of arguments each, in one process: their exit statuses and what they print, as JSON.
SEVERAL = """
import contextlib, io, json, sys
from nmm.cli.exit_status import status_of
ended = []
for arguments in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        status = status_of(arguments)
    ended.append([status, out.getvalue(), err.getvalue()])
print(json.dumps(ended))
"""


def install(folder: Path, *sources: Path) -> None:
    """As users install packages, into a folder; what builds them is fetched where it is not installed."""
    options = ["--no-build-isolation"] if find_spec("hatchling") else []
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", *options, "--target", str(folder)]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run([*command, *map(str, sources)], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr


class Installed:
    """nmm with the plugins of a folder."""

    def __init__(self, folder: Path, at: Path) -> None:
        self.folder, self.at = folder, at

    def python(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"PYTHONPATH": f"{self.folder}{os.pathsep}{ROOT}", "COLUMNS": "200"}
        command = [sys.executable, *arguments]
        return subprocess.run(command, capture_output=True, text=True, cwd=self.at, env=environment)

    def nmm(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return self.python("-m", "nmm", *arguments)

    def each(self, *lines: str) -> list[subprocess.CompletedProcess[str]]:
        """Command lines one after the other, in one process, which says once what is wrong with a plugin."""
        done = self.python("-c", SEVERAL, json.dumps([shlex.split(line) for line in lines]))
        assert done.returncode == 0, done.stderr
        first, *others = (subprocess.CompletedProcess("", *ended) for ended in json.loads(done.stdout))
        first.stderr = done.stderr + first.stderr  # with what was said before it
        return [first, *others]


@pytest.fixture(scope="module")
def patrol(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    folder, at = tmp_path_factory.mktemp("installed"), tmp_path_factory.mktemp("work")
    install(folder, SOURCE)
    (at / "rounds.yaml").write_text(SCENARIO, encoding="utf-8")
    return Installed(folder, at)


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    folder, at = tmp_path_factory.mktemp("faulty"), tmp_path_factory.mktemp("work")
    sources = []
    for name, text in {"doors": DOORS, **{name: text for name, (text, _) in FAULTS.items()}}.items():
        sources.append(source := tmp_path_factory.mktemp(name))
        (source / "pyproject.toml").write_text(PROJECT.replace("NAME", name), encoding="utf-8")
        (source / f"{name}.py").write_text(text, encoding="utf-8")
    install(folder, *sources)
    return Installed(folder, at)


def test_commands_and_resolvers_are_in_the_help(patrol: Installed) -> None:
    done, on_run, patrolled = patrol.each("--help", "run --help", "patrol rounds.yaml")
    commands = [
        line.split()[0] for line in done.stdout.partition("Commands:")[2].splitlines() if line.strip()
    ]
    assert commands[:4] == ["run", "patrol", "compare", "plan"]
    assert "Say when a patrol is where." in done.stdout
    assert done.stderr == ""
    assert "dls|least_norm" in on_run.stdout
    assert patrolled.stdout == "4 s  [1.5, 0.5]\n8 s  [2.0, 0.5]\n"


def test_its_key_is_in_the_reference(patrol: Installed) -> None:
    text = patrol.nmm("scenarios", "--keys").stdout
    keys = text.partition("the file (")[2].partition("\n\n")[0]
    assert keys.index("objective ") < keys.index("patrol ") < keys.index("resolver ")
    assert "patrol (The end of the arm goes from place to place, in place of the file's tasks)" in text
    assert "resolver, kind: least_norm (Least norm. u = J⁺ rate" in text


def test_names_that_are_unknown_are_told_with_those_of_the_plugin(patrol: Installed) -> None:
    resolver, section, key, frame = patrol.each(
        "run rounds.yaml --resolver least_nrm",
        "run unicycle_2r_position --set patroll=true",
        "run rounds.yaml --set patrol.second=2",
        "run rounds.yaml --set patrol.frame=hand",
    )
    assert resolver.returncode == section.returncode == 2
    assert "(did you mean 'least_norm'?)" in resolver.stderr
    assert "unknown key 'patroll' (did you mean 'patrol'?)" in section.stderr
    assert "rounds.yaml: set patrol.second: unknown key 'second' (did you mean 'seconds'?)" in key.stderr
    assert (frame.returncode, frame.stderr.count("\n")) == (2, 1)
    assert "rounds.yaml: set patrol.frame: robot unicycle_2r: unknown frame 'hand'" in frame.stderr


def test_its_scenario_runs_and_its_finding_is_told_and_kept(patrol: Installed) -> None:
    done, again, asked = patrol.each(
        "run rounds.yaml --out run",
        "run run/scenario.yaml --set duration=8 --out again",
        "info --scenario rounds.yaml",
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == f"warning: LEAST_NORM: {UNFINISHED}\n"
    summary = json.loads((patrol.at / "run" / "summary.json").read_text("utf-8"))
    assert [finding["code"] for finding in summary["findings"]] == ["patrol_unfinished"]
    assert (again.returncode, again.stderr) == (0, "")
    assert asked.returncode == 0
    # Without the plugin the scenario says what is missing, and the finding keeps its sentence.
    elsewhere = Installed(patrol.at, patrol.at)
    done = elsewhere.nmm("run", "run/scenario.yaml")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "unknown" in done.stderr
    (patrol.at / "run" / "scenario.yaml").unlink()
    code = "import nmm; print(nmm.Trajectory.load('run', nmm.load('unicycle_2r')).warnings[0])"
    assert elsewhere.python("-c", code).stdout == f"{UNFINISHED}\n"


def test_a_scenario_without_its_key_says_nothing_of_it(patrol: Installed) -> None:
    code = "import nmm; print(*nmm.Scenario.load('unicycle_2r_position').resolved())"
    keys = patrol.python("-c", code).stdout.split()
    assert "plan" in keys
    assert "patrol" not in keys


def test_strangers_are_not_read_before_they_are_needed(patrol: Installed) -> None:
    code = (
        "import sys, nmm; nmm.load('unicycle_2r'); nmm.ProjectedGradient();"
        "assert 'nmm_patrol' not in sys.modules;"
        "print('least_norm' in nmm.base.kinds.RESOLVERS, 'nmm_patrol.patrol' in sys.modules)"
    )
    assert patrol.python("-c", code).stdout == "True False\n"


def test_plugins_that_fail_are_a_line_each_and_all_else_works(faulty: Installed) -> None:
    done = faulty.nmm("robots")
    assert done.returncode == 0
    assert "unicycle_2r" in done.stdout
    lines = done.stderr.splitlines()
    for _, start in FAULTS.values():
        (line,) = (line for line in lines if line.startswith(start))
        assert len(line) <= 300
    assert all(line.startswith("plugin ") for line in lines)
    assert len({*lines}) == len(lines)


def test_what_of_a_plugin_fails_is_left_out(faulty: Installed) -> None:
    done = faulty.nmm("run", "unicycle_2r_position", "--set", "duration=0.1", "--out", "run")
    assert done.returncode == 0, done.stderr
    assert not [line for line in done.stderr.splitlines() if not line.startswith("plugin ")]
    keys, resolver, section = faulty.each(
        "scenarios --keys",
        "run unicycle_2r_position --resolver hollow",
        "run unicycle_2r_position --set hollow=true",
    )
    told = keys.stderr + resolver.stderr + section.stderr
    for said in ("resolver pg is nmm's already", "section plan is plugin planning's already"):
        assert f"plugin thief: {said}; this one is left out" in told
    assert "unknown kind 'hollow'" in resolver.stderr
    assert section.returncode == 2
    assert "hollow:PLUGIN is no nmm.extending.Section; it is left out" in told
    code = "import nmm; print(nmm.load.__module__, str(nmm.Finding('interrupted_judging'))); nmm.hollow_name"
    done = faulty.python("-c", code)
    assert done.stdout == "nmm.model.robots.loading.load interrupted while the run was judged\n"
    assert "AttributeError: nmm has no hollow_name" in done.stderr


def test_options_folders_and_names_of_nmm_are_added(faulty: Installed) -> None:
    """An option that a command has already is refused with its group."""
    (faulty.at / "there").mkdir()
    (faulty.at / "there" / "survey.txt").touch()
    done, both, play = faulty.each(
        "singularities unicycle_2r --task position --loud",
        "singularities unicycle_2r --task position --loud --json",
        "play there",
    )
    assert (done.returncode, done.stdout) == (0, "SINGULAR? unicycle_2r\n")
    assert (
        "plugin doors: doors:Taken: options that are there: out; it is left out" in done.stderr + both.stderr
    )
    assert "--json: expected without --symbolic, --search, --nearest and --loud" in both.stderr
    assert (play.returncode, "got 'that of a survey'" in play.stderr) == (2, True)
    assert faulty.python("-c", "import nmm; print(nmm.twice(2))").stdout == "4\n"
