"""run, compare, paper and play: what they print and write, and their exit status."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from command_line import Result, Terminal, page_of
from ports import MOST
from small_pictures import draw_only

import nmm
import nmm.cli.runs
from nmm.base.figure_options import FigureOptions
from nmm.base.findings import Finding
from nmm.cli.exit_status import status_of
from nmm.cli.options import chosen, named
from nmm.cli.runs import run as run_scenario
from nmm.motion.verdict import Outcome, Verdict
from nmm.plugins.live.cli import runs_in
from nmm.views.tables import Table

SHORT = ("--set", "duration=0.5")
Command = Callable[..., Result]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run a command line in an empty folder, in this process; pictures are empty."""
    monkeypatch.chdir(tmp_path)
    draw_only(["comparison.png"], monkeypatch)
    return lambda *arguments: Result(status_of(arguments), *capfd.readouterr())


# run


def test_run_writes_its_folder_and_prints_its_numbers(run: Command) -> None:
    result = run("run", "unicycle_2r_position", *SHORT)
    assert (result.status, result.err) == (0, "")
    assert result.value("outcome") == "completed, 0.5 s in 101 samples"
    assert result.value("resolver") == "RG, rk4, dt 0.005 s"
    assert result.value("redundancy") == "kinematic 2, static 3"
    assert result.value("switches of partition") == "0"
    folder = Path(result.value("files in"))
    assert folder == Path("runs/unicycle_2r_position-rg")
    files = {path.name for path in folder.iterdir()}
    assert {"trajectory.npz", "trajectory.csv", "summary.json", "scenario.yaml"} <= files
    assert any(name.endswith(".png") for name in files)
    assert "playback.html" not in files
    numbers = json.loads((folder / "summary.json").read_text())
    first, last = map(float, result.value("error of ee.x").removesuffix(" m").split(" → "))
    with np.load(folder / "trajectory.npz") as file:
        error = file["error"]
    assert (first, last) == pytest.approx((error[0, 0], error[-1, 0]), rel=5e-3)
    assert float(result.value("smallest σ_min")) == pytest.approx(numbers["sigma_min"], rel=5e-3)
    assert numbers["lateral_slip_max"] <= 1e-12


def test_the_folder_is_written_though_nobody_reads_the_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are told before figures are drawn: `nmm run … | head -1` ends with a folder all the same."""
    seen: list[bool] = []

    def gone(trajectory: nmm.Trajectory, numbers: dict[str, object]) -> int:
        seen.append((tmp_path / "here").exists())
        raise BrokenPipeError

    monkeypatch.setattr(nmm.cli.runs, "show_run", gone)
    with pytest.raises(BrokenPipeError):
        run_scenario("unicycle_2r_position", settings=["duration=0.5"], out=tmp_path / "here")
    assert seen == [False]
    assert {"summary.json", "motion.png"} <= {path.name for path in (tmp_path / "here").iterdir()}


def test_run_takes_resolver_settings_folder_and_html(run: Command) -> None:
    result = run(
        "run", "unicycle_2r_position", *SHORT, "--resolver", "pg", "--set", "dt=1/100",
        "--set", "resolver.alpha=5", "--set", "resolver.weights={v: 2}", "--out", "here/there", "--html",
    )  # fmt: skip
    assert (result.status, result.err) == (0, "")
    assert result.value("resolver") == "PG, rk4, dt 0.01 s"
    assert result.value("files in") == "here/there"
    written = yaml.safe_load(Path("here/there/scenario.yaml").read_text())
    given = {"kind": "pg", "tolerance": 1e-10, "alpha": 5.0, "weights": {"v": 2.0}, "step": "constant"}
    assert written["resolver"] == given
    assert Path("here/there/playback.html").stat().st_size > 100_000


def test_a_run_can_be_run_again_from_its_folder(run: Command) -> None:
    assert run("run", "unicycle_2r_switching", *SHORT, "--out", "first").status == 0
    assert run("run", "first/scenario.yaml", "--out", "second").status == 0
    with np.load("first/trajectory.npz") as first, np.load("second/trajectory.npz") as second:
        for name in first.files:
            assert np.array_equal(first[name], second[name]), name


def test_our_folder_is_replaced(run: Command) -> None:
    assert run("run", "unicycle_2r_position", *SHORT, "--out", "here").status == 0
    Path("here/left over").touch()
    assert run("run", "unicycle_2r_position", *SHORT, "--out", "here", "--set", "dt=0.01").status == 0
    assert not Path("here/left over").exists()
    assert json.loads(Path("here/summary.json").read_text())["dt"] == 0.01
    assert [path.name for path in Path().iterdir()] == ["here"]


def test_no_redundancy_left_is_legal_and_said(run: Command) -> None:
    task = (
        "task=[{kind: position, frame: ee, axes: xy, reference: [0.9, 0.3]}, "
        "{kind: coordinates, of: [q1, q2], reference: [0.4, 0.5]}]"
    )
    result = run(
        "run", "unicycle_2r_position", *SHORT, "--set", task, "--resolver", "pg", "--set", "q0={q2: 0.2}"
    )
    assert result.status == 0
    assert result.value("redundancy") == "kinematic none left, static 1"
    assert result.err.count("\n") == 1
    assert "no redundancy is left" in result.err


def test_a_singular_run_ends_with_what_it_has(run: Command) -> None:
    """With the arm's base on the wheels' axle J loses rank at q1 = π/2, q2 = 0: where the objective leads."""
    result = run(
        "run", "unicycle_2r_position", "--resolver", "pg", "--set", "robot.arguments.d=0",
        "--set", "q0={q1: 1, q2: 0.3}", "--set", "task.0.reference=[0.35, 0.7]", "--set", "task.0.gain=null",
        "--set", "objective={kind: quadratic, terms: [{of: q1, target: pi/2}, {of: q2}]}",
    )  # fmt: skip
    assert result.status == 1
    assert result.err.count("\n") == 1
    assert re.match(
        r"nmm run: PG singular: at t = [1-9].*J lost rank.*runs/unicycle_2r_position-pg", result.err
    )
    folder = Path("runs/unicycle_2r_position-pg")
    numbers = json.loads((folder / "summary.json").read_text())
    assert not numbers["complete"]
    assert numbers["samples"] > 1
    trajectory = nmm.Trajectory.load(folder)
    assert len(trajectory) == numbers["samples"]
    assert trajectory.message


def test_a_run_singular_from_the_start_is_written_too(run: Command) -> None:
    result = run(
        "run", "unicycle_2r_position", "--set", "robot.arguments.d=0", "--set", "q0={q1: pi/2}",
        "--set", "resolver.partitions=[[v, q1], [v, omega]]", "--set", "task.0.axes=xy", "--html",
    )  # fmt: skip
    assert result.status == 1
    assert result.err.count("\n") == 1
    assert re.search(r"nmm run: RG singular: at t = 0 s", result.err)
    assert result.value("outcome") == "singular"
    assert json.loads(Path("runs/unicycle_2r_position-rg/summary.json").read_text())["samples"] == 0


def test_a_run_whose_step_is_too_long_says_so(run: Command) -> None:
    result = run("run", "unicycle_2r_pointing", "--set", "resolver.alpha=1000", "--set", "duration=2")
    assert result.status == 1
    assert result.err.count("\n") == 1
    assert re.match(r"nmm run: RG (diverged|unstable|singular): ", result.err)
    assert "too large" in result.err
    assert not json.loads(Path("runs/unicycle_2r_pointing-rg/summary.json").read_text())["complete"]


@pytest.mark.parametrize("name", ["SIGINT", pytest.param("SIGTERM", marks=pytest.mark.thorough)])
def test_an_interrupted_run_leaves_its_part(tmp_path: Path, name: str) -> None:
    """One that no compiled loop computes: it lasts longer than anybody takes to interrupt it."""
    long = ("--set", "duration=1000", "--set", "method=adaptive")
    terminal = Terminal(tmp_path, 200, "run", "unicycle_2r_position", *long, "--out", "part")
    terminal.read_until(r" [1-9]\d?%")  # of the progress bar: the run is under way
    terminal.process.send_signal(getattr(signal, name))
    shown = terminal.read_until(None)
    assert terminal.process.wait(timeout=MOST) == 1, shown
    line = r"nmm run: RG interrupted: interrupted after .* s of 1000 s; the part .* is in part\r\n"
    assert re.search(line, shown)
    assert "Traceback" not in shown
    numbers = json.loads((tmp_path / "part" / "summary.json").read_text())
    assert (numbers["outcome"], numbers["complete"]) == ("interrupted", False)
    trajectory = nmm.Trajectory.load(tmp_path / "part")
    assert 1 < len(trajectory) < 200_001
    assert np.all(np.isfinite(trajectory.q))
    assert [path.name for path in tmp_path.iterdir()] == ["part"]


#: A command line that Ctrl-C meets when it catches signals and begins to import a module. From outside nobody
#: knows, on a busy machine, how far it is.
INTERRUPTED = """
import os, signal, sys, threading, time
def interrupt():
    while signal.getsignal(signal.SIGTERM) == signal.SIG_DFL or {module!r} not in sys.modules:
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt, daemon=True).start()
from nmm.cli.exit_status import main
main()
"""


@pytest.mark.parametrize("module", ["sys", "pinocchio"])
def test_ctrl_c_where_there_is_nothing_to_write(tmp_path: Path, module: str) -> None:
    """While the libraries are still being imported."""
    arguments = ("run", "unicycle_2r_position", "--set", "duration=100000")
    command = [sys.executable, "-c", INTERRUPTED.format(module=module), *arguments]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=MOST)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "nmm run: interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_in_a_text_that_python_runs_ends_as_any_other(tmp_path: Path) -> None:
    """Python would end by the signal, although it was caught."""
    (tmp_path / "ended.py").write_text(
        "from nmm.cli import exit_status\n"
        "def status_of(arguments):\n"
        "    try:\n        exec('raise KeyboardInterrupt')\n"
        "    except KeyboardInterrupt:\n        return 130\n"
        "exit_status.status_of = status_of\nexit_status.main()\n"
    )
    assert subprocess.run([sys.executable, "-m", "ended"], cwd=tmp_path).returncode == 130


#: A command that is done, and asked to end at an instruction behind that: at the first, the second and so on.
ENDED = """
import os, signal, sys
from nmm.cli import exit_status, interrupts
FILES = exit_status.__file__, interrupts.__file__
sys.argv = ["nmm", "run"]
def ended_at(number):
    done, left = [], [number]
    exit_status.status_of = lambda arguments: done.append(0) or 0
    def trace(frame, event, _):
        if frame.f_code.co_filename not in FILES:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode" and done:
            left[0] -= 1
            if left[0] == -1:
                os.kill(os.getpid(), signal.{name})
        return trace
    sys.settrace(trace)
    try:
        exit_status.main()
    except SystemExit as ended:
        return left[0] < 0, ended.code
    except BaseException as error:
        return left[0] < 0, repr(error)
    finally:
        sys.settrace(None)
number = 0
while (ended := ended_at(number))[0]:
    print(ended[1])
    number += 1
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_when_all_is_done_prints_no_traceback(tmp_path: Path, name: str) -> None:
    command = [sys.executable, "-c", ENDED.replace("{name}", name)]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=MOST)
    lines = ended.stdout.split("\n")[:-1]
    assert len(lines) > 20
    # Before the command's own status is there, it is not known that it is done.
    unknown = lines.count("130")
    assert unknown <= 5
    assert lines == ["130"] * unknown + ["0"] * (len(lines) - unknown)
    assert ended.stderr == "nmm run: interrupted\n" * unknown


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_ctrl_c_waits_for_an_import_that_would_swallow_it(tmp_path: Path, name: str) -> None:
    (tmp_path / "greedy.py").write_text(
        f"import os, signal, time\n"
        f"try:\n    os.kill(os.getpid(), signal.{name}); time.sleep(0.1)\n"
        f"except BaseException:\n    print('swallowed', flush=True)\n"
    )
    program = (
        "import sys, time; sys.path.insert(0, '.'); from nmm.cli.interrupts import raise_interrupts\n"
        "raise_interrupts()\n"
        "try:\n    import greedy; time.sleep(20)\n"
        "except KeyboardInterrupt:\n    print('ended', 'greedy' in sys.modules)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert (result.stdout, result.stderr) == ("ended True\n", "")


# compare


@pytest.mark.parametrize("last", [1, 2])
def test_compare_that_is_interrupted_leaves_the_one_before(
    run: Command, monkeypatch: pytest.MonkeyPatch, last: int
) -> None:
    """Where nothing was before, what was computed is written."""
    begun = 0
    asked = ("compare", "unicycle_2r_position", *SHORT, "--out", "compared")
    numbers = Path("compared/summary.json")

    def interrupted(self: nmm.Scenario, *given: object, **more: object) -> nmm.Trajectory:
        nonlocal begun
        begun += 1
        ran = through(self, *given, **more)
        verdict = Verdict(Outcome.INTERRUPTED, (Finding("interrupted_judging"),))
        return dataclasses.replace(ran, verdict=verdict) if begun % last == 0 else ran

    through = nmm.Scenario.run
    with monkeypatch.context() as meanwhile:
        meanwhile.setattr(nmm.Scenario, "run", interrupted)
        assert run(*asked).status == 1
        assert len(json.loads(numbers.read_text())["runs"]) == last
    assert run(*asked).status == 0
    before = numbers.read_bytes()
    with monkeypatch.context() as meanwhile:
        meanwhile.setattr(nmm.Scenario, "run", interrupted)
        result = run(*asked)
    assert (result.status, result.out) == (130, "")
    assert f"run {last} of 2 was interrupted: the comparison in compared stays" in result.err
    assert numbers.read_bytes() == before


def test_compare_makes_one_table_one_figure_one_playback(run: Command) -> None:
    result = run("compare", "unicycle_2r_pointing", "--resolvers", "rg, pg,ej", "--html", *SHORT)
    assert (result.status, result.err) == (0, "")
    assert result.out.splitlines()[1].split() == ["RG", "PG", "EJ"]
    folder = Path(result.value("files in"))
    assert folder == Path("runs/unicycle_2r_pointing-compare")
    assert {path.name for path in folder.iterdir()} == {
        "comparison.png", "playback.html", "summary.json", "rg", "pg", "ej",
    }  # fmt: skip
    numbers = json.loads((folder / "summary.json").read_text())
    assert numbers["complete"]
    for kind in ("rg", "pg", "ej"):
        trajectory = nmm.Trajectory.load(folder / kind)
        assert trajectory.resolver == kind
        assert numbers["runs"][kind]["objective_final"] == trajectory.objective[-1]
    assert (folder / "comparison.png").read_bytes()[:4] == b"\x89PNG"
    # A comparison is ours too: it may be replaced.
    again = run("compare", "unicycle_2r_pointing", "--resolvers", "rg", *SHORT, "--set", 'title=""')
    assert again.status == 0
    assert again.out.splitlines()[0] == "unicycle_2r_pointing"  # without a title, without a colon


LAWS = """\
import numpy as np
from nmm import ProjectedGradient


def least_norm(problem):
    return np.linalg.pinv(problem.J) @ problem.rate


class Law(ProjectedGradient):
    def __init__(self):
        super().__init__(alpha=3.0)


five = ProjectedGradient(5.0)
number = 3
"""


def test_compare_takes_settings_and_resolvers_of_ones_own(run: Command) -> None:
    """Each run has a name, a colour and a folder of its own, and is what its entry says."""
    for folder in ("", "more"):
        Path(folder).mkdir(exist_ok=True)
        (Path(folder) / "laws.py").write_text(LAWS, encoding="utf-8")
    entries = "rg,pg:alpha=50,rg:alpha=5,laws.py:least_norm,more/laws.py:least_norm,laws.py:Law,laws.py:five"
    result = run("compare", "unicycle_2r_position", "--resolvers", entries, *SHORT)
    assert result.status == 0
    called = ["RG", "PG α=50", "RG α=5", *["laws.py:least_norm"] * 2, "laws.py:Law", "laws.py:five"]
    assert re.split(r"  +", result.out.splitlines()[1].strip()) == called
    folder = Path("runs/unicycle_2r_position-compare")
    names = ["rg", "pg-alpha-50", "rg-alpha-5", "laws.py-least_norm", "laws.py-least_norm-2"]
    names += ["laws.py-law", "laws.py-five"]
    runs = {name: nmm.Trajectory.load(folder / name) for name in names}
    assert list(json.loads((folder / "summary.json").read_text())["runs"]) == names
    assert [one.called for one in runs.values()] == called
    assert [one.called for one in runs_in(folder)] == called
    for name, alpha in (("pg-alpha-50", 50.0), ("rg-alpha-5", 5.0)):
        assert runs[name].scenario is not None
        assert runs[name].scenario["resolver"]["alpha"] == alpha
    alone = nmm.Scenario.load("unicycle_2r_position", {"duration": "0.5", "resolver.kind": "pg"})
    np.testing.assert_array_equal(runs["pg-alpha-50"].q, alone.override("resolver.alpha", 50).run().q)
    np.testing.assert_array_equal(runs["laws.py-law"].q, alone.override("resolver.alpha", 3).run().q)
    np.testing.assert_array_equal(runs["laws.py-five"].q, alone.override("resolver.alpha", 5).run().q)
    idle = alone.override("objective", None).run()
    np.testing.assert_allclose(runs["laws.py-least_norm"].q, idle.q, atol=1e-9)
    page = (folder / "playback.html").read_text(encoding="utf-8")
    assert all(f'"{label}"' in page or label.encode("unicode_escape").decode() in page for label in called)


def test_a_run_with_a_resolver_of_ones_own_is_recorded_and_not_run_from_a_file(run: Command) -> None:
    Path("laws.py").write_text(LAWS, encoding="utf-8")
    result = run("run", "unicycle_2r_position", "--resolver", "laws.py:least_norm", *SHORT)
    assert result.status == 0
    folder = Path(result.value("files in"))
    assert folder == Path("runs/unicycle_2r_position-laws.py-least_norm")
    file = str(folder / "scenario.yaml")
    source = yaml.safe_load((folder / "scenario.yaml").read_text())["resolver"]["source"]
    assert source == f"{Path('laws.py').resolve()}:least_norm"
    again = run("run", file, "--out", "again")
    assert again.status == 2
    assert f"resolver.source: a scenario runs no Python; expected {source} as --resolver" in again.err
    assert run("run", file, "--resolver", source, "--out", "again").status == 0
    first, second = (nmm.Trajectory.load(one) for one in (folder, "again"))
    np.testing.assert_array_equal(first.q, second.q)
    assert run("run", file, "--resolver", "pg", "--out", "other").status == 0


@pytest.mark.parametrize(
    ("entries", "messages"),
    [
        ("rg,rg", ["--resolvers: rg is given twice", "rg,rg:alpha=5"]),
        ("rg,pg,rg:alpha=10", ["rg and rg:alpha=10 are the same here"]),
        ("pg:alpha=50,pg:alpha=5e1", ["pg:alpha=50 and pg:alpha=5e1 are the same here"]),
        ("laws.py:five,./laws.py:five", ["are the same here"]),
        ("rg,pg:beta=3", ["set resolver.beta", "available: kind, alpha"]),
        ("rg,pg:alpha", ["expected KIND:KEY=VALUE, as in pg:alpha=50, got 'pg:alpha'"]),
        ("laws.py", ["expected FILE.py:NAME, got 'laws.py'"]),
        ("laws.py:five:alpha=3", ["expected FILE.py:NAME"]),
        ("nowhere.py:law", ["nowhere.py: expected a Python file"]),
        ("laws.py:least", ["unknown name 'least' (did you mean 'least_norm'?)", "Law"]),
        ("laws.py:number", ["number: expected a function problem -> u or a Resolver, got 3"]),
        ("broken.py:law", ["broken.py: ZeroDivisionError: division by zero"]),
        ("unread.py:law", ["unread.py: SyntaxError"]),
    ],
)
def test_entries_that_are_none(entries: str, messages: list[str], run: Command) -> None:
    for name, text in (("laws", LAWS), ("broken", "1 / 0\n"), ("unread", "def law(:\n")):
        Path(f"{name}.py").write_text(text, encoding="utf-8")
    result = run("compare", "unicycle_2r_position", "--resolvers", entries, *SHORT)
    assert (result.status, result.out, len(result.err.splitlines())) == (2, "", 1)
    assert not Path("runs").exists()
    for message in messages:
        assert message in result.err


def test_a_key_of_another_resolver_says_how_compare_takes_it(run: Command) -> None:
    given = ("unicycle_2r_manipulability", "--resolvers")
    result = run("compare", *given, "rg,ej", "--set", "resolver.added_task={kind: coordinates}")
    assert (result.status, result.out) == (2, "")
    assert "added_task is a key of ej: ej:added_task=… in --resolvers" in result.err
    said = run("compare", *given, "rg,ej:gain=1,pg").err
    pasted = shlex.split(said[said.index("--resolvers") : said.rindex(", got")])[1]
    assert pasted.startswith("rg,pg,ej:gain=1:added_task={kind: coordinates")
    for text in named(pasted, "--resolvers"):
        chosen(text, "--resolvers").scenario(nmm.Scenario.load(given[0])).controller()
    assert "no blanks in --resolvers rg,pg" in run("compare", *given, "rg,", "pg").err


def test_a_comparison_shows_what_is_asked_of_the_inputs_and_when_the_error_settles(run: Command) -> None:
    result = run("compare", "unicycle_2r_pointing", "--set", "duration=5", "--out", "both")
    assert result.status == 0
    runs = [nmm.Trajectory.load(f"both/{kind}") for kind in ("rg", "pg")]
    numbers = json.loads(Path("both/summary.json").read_text())["runs"]
    for kind, one in zip(("rg", "pg"), runs, strict=True):
        assert numbers[kind]["u_max"] == dict(zip(one.robot.u_names, np.abs(one.u).max(axis=0), strict=True))
        assert numbers[kind]["settling_time"] == pytest.approx(np.log(50.0), rel=1e-4)
    joints = [one.robot.u_names.index(name) for one in runs[:1] for name in ("omega", "q1", "q2")]
    peaks = re.split(r"  +", result.value("peak inputs"))
    for text, one in zip(peaks, runs, strict=True):
        drive, turn = re.fullmatch(r"v (\S+) m/s, \w+ (\S+) rad/s", text).groups()  # type: ignore[union-attr]
        assert float(drive) == pytest.approx(np.abs(one.u[:, 0]).max(), rel=5e-3)
        assert float(turn) == pytest.approx(np.abs(one.u[:, joints]).max(), rel=5e-3)
    assert re.split(r"  +", result.value("‖e‖ down to 2 % of its start")) == ["after 3.91 s"] * 2


def test_a_comparison_with_a_failed_run_says_so(run: Command) -> None:
    result = run(
        "compare", "unicycle_2r_switching", "--resolvers", "pg,rg", "--set", "resolver.alpha=2000", *SHORT
    )
    assert result.status == 1
    assert len(result.err.splitlines()) == 2
    assert all(line.startswith("nmm compare: ") for line in result.err.splitlines())
    assert not json.loads(Path("runs/unicycle_2r_switching-compare/summary.json").read_text())["complete"]


# paper


def test_paper_hands_over_the_folder_and_prints_the_claims(
    run: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`write_paper` has its own tests; here it is what the command makes of its report."""
    import nmm.cli.paper

    for holds, status in ((True, 0), (False, 1)):
        case = SimpleNamespace(number=1, claims=[SimpleNamespace(statement="RG is faster", holds=holds)])
        report = SimpleNamespace(cases=[case], holds=holds, index=Path("here/index.html"))
        asked: list[object] = []

        def write_paper(
            folder: Path,
            progress: object = None,
            figures: FigureOptions | None = None,
            report: SimpleNamespace = report,
            asked: list[object] = asked,
        ) -> SimpleNamespace:
            asked += [folder, progress, figures]
            return report

        monkeypatch.setattr(nmm.cli.paper, "write_paper", write_paper)
        result = run("paper", "--out", "here", "--format", "pdf", "--width", "column")
        assert result.status == status
        assert result.value("1").split() == ["RG", "is", "faster", "yes" if holds else "NO"]
        assert result.value("open") == "here/index.html"
        assert len(result.err.splitlines()) == status
        assert asked == [Path("here"), None, FigureOptions(("pdf",), "column")]
        report.table = lambda: Table(("1 RG",), ())
        numbers = run("paper", "--out", "here", "--table", "csv")
        assert (numbers.status, numbers.out) == (status, "run\n1 RG\n")
        assert numbers.err.splitlines()[0] == "files in  here"


# play


def test_play_ends_cleanly(run: Command, tmp_path: Path) -> None:
    assert run("run", "unicycle_2r_position", "--set", "duration=0.1", "--out", "short").status == 0
    playing, _ = page_of(tmp_path, "play", "short")
    playing.send_signal(signal.SIGTERM)
    _, err = playing.communicate(timeout=MOST)
    assert (playing.returncode, err) == (0, "")


def test_play_shows_a_comparison(run: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run("compare", "unicycle_2r_position", "--set", "duration=0.1", "--out", "two").status == 0
    shown = []
    monkeypatch.setattr(nmm.views.playback, "play", lambda runs, **options: shown.append((runs, options)))
    assert run("play", "two", "--port", "7123", "--no-open").status == 0
    ((runs, options),) = shown
    assert [trajectory.resolver for trajectory in runs] == ["rg", "pg"]
    assert options == {"port": 7123, "open_browser": False, "ellipsoids": False}


def test_playback_in_a_scripts_background_ends_when_told_to(run: Command, tmp_path: Path) -> None:
    """A shell without job control starts what comes before "&" with SIGINT ignored."""
    run("run", "unicycle_2r_position", *SHORT, "--out", "short")
    line = f"{sys.executable} -u -m nmm play short --no-open & echo $!; wait $!"
    shell = subprocess.Popen(["bash", "-c", line], cwd=tmp_path, text=True, stdout=subprocess.PIPE)
    assert shell.stdout is not None
    player = int(shell.stdout.readline())
    assert "http://127.0.0.1:" in shell.stdout.readline()
    os.kill(player, signal.SIGINT)
    assert shell.wait(MOST) == 0
    shell.stdout.close()
    with pytest.raises(ProcessLookupError):
        os.kill(player, 0)


@pytest.mark.parametrize(
    ("scenario", "settings", "reason"),
    [
        ("unicycle_3r_out_of_reach", [], "out of reach: it is 1.7 m above q1"),
        ("unicycle_2r_position", ["limits.velocity={v: 0.3, omega: 0.1}", "duration=5"], "input v (100 %)"),
    ],
)
def test_what_was_missed_is_read_in_two_lines(
    run: Command, scenario: str, settings: list[str], reason: str
) -> None:
    """Of a terminal of 100 columns, but for the names: how much, since when, and why."""
    options = [part for setting in settings for part in ("--set", setting)]
    result = run("run", scenario, *options, "--out", "missed")
    assert result.status == 1
    last = result.err.splitlines()[-1]
    assert len(last) <= 200, last
    assert reason in last
    error = np.linalg.norm(nmm.Trajectory.load("missed").error, axis=1)
    assert f"{error[0]:.3g} at first, {error[-1]:.3g} at the end (expected" in last
    assert "missed" in result.out
