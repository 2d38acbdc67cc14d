"""The documentation says what the code does."""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from derivatives import check_function
from places import ROOT
from small_pictures import draw_only
from worked_examples import FILES, write_examples

import nmm
from nmm.base.bundled import bundled_scenarios
from nmm.base.kinds import LIMITS, OBJECTIVES, PLATFORMS, REFERENCES, RESOLVERS, TASKS, Kinds
from nmm.base.plugins import SHIPPED
from nmm.cli.app import app
from nmm.cli.exit_status import status_of
from nmm.cli.paper import write

DOCUMENTS = ["README.md", *(path.relative_to(ROOT).as_posix() for path in sorted(ROOT.glob("docs/**/*.md")))]


def script(name: str) -> Any:
    """A script of docs/ as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_of_scenario_keys_is_the_schemas() -> None:
    expected = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    assert script("make_scenario_keys").page() == expected, "run python docs/make_scenario_keys.py"


def test_the_page_of_file_elements_is_the_tables() -> None:
    expected = (ROOT / "docs" / "file_elements.md").read_text(encoding="utf-8")
    assert script("make_file_elements").page() == expected, "run python docs/make_file_elements.py"


def test_the_lists_that_follow_from_the_kinds_hold_them_all() -> None:
    lists = script("make_kind_lists")
    texts = {path: path.read_text(encoding="utf-8") for path in (lists.STUB, lists.INDEX)}
    assert lists.stub(texts[lists.STUB]) == texts[lists.STUB], "run python docs/make_kind_lists.py"
    assert lists.index(texts[lists.INDEX]) == texts[lists.INDEX], "run python docs/make_kind_lists.py"
    for name, listed in lists.PAGES:
        page = (lists.API / name).read_text(encoding="utf-8")
        assert lists.reference(page, listed) == page, "run python docs/make_kind_lists.py"


def test_a_new_kind_gets_its_lines_in_the_lists(monkeypatch: pytest.MonkeyPatch) -> None:
    lists = script("make_kind_lists")
    made = type("NewTask", (nmm.Heading,), {"__module__": "nmm.control.functions.tasks.new"})
    monkeypatch.setitem(TASKS.data, "new", made)
    stub = lists.STUB.read_text(encoding="utf-8")
    line = "from .control.functions.tasks.new import NewTask as NewTask\n"
    assert lists.stub(stub).replace(line, "") == stub
    assert line + "from .control.goal import Goal as Goal\n" in lists.stub(stub)
    page = (lists.API / "task.md").read_text(encoding="utf-8")
    entry = ".. autoclass:: nmm.NewTask\n"
    assert lists.reference(page, TASKS).replace(entry, "") == page
    assert ".. autoclass:: nmm.LogDepth\n" + entry in lists.reference(page, TASKS)


def test_the_gallery_is_that_of_the_scenarios() -> None:
    expected = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    gallery = script("make_gallery")
    assert gallery.page() == expected, "run python docs/make_gallery.py"
    pictures = {path.stem for path in gallery.PICTURES.iterdir()}
    assert pictures == {*bundled_scenarios()}, "run python docs/make_gallery.py"


def words_and_numbers(text: str) -> tuple[list[str], list[float]]:
    """A text's lines without their numbers and spaces, and the numbers; none that were timed."""
    number = r"(?<![A-Za-z_\d])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
    text = re.sub(rf"{number} µs here", "", text)
    lines = ["".join(re.sub(number, "#", line).split()) for line in text.splitlines()]
    return lines, [float(found) for found in re.findall(number, text)]


console = script("console")


@pytest.fixture
def one_case(monkeypatch: pytest.MonkeyPatch) -> None:
    """`nmm paper`, which two pages write and none shows, with its first case, in this process: all of it has
    tests of its own."""
    share_out = write.share_out

    def shared(work: Any, items: list[int], jobs: int, advance: Any) -> Any:
        return share_out(work, items, 1, advance)

    monkeypatch.setattr(write, "share_out", shared)
    monkeypatch.setattr(write, "CASES", write.CASES[:1])


#: Pages that take half a minute each.
LONG = ("which_resolver", "car", "robot_loop", "tutorials/sweeps")


def pages() -> Iterator[Any]:
    for page in console.PAGES:
        name = page.relative_to(ROOT).as_posix()
        marks = pytest.mark.thorough if name.removesuffix(".md").endswith(LONG) else ()
        yield pytest.param(page, id=name, marks=marks)


@pytest.mark.usefixtures("one_case")
@pytest.mark.parametrize("page", list(pages()))
def test_a_page_that_runs_prints_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same words, and the same numbers but for rounding, counts of starts among them."""
    draw_only([Path(path).name for path in console.shown(page)], monkeypatch)
    text = page.read_text(encoding="utf-8")
    said, said_numbers = words_and_numbers(console.compared(text))
    anew = console.rewritten(text, tmp_path, scripts=False)
    printed, printed_numbers = words_and_numbers(console.compared(anew))
    assert printed == said, "run python docs/console.py"
    np.testing.assert_allclose(printed_numbers, said_numbers, rtol=0.05, atol=1e-6)
    for path in console.shown(page):
        assert (tmp_path / path).stat().st_size > 10_000, path


@pytest.mark.parametrize(
    "page", [name for name in DOCUMENTS if re.search(r"\bTry\b", (ROOT / name).read_text("utf-8"))]
)
def test_what_a_page_says_to_try_is_run_and_what_comes_out_is_stated(page: str) -> None:
    """Sections "Try" are texts with a console after each, which the test above runs and compares."""
    text = (ROOT / page).read_text(encoding="utf-8")
    assert ROOT / page in console.PAGES
    (section,) = re.findall(r"^## Try\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
    assert len(re.findall(r"\bTry\b", text)) == 1, "what is to be tried belongs into the section"
    *tried, more = re.split(r"^```console\n.*?^```\n", section, flags=re.DOTALL | re.MULTILINE)
    assert tried
    assert all(said.strip() for said in tried)
    assert "`" not in more, "to try this there is no console"
    for body in re.findall(r"^```console\n(.*?)^```\n", section, flags=re.DOTALL | re.MULTILINE):
        assert all(printed.count("\n") > 1 for printed in body.split("$ ")[1:]), f"shows nothing: {body}"


def commands(text: str) -> Iterator[list[str]]:
    """The arguments of each line of nmm in a block of a page, up to a pipe into another program."""
    blocks = re.findall(r"^```\w*\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    indented = re.findall(r"^ {4}(nmm .*)$", text, flags=re.MULTILINE)
    for line in "\n".join([*blocks, *indented]).splitlines():
        if found := re.match(r"(?:\$ )?nmm (?!check: |[\w-]+: )(.*?)(?:  .*| > \S+)?$", line):
            yield list(takewhile(lambda it: it not in ("|", "2>&1"), shlex.split(found[1], comments=True)))


#: What commands take in the tests, to be done in a second.
SMALLER = {
    "sweep": "--samples 2 --jobs 1", "run": "--set duration=2", "compare": "--set duration=2",
    "laps": "--laps 1",
}  # fmt: skip


def smaller(line: str) -> str:
    """A command line that takes less time, unless it plans or looks at what others have written."""
    return line if "plan" in line or "runs/" in line else f"{line} {SMALLER.get(line.split()[0], '')}"


def test_the_commands_of_the_readme_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All but `nmm render`, which needs a browser, `nmm paper`, which a tutorial runs, and what waits for a
    browser (`NOT_RUN`). They are listed in docs/contents.md."""
    draw_only([], monkeypatch)
    shutil.copy(ROOT / "docs" / "tutorials" / "my_robot.urdf", tmp_path)
    monkeypatch.chdir(tmp_path)
    readme = (ROOT / "docs" / "contents.md").read_text(encoding="utf-8")
    lines = re.findall(r"^nmm (.*?)(?:  .*)?$", readme, flags=re.MULTILINE)
    assert len(lines) > 15
    for line in lines:
        name = line.split()[0]
        if name not in ("render", "paper", "view", "drive"):
            place = line.replace("runs/...", "runs/unicycle_2r_position-rg")
            console.run(f"nmm {smaller(place)}")


#: Commands on pages that are not run here, by what they hold, and why.
NOT_RUN = {
    "my_": "the reader's own file",
    "bad_arm.urdf": "the reader's own file",
    "view ": "waits for a browser: tests/views/test_view_task.py",
    "drive ": "waits for a browser: tests/plugins/live/test_driving.py",
    "--stream": "waits for a viewer: tests/plugins/streams/test_stream_cli.py",
    "--play": "waits for a browser: tests/scenario/test_bundled_scenarios.py runs the scenarios",
}
#: Pages whose commands are run elsewhere.
ELSEWHERE = {
    "README.md",
    "docs/contents.md",
    "docs/own_plugin.md",
    *(page.relative_to(ROOT).as_posix() for page in console.PAGES),
}


@pytest.mark.parametrize("planning", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_the_commands_of_the_other_pages_run(
    planning: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Each once, in an empty folder; those that plan, which take long, by themselves."""
    draw_only([], monkeypatch)
    monkeypatch.chdir(tmp_path)
    lines = {
        shlex.join(arguments): page
        for page in DOCUMENTS
        if page not in ELSEWHERE
        for arguments in commands((ROOT / page).read_text(encoding="utf-8"))
    }
    skipped = {line: [why for why in NOT_RUN if why in f"{line} "] for line in lines}
    assert {why for whys in skipped.values() for why in whys} == {*NOT_RUN}, "a reason that nothing needs"
    run = [line for line, whys in skipped.items() if not whys and ("plan" in line) is planning]
    assert len(run) > 3
    for line in run:
        status = status_of(shlex.split(smaller(line)))
        assert status == 0, f"{lines[line]}: nmm {line}\n{capfd.readouterr().err}"


@pytest.mark.parametrize("page", DOCUMENTS)
def test_every_command_on_a_page_exists_with_its_options(page: str) -> None:
    group = typer.main.get_command(app)
    for arguments in commands((ROOT / page).read_text(encoding="utf-8")):
        if arguments[0] == "patrol":  # the plugin's of docs/own_plugin.md: tests/project/test_own_plugin.py
            continue
        with group.make_context("nmm", list(arguments)) as context:
            name, command, rest = group.resolve_command(context, list(arguments))
            assert command is not None
            command.make_context(name, rest, parent=context)


def test_the_readmes_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(code, names)
    trajectory = names["trajectory"]
    assert isinstance(trajectory, nmm.Trajectory)
    assert trajectory.complete
    assert trajectory.error_norm[-1] < 1e-10
    assert (tmp_path / "runs" / "first" / "motion.png").stat().st_size > 10_000


def test_the_worked_examples_can_be_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page's own files: a task that has its derivatives, a resolver that says what it gives."""
    write_examples(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    try:
        used_names = vars(importlib.import_module("used"))
    finally:
        for name in FILES:
            sys.modules.pop(name, None)
    run, robot, task = (used_names[name] for name in ("run", "robot", "task"))
    for q in run.q[::100]:
        check_function(task.function, robot, 0.0, q)
    # e_dot = -λ K e, with the share λ of the rate that the damping leaves.
    decay = np.exp(-2.0 * np.concatenate([[0.0], np.cumsum(run.scale[:-1, 0] * np.diff(run.t))]))
    np.testing.assert_allclose(run.error[:, 0], run.error[0, 0] * decay, atol=2e-3)
    assert np.all(run.scale < 1.0)
    assert np.all(run.scale > 0.5)


#: Tests that go over the registered kinds.
GRIDS = [
    *(
        f"control/test_resolvers.py::test_{name}[{shape}]"
        for name in ("every_resolver_does_the_task", "no_resolver_calls_solved_what_is_not")
        for shape in ((2, 4), (6, 8))
    ),
    "control/test_resolvers.py::test_resolvers_by_name",
    "views/test_resolver_style.py",
    "model/test_robot_grid.py::test_every_robot_tracks[unicycle-small arm-position]",
    "model/test_robot_grid.py::"
    "test_a_robot_that_comes_to_a_singularity_does_not_complete[car-small arm-pose]",
    "control/test_derivatives.py::test_value_t_and_value_q[slope]",
    "control/test_derivatives.py::test_the_grid_holds_every_function",
    "scenario/test_scenario_keys.py::test_every_kind_can_be_asked_for",
    "scenario/test_scenario_keys.py::test_every_parameter_is_documented",
    *(
        f"scenario/test_scenario.py::test_a_resolved_scenario_gives_the_same_run[{name}-{kind}]"
        for name in ("unicycle_2r_position", "unicycle_3r_position")
        for kind in ("damped", "transpose", "least")
    ),
    "scenario/test_scaffold.py::test_every_key_has_its_words",
    "cli/test_cli.py::test_help_lists_what_there_is",
]


@pytest.mark.thorough
def test_the_worked_examples_pass_the_grids_when_they_are_registered() -> None:
    """No grid asks of a kind more than it declares, of the page's kinds and of a Jacobian transpose's."""
    plugin = ("-p", "worked_examples", "-p", "no:cacheprovider")
    found = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *plugin, *(f"tests/{grid}" for grid in GRIDS)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT / "tests" / "helpers")},
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stdout[-4000:] + found.stderr[-1000:]
    assert re.search(r"\b[3-9]\d passed", found.stdout)


@pytest.mark.parametrize("page", DOCUMENTS)
def test_links_between_files_lead_somewhere(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text):
        assert ((ROOT / page).parent / target).exists(), target


def test_the_pages_of_the_tutorials_lead_on() -> None:
    """From the first to the last, by their links; and the README leads to the first."""
    folder = ROOT / "docs" / "tutorials"
    page, seen = "paper.md", []
    while page:
        seen.append(page)
        found = re.search(r"Next: \[[^]]+\]\(([\w.]+)\)", (folder / page).read_text(encoding="utf-8"))
        page = found[1] if found else ""
    assert sorted(seen) == sorted(path.name for path in folder.glob("*.md"))
    assert "docs/tutorials/paper.md" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_python_on_singularities_runs() -> None:
    text = (ROOT / "docs" / "singularities.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    assert names["report"].rank == 2
    assert len(names["formulas"].minors) == 6
    assert [family.pinned for family in names["search"].families] == [{"q2": pytest.approx((0.0, np.pi))}]
    assert names["history"].sigma_min["arm"].max() < 1e-12


@pytest.mark.parametrize(
    "listed", [PLATFORMS, TASKS, REFERENCES, OBJECTIVES, RESOLVERS, LIMITS], ids=lambda it: it.what
)
def test_the_contents_list_what_there_is(listed: Kinds) -> None:
    text = (ROOT / "docs" / "contents.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| \*\*{listed.what.capitalize()}s\*\* \| (.*) \|$", text, re.MULTILINE)
    assert set(re.findall(r"`(\w+)`", row)) == set(listed), f"docs/contents.md: row {listed.what}s"


def test_every_public_name_is_documented() -> None:
    for name in nmm.__all__:
        thing = getattr(nmm, name)
        if callable(thing):
            assert thing.__doc__, name


@pytest.mark.parametrize("room", ["analysis", "figures", "folders", "playback"])
def test_rooms_that_the_docs_speak_of_need_no_import_of_their_own(room: str) -> None:
    """`import nmm` is enough for `nmm.figures.limits(run)`: asked in a process that has imported nothing."""
    subprocess.run([sys.executable, "-c", f"import nmm; nmm.{room}.__name__"], check=True)


def test_the_python_on_objectives_runs() -> None:
    text = (ROOT / "docs" / "objectives.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    run, here = names["run"], names["here"]
    assert run.complete
    before, after = nmm.Configuration(here.robot, run.q[0]), here
    assert names["ahead"].value(after, 10.0) < 0.2 * names["ahead"].value(before, 0.0)
    (listed,) = re.findall(r"^\| class.*?\n\n", text, flags=re.DOTALL | re.MULTILINE)
    assert set(re.findall(r", `(\w+)` \|", listed)) == set(OBJECTIVES)


def test_the_errors_have_one_root() -> None:
    for name in nmm.__all__:
        thing = getattr(nmm, name)
        if isinstance(thing, type) and issubclass(thing, Exception):
            assert issubclass(thing, nmm.NmmError), name


def test_the_table_of_rooms_is_the_order_of_the_imports() -> None:
    """docs/architecture.md lists every package, in the order that pyproject.toml states."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (rooms,) = (contract for contract in contracts if contract["name"] == "Rooms")
    stated = [sorted(layer.split(" : ")) for layer in reversed(rooms["layers"])]
    text = (ROOT / "docs" / "architecture.md").read_text("utf-8")

    def listed(heading: str) -> list[str]:
        rows = text[text.index(f"| {heading} |") :].split("\n\n")[0].splitlines()[2:]
        return [row.split("`")[1].removesuffix("/") for row in rows]

    assert [[room] for room in [*listed("room"), "plugins"]] == stated
    assert listed("plugin") == [
        entry.removeprefix("nmm.").rpartition(".")[0].replace(".", "/") for entry in SHIPPED
    ]


def test_the_examples_of_what_is_sensed() -> None:
    text = (ROOT / "docs" / "sensed.md").read_text(encoding="utf-8")
    scan, room = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(scan, names)
    assert names["cloud"].left_out == 50
    assert names["plan"].trajectory().clearance_between.min() >= 0.03 - 1e-3
    exec(room, names)
    assert names["plan"].trajectory().clearance_between.min() >= 0.03 - 1e-3


def test_the_example_of_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "docs" / "limits.md").read_text(encoding="utf-8")
    code, classes = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(code, names)
    assert (tmp_path / "limits.png").exists()
    assert names["run"].margin.min() >= -1e-9
    exec(classes, names)
    robots = "unicycle_3r", "{platform: differential_base, arm: small_arm}"
    for robot, limits in zip(robots, re.findall(r"```yaml\n(.*?)```", text, flags=re.DOTALL), strict=True):
        (tmp_path / "limited.yaml").write_text(
            f"robot: {robot}\nq0: {{}}\nduration: 1\nresolver: {{kind: dls}}\n"
            f"task: {{kind: position, frame: ee, axes: xy, reference: [1, 1]}}\n{limits}",
            encoding="utf-8",
        )
        assert nmm.Scenario.load(tmp_path / "limited.yaml").run().limited
