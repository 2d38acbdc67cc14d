"""Sweeps: a row is its definition's and its number's, whoever computes it, and however often it is begun."""

from __future__ import annotations

import itertools
import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from command_line import Result
from findings import refused
from places import ROOT
from ports import MOST
from short_scenario import MINIMAL

import nmm
from nmm.base.bundled import bundled_sweeps
from nmm.base.errors import NOTHING
from nmm.cli.app import app
from nmm.cli.exit_status import status_of
from nmm.plugins.sweeps import folder as sweep_folder
from nmm.plugins.sweeps import rows as sweep_rows
from nmm.plugins.sweeps.definition import SAMPLERS, Listed, Range, parsed
from nmm.plugins.sweeps.rows import columns_of, rows_of
from nmm.plugins.sweeps.sweep import read_sweep

Command = Callable[..., Result]


@pytest.fixture
def short(tmp_path: Path) -> Path:
    path = tmp_path / "short.yaml"
    path.write_text(MINIMAL, encoding="utf-8")
    return path


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run a command line in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: Result(status_of(arguments), *capfd.readouterr())


# What varies, and the points


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("dimensions", [1, 5])
def test_points_do_not_depend_on_how_many_are_asked_for(sampler: str, dimensions: int) -> None:
    make = SAMPLERS[sampler]
    whole = make(7, 60, dimensions, 0, 60)
    parts = [make(7, 60, dimensions, first, count) for first, count in ((0, 1), (1, 30), (31, 29))]
    assert np.array_equal(whole, np.vstack(parts))
    assert not np.array_equal(whole, make(8, 60, dimensions, 0, 60))
    assert whole.min() >= 0.0
    assert whole.max() < 1.0
    if sampler == "lhs":
        assert np.array_equal(
            np.sort(np.floor(60 * whole), axis=0), np.tile(np.arange(60.0), (dimensions, 1)).T
        )
    else:
        assert np.array_equal(whole[:20], make(7, 20, dimensions, 0, 20))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("q0.x=-pi:pi", Range("q0.x", -np.pi, np.pi)),
        ("a=0:1:3", Listed("a", (0.0, 0.5, 1.0))),
        ("resolver.kind=rg,pg", Listed("resolver.kind", ("rg", "pg"))),
        ("a=[1,2], [3,4]", Listed("a", ("[1,2]", "[3,4]"))),
        ("a={b: 1, c: 2},{b: 2}", Listed("a", ("{b: 1, c: 2}", "{b: 2}"))),
    ],
)
def test_what_varies_is_written_as_people_do(text: str, expected: object) -> None:
    assert parsed(text) == expected


def test_levels_of_a_range_have_both_ends() -> None:
    (levels,) = [parsed("a=-0.1:0.7:9")]
    assert isinstance(levels, Listed)
    assert levels.values[-1] == 0.7
    np.testing.assert_allclose(levels.values, np.linspace(-0.1, 0.7, 9), atol=1e-15)


def test_each_point_meets_every_combination(short: Path) -> None:
    vary = {"q0.x": (-1, 1), "resolver.kind": ["rg", "pg"], "q0.y": (-2, 2), "duration": "0.01:0.03:3"}
    definition = nmm.Sweep(short, vary, samples=5, sampler="random", seed=4).definition
    assert definition.rows == 5 * 2 * 3
    every = definition.changes(range(30))
    assert [list(row) for row in every] == [list(vary)] * 30
    for i in (0, 7, 29):
        assert definition.changes([i]) == [every[i]]
    for rows in (every[6 * k : 6 * k + 6] for k in range(5)):
        assert len({(row["q0.x"], row["q0.y"]) for row in rows}) == 1
        met = [(row["resolver.kind"], row["duration"]) for row in rows]
        assert met == list(itertools.product(["rg", "pg"], [0.01, pytest.approx(0.02), 0.03]))
    assert len({row["q0.x"] for row in every}) == 5


# A row


def test_a_row_is_what_the_scenario_does_by_itself(short: Path) -> None:
    settings = {"duration": 0.3, "limits": {"velocity": {"v": 0.1, "omega": 0.1, "arm": 0.2}}}
    sweep = nmm.Sweep(short, {"q0.x": (-1, 1), "resolver.kind": ["rg", "pg"]}, samples=2, settings=settings)
    for index, row in enumerate(rows_of(sweep.definition, range(4))):
        (changes,) = sweep.definition.changes([index])
        own = nmm.Scenario.load(short, {**settings, **changes}).run()
        summary = own.summary()
        assert row["index"] == index
        assert {key: row[key] for key in changes} == changes
        for name in ("outcome", "error_rms", "objective_integral", "scale_min", "sigma_min", "input_peak"):
            assert row[name] == summary[name], name
        assert row["scale_min"] < 1.0
        assert row["u_max.omega"] == np.abs(own.u[:, 1]).max()
        steps = np.diff(own.t)
        power = np.array([u @ u for u in own.u])
        assert row["effort"] == pytest.approx(float(steps @ (power[1:] + power[:-1])) / 2.0)
        assert row["arrival"] is None


def test_without_a_goal_arrival_is_when_the_error_stays_small(short: Path) -> None:
    """e = exp(-K t) e(0): below 2 % from t = ln(50) / K on."""
    sweep = nmm.Sweep(short, {"task.gain": [8, 16]}, settings={"duration": 0.6})
    for row, gain in zip(rows_of(sweep.definition, range(2)), (8, 16), strict=True):
        assert row["arrival"] == pytest.approx(np.log(50.0) / gain, abs=0.006)


def test_with_a_goal_arrival_is_when_it_was_reached(short: Path) -> None:
    sweep = nmm.Sweep(
        short, {"task.gain": [1, 20]}, settings={"until": {"m": 0.01}, "duration": 1, "dt": 0.01}
    )
    slow, fast = rows_of(sweep.definition, range(2))
    assert (slow["outcome"], slow["arrival"]) == ("missed", None)
    assert (fast["outcome"], fast["arrival"]) == ("completed", fast["t_end"])
    assert fast["t_end"] < 1.0


def test_a_rollout_that_fails_is_a_row_that_says_why(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    vary = {"resolver.kind": ["pg", "rg"], "resolver.threshold": [0.01, 0.02]}
    definition = nmm.Sweep(short, vary).definition
    rows = rows_of(definition, range(4))
    assert [row["outcome"] for row in rows] == ["refused"] * 2 + ["completed"] * 2
    assert "unknown key 'threshold'" in rows[0]["message"]
    assert rows[0]["error_rms"] is None

    def broken(self: nmm.Scenario, **_: object) -> None:
        raise ZeroDivisionError("of ours")

    monkeypatch.setattr(nmm.Scenario, "run", broken)
    (row,) = rows_of(definition, [2])
    assert (row["outcome"], row["message"]) == ("error", "ZeroDivisionError: of ours")


def test_a_robot_is_loaded_once_for_each_way_it_changes(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    vary = {"robot.arguments.d": [0.2, 0.4], "q0.x": (-1, 1)}
    definition = nmm.Sweep(short, vary, samples=4).definition
    loaded: list[str] = []
    load = nmm.Scenario.robot

    def counted(self: nmm.Scenario) -> nmm.Robot:
        if self._robot is None:
            loaded.append(self.parts.robot.arguments["d"])
        return load(self)

    monkeypatch.setattr(nmm.Scenario, "robot", counted)
    sweep_rows._robots.clear()
    rows = rows_of(definition, range(8))
    assert sorted(loaded) == ["0.2", "0.4"]
    assert rows[0]["error_initial"] != rows[1]["error_initial"]


def test_threads_and_controllers_used_again_change_no_cell(short: Path) -> None:
    """Other starts, of which some are refused, and other gains, some too large for dt, by several threads."""
    vary = {"q0.q1": (-4, 4), "task.gain": [1, 4, 1e6], "resolver.kind": ["rg", "pg"]}
    settings = {"duration": 0.2}
    definition = nmm.Sweep(short, vary, samples=3, settings=settings).definition
    told: list[float] = []
    rows = rows_of(definition, range(18), progress=told.append, threads=3)
    assert rows == rows_of(definition, range(18)) == rows_of(definition, range(18))
    assert told == [(k + 1) / 18 for k in range(18)]
    assert len({row["outcome"] for row in rows}) > 1
    for row, changes in zip(rows, definition.changes(range(18)), strict=True):
        if row["outcome"] == "refused":
            with pytest.raises(nmm.InputError, match=re.escape(row["message"])):
                nmm.Scenario.load(short, {**settings, **changes}).run()
            continue
        summary = nmm.Scenario.load(short, {**settings, **changes}).run().summary()
        for name in ("outcome", "message", "error_rms", "input_peak"):
            assert row[name] == summary.get(name), name


def test_an_interrupt_in_a_thread_ends_all(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    definition = nmm.Sweep(short, {"q0.x": (-1, 1)}, samples=400).definition
    begun: list[int] = []
    rollout = sweep_rows._rollout

    def interrupted(definition: Any, index: int, *rest: Any) -> dict[str, Any]:
        begun.append(index)
        if index == 3:
            raise KeyboardInterrupt
        return rollout(definition, index, *rest)

    monkeypatch.setattr(sweep_rows, "_rollout", interrupted)
    with pytest.raises(KeyboardInterrupt):
        rows_of(definition, range(400), threads=2)
    assert len(begun) < 400


# The folder


def vary_x(short: Path, **settings: Any) -> nmm.Sweep:
    keywords: dict[str, Any] = {"samples": 30, **settings}
    return nmm.Sweep(short, {"q0.x": (-1, 1), "resolver.kind": ["rg", "pg"]}, **keywords)


def test_the_folder_holds_all_rows_in_order(short: Path, tmp_path: Path) -> None:
    sweep, told = vary_x(short), []
    swept = sweep.run(tmp_path / "out", jobs=1, progress=told.append)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        ".lock", "index.html", "rows.parquet", "sweep.json",
    ]  # fmt: skip
    table = pq.read_table(tmp_path / "out" / "rows.parquet")
    assert table["index"].to_pylist() == list(range(60))
    assert swept.outcomes == {"completed": 60}
    assert table.to_pylist()[17:19] == rows_of(sweep.definition, [17, 18])
    assert json.loads(table.schema.metadata[b"nmm"]) == sweep.definition.plain()
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, pytest.approx(1.0))
    before = (tmp_path / "out" / "rows.parquet").stat().st_mtime_ns
    sweep.run(tmp_path / "out", jobs=1)  # there is nothing left to do
    assert (tmp_path / "out" / "rows.parquet").stat().st_mtime_ns == before


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario, its sweep in "whole", and in "parts" the same, interrupted when all rows were computed."""
    folder = tmp_path_factory.mktemp("sweeps")
    (folder / "short.yaml").write_text(MINIMAL, encoding="utf-8")
    vary_x(folder / "short.yaml").run(folder / "whole", jobs=1)

    def stop(place: object) -> None:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweep_folder.SweepFolder, "finish", stop)
        with pytest.raises(KeyboardInterrupt):
            vary_x(folder / "short.yaml").run(folder / "parts", jobs=1)
    return folder


@pytest.mark.parametrize("part", ["head", "middle", "end"])
def test_a_damaged_part_is_computed_again_and_told(folders: Path, tmp_path: Path, part: str) -> None:
    """Also where its end, with the number of its rows, is whole."""
    shutil.copytree(folders / "parts", tmp_path / "parts")
    sweep, kept = vary_x(folders / "short.yaml"), tmp_path / "parts" / "parts" / "000001.parquet"
    content = bytearray(kept.read_bytes())
    first = {"head": 0, "middle": len(content) // 3, "end": len(content) - 40}[part]
    content[first : first + 40] = 40 * b"\x00"
    kept.write_bytes(content)
    swept = sweep.run(tmp_path / "parts", jobs=1)
    assert swept.computed_again == sweep.definition.chunk
    assert swept.table.equals(pq.read_table(folders / "whole" / "rows.parquet"))
    assert sweep.run(tmp_path / "parts", jobs=1).computed_again == 0


def test_interrupted_anywhere_it_goes_on_to_the_same_bytes(
    folders: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep = vary_x(folders / "short.yaml")
    computed: list[int] = []
    rollout = sweep_rows._rollout

    def until_told(definition: Any, index: int, *rest: Any) -> dict[str, Any]:
        if index in (0, 21, 59) and index not in stopped:
            stopped.add(index)
            raise KeyboardInterrupt
        computed.append(index)
        return rollout(definition, index, *rest)

    stopped: set[int] = set()
    monkeypatch.setattr(sweep_rows, "_rollout", until_told)
    for _ in range(3):
        with pytest.raises(KeyboardInterrupt):
            sweep.run(tmp_path / "parts", jobs=1)
    parts = tmp_path / "parts" / "parts"
    assert not (tmp_path / "parts" / "rows.parquet").exists()
    (parts / ".000003.parquet-killed").write_bytes(b"half")  # what a kill in the middle of a write leaves
    (parts / "000001.parquet").write_bytes((parts / "000001.parquet").read_bytes()[:100])
    sweep.run(tmp_path / "parts", jobs=1)
    assert sorted(set(computed)) == list(range(60))
    assert len(computed) < 60 + 3 * sweep.definition.chunk + sweep.definition.chunk
    bytes_of = [(one / "rows.parquet").read_bytes() for one in (folders / "whole", tmp_path / "parts")]
    assert bytes_of[0] == bytes_of[1]


#: A command line that is killed while it writes the third part.
KILLED = """
import os, signal
import pyarrow.parquet
from nmm.cli.exit_status import main
write, files = pyarrow.parquet.write_table, []
def write_and_end(table, file):
    write(table, file)
    files.append(file)
    if len(files) == 3:
        os.kill(os.getpid(), signal.SIGKILL)
pyarrow.parquet.write_table = write_and_end
main()
"""


@pytest.mark.parametrize(
    "other",
    [pytest.param("resolver.kind=rg,pg", marks=pytest.mark.thorough), "robot.arguments.d=0.2,0.4"],
)
def test_killed_and_started_again_nothing_is_lost_or_doubled(short: Path, tmp_path: Path, other: str) -> None:
    """Two threads, or processes where robots change; killed as by the system; then on to the end."""
    vary = ["--vary", "q0.x=-1:1", "--vary", other, "--samples", "40", "--set", "duration=0.4"]
    command = [sys.executable, "-c", KILLED, "sweep", str(short), *vary, "--out", "out", "--jobs", "2"]
    killed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=5 * MOST)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert len(list((tmp_path / "out").glob("parts/*.parquet"))) == 2
    key, values = other.split("=")
    sweep = nmm.Sweep(short, {"q0.x": (-1, 1), key: values}, samples=40, settings={"duration": 0.4})
    shares: list[float] = []
    table = sweep.run(tmp_path / "out", jobs=1, progress=shares.append).table
    assert shares[0] == pytest.approx(0.2)
    assert table["index"].to_pylist() == list(range(80))
    assert table.take([0, 33, 79]).to_pylist() == rows_of(sweep.definition, [0, 33, 79])


def test_kept_runs_are_run_folders(short: Path, tmp_path: Path) -> None:
    swept = vary_x(short, samples=2, keep="playback").run(tmp_path / "out", jobs=1)
    for row in swept.table.to_pylist():
        folder = tmp_path / "out" / "runs" / f"{row['index']:09d}"
        trajectory = nmm.Trajectory.load(folder)
        assert trajectory.q[0, 0] == row["q0.x"]
        assert trajectory.resolver == row["resolver.kind"]
        assert trajectory.summary()["error_rms"] == row["error_rms"]
        assert (folder / "playback.html").stat().st_size > 100_000
    assert "playback.html" in swept.page.read_text(encoding="utf-8")


def test_the_page_needs_nothing_from_outside(short: Path, tmp_path: Path) -> None:
    vary = {"resolver.kind": ["pg", "rg"], "resolver.threshold": [0.01, 0.02]}
    page = (
        nmm.Sweep(short, vary, title="</script> & co").run(tmp_path / "out", jobs=1).page.read_text("utf-8")
    )
    assert "default-src 'none'" in page
    assert "http://" not in page
    assert "https://" not in page
    assert "&lt;/script&gt; &amp; co" in page
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    by_name = {column["name"]: column for column in data["columns"]}
    assert data["shown"] == 4
    assert data["outcomes"] == {"refused": 2, "completed": 2}
    assert by_name["outcome"]["levels"] == ["completed", "refused"]
    assert by_name["outcome"]["codes"] == [1, 1, 0, 0]
    assert by_name["resolver.threshold"]["values"] == [0.01, 0.02] * 2
    assert by_name["error_rms"]["values"][0] is None


def test_a_page_of_many_rows_shows_whole_points(
    short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nmm.plugins.sweeps.result.MOST_ROWS", 20)
    page = vary_x(short).run(tmp_path / "out", jobs=1).page.read_text("utf-8")
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    (index,) = (column["values"] for column in data["columns"] if column["name"] == "index")
    assert index == [i for point in range(0, 30, 3) for i in (2 * point, 2 * point + 1)]
    assert "The page shows 20 of them" in page


# The command line


def test_the_command_says_how_many_ended_how(run: Command, short: Path) -> None:
    result = run(
        *("sweep", str(short), "--vary", "q0.x=-1:1", "--vary", "resolver.kind=rg,pg"),
        *(
            "--samples",
            "1e1",
            "--seed",
            "3",
            "--set",
            "objective={kind: quadratic, terms: [{of: q1, target: 1}]}",
            "--jobs",
            "1",
        ),
    )
    assert (result.status, result.err) == (0, "")
    assert result.value("files in") == "runs/short-sweep"
    assert result.value("completed").split() == ["20", "100.0%"]
    rg, pg = (result.value(kind).split() for kind in ("rg", "pg"))
    assert float(rg[-4].rstrip("%")) + float(pg[-4].rstrip("%")) == pytest.approx(100.0)


def test_a_sweep_may_be_a_file(run: Command, short: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(
        "scenario: short.yaml\nset: {duration: 0.02}\n"
        "vary: {q0.x: -1:1, resolver.kind: [rg, pg]}\nsamples: 2\n",
        encoding="utf-8",
    )
    result = run("sweep", "mine.yaml", "--samples", "3", "--vary", "resolver.kind=pg,rg", "--jobs", "1")
    assert (result.status, result.err) == (0, "")
    table = pq.read_table(tmp_path / "runs" / "mine-sweep" / "rows.parquet")
    assert table["resolver.kind"].to_pylist() == ["pg", "rg"] * 3
    assert set(table["t_end"].to_pylist()) == {0.02}


VARY = ("--vary", "q0.x=-1:1")
TWO = (*VARY, "--samples", "2")
#: What is wrong: the options, what the error is about, and what came.
WRONG: dict[str, tuple[tuple[str, ...], str, object]] = {
    "nothing varies": ((), "--vary", NOTHING),
    "no such key": (("--vary", "q0.z=0:1", "--samples", "2"), "set q0.z: robot unicycle_2r", "z"),
    "no such key in the file": (("--vary", "gain=0:1", "--samples", "2"), "short.yaml: set gain", "gain"),
    "no such argument": (("--vary", "robot.arguments.length=1,2"), "unicycle_2r.urdf.xacro", "length"),
    "no upper bound": (("--vary", "q0.x=-1:"), "vary q0.x", "-1:"),
    "no lower bound": (("--vary", "q0.x=:1"), "vary q0.x", ":1"),
    "no bounds": (("--vary", "q0.x="), "vary q0.x", ""),
    "one value": (("--vary", "q0.x=1"), "vary q0.x", "1"),
    "text in a range": (("--vary", "q0.x=left:right"), "vary q0.x", "left"),
    "text in a list": (("--vary", "dt=0.01,small"), "short.yaml: set dt", "small"),
    "bounds in the wrong order": (("--vary", "q0.x=1:-1"), "vary q0.x", "1:-1"),
    "a count of a half": (("--vary", "q0.x=0:1:2.5"), "vary q0.x", 2.5),
    "the same twice": ((*VARY, *TWO), "--vary", NOTHING),
    "a part of another": ((*TWO, "--vary", "q0={x: 1},{x: 2}"), "vary", NOTHING),
    "no samples": (VARY, "samples", NOTHING),
    "0 samples": ((*VARY, "--samples", "0"), "samples", 0),
    "half a sample": ((*VARY, "--samples", "0.5"), "samples", 0.5),
    "text for samples": ((*VARY, "--samples", "many"), "samples", "many"),
    "too many for Sobol": ((*VARY, "--samples", "2**31"), "samples", 2**31),
    "samples of a grid": (("--vary", "q0.x=0:1:3", "--samples", "3"), "samples", NOTHING),
    "a grid without counts": ((*VARY, "--sampler", "grid", "--samples", "9"), "vary q0.x", NOTHING),
    "nothing to sample": (("--vary", "dt=0.01,0.02", "--sampler", "lhs"), "sampler", NOTHING),
    "no such sampler": ((*TWO, "--sampler", "sobel"), "sampler", "sobel"),
    "a seed of text": ((*TWO, "--seed", "x"), "seed", "x"),
    "kept what": ((*TWO, "--keep", "all"), "keep", "all"),
    "no process": ((*TWO, "--jobs", "0"), "jobs", 0),
    "a folder of other things": ((*TWO, "--out", "other"), "other", NOTHING),
    "a folder in a file": ((*TWO, "--out", "short.yaml/x"), "short.yaml/x", NOTHING),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_bad_input_is_about_its_place(short: Path, monkeypatch: pytest.MonkeyPatch, wrong: str) -> None:
    monkeypatch.chdir(short.parent)
    (short.parent / "other").mkdir()
    (short.parent / "other" / "thesis.tex").touch()
    arguments, where, got = WRONG[wrong]
    with refused(where, got=got):
        app(args=["sweep", "short.yaml", *arguments], standalone_mode=False)
    assert sorted(path.name for path in short.parent.iterdir()) == ["other", "short.yaml"]


def test_bad_input_is_one_line(run: Command, short: Path, tmp_path: Path) -> None:
    for arguments in (("nowhere", *VARY), ("short.yaml",)):
        result = run("sweep", *arguments)
        assert (result.status, result.out, result.err.count("\n")) == (2, "", 1)
    assert [path.name for path in tmp_path.iterdir()] == ["short.yaml"]


def test_a_billion_samples_are_refused_with_numbers(run: Command, short: Path, tmp_path: Path) -> None:
    result = run("sweep", str(short), *VARY, "--samples", "10**9", "--set", "duration=5")
    assert result.status == 2
    assert result.err.startswith("nmm sweep: samples: 1000000000 rollouts of ")
    assert not (tmp_path / "runs").exists()


OTHERS: dict[str, tuple[tuple[str, ...], object]] = {
    "seed": (("--seed", "1"), 1),
    "samples": (("--samples", "3"), 3),
    "vary.q0.x.upper": (("--vary", "q0.x=-1:2"), 2.0),
    "vary.q0.y": (("--vary", "q0.y=0:1"), {"lower": 0.0, "upper": 1.0}),
    "keys.dt": (("--set", "dt=0.01"), 0.01),
    "keys.robot.arguments.d": (("--set", "robot.arguments.d=0.5"), "0.5"),
    "keep": (("--keep", "trajectories"), "trajectories"),
}


def test_a_folder_of_another_sweep_is_refused_by_name(
    short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = ["sweep", str(short), "--samples", "2", "--jobs", "1", "--out", "out"]
    monkeypatch.chdir(tmp_path)
    app(args=[*begun, *VARY], standalone_mode=False)
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    for place, (options, got) in OTHERS.items():
        first = () if place == "vary.q0.x.upper" else VARY
        with refused(f"out: {place}", got=got):
            app(args=[*begun, *first, *options], standalone_mode=False)
    monkeypatch.setattr("nmm.plugins.sweeps.sweep.__version__", "99.0")
    with refused("out: nmm", got="99.0"):
        app(args=[*begun, *VARY], standalone_mode=False)
    assert before == {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}


def test_two_at_once_in_a_folder_are_one(short: Path, tmp_path: Path) -> None:
    sweep = vary_x(short, samples=2)
    with (
        sweep_folder.SweepFolder(tmp_path / "out", sweep.definition).opened(),
        pytest.raises(nmm.InputError, match="another process is at this sweep"),
    ):
        sweep.run(tmp_path / "out", jobs=1)
    assert sweep.run(tmp_path / "out", jobs=1).outcomes == {"completed": 4}


def test_without_the_extra_it_says_what_to_install(
    run: Command, short: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ("sweep", str(short), *VARY, "--samples", "2")
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = run(*options, "--scheduler", "tcp://127.0.0.1:1")
    assert "needs distributed, which is not installed: pip install distributed" in result.err
    for name in [name for name in sys.modules if name.split(".")[0] == "pyarrow"]:
        monkeypatch.setitem(sys.modules, name, None)
    result = run(*options)
    assert (result.status, result.err.count("\n")) == (2, 1)
    assert "needs pyarrow, which is not installed: pip install pyarrow" in result.err


@pytest.mark.parametrize("name", bundled_sweeps())
def test_the_bundled_sweeps_run(name: str, tmp_path: Path) -> None:
    sweep = nmm.Sweep.load(name)
    assert sweep.definition.name == name
    assert sweep.definition.title
    brief = nmm.Sweep.load(
        name, samples=1, settings={**read_sweep(name).get("settings", {}), "duration": 0.1}
    )
    swept = brief.run(tmp_path / "out", jobs=1)
    assert set(swept.outcomes) <= {"completed", "missed"}


def test_the_examples_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """docs/sweeps.md: the Python, and the file."""
    text = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
    text, _, _ = text.partition("## Rollouts in Python")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    (said,) = re.findall(r"```yaml\n(.*?)```", text, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("nmm.plugins.sweeps.sweep.cores", lambda: 1)
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(code, names)
    assert names["H"].shape == (4, 2, 2)
    assert names["swept"].outcomes["completed"] > 0
    (tmp_path / "said.yaml").write_text(said, encoding="utf-8")
    definition = nmm.Sweep.load("said.yaml", samples=2).definition
    assert (definition.rows, definition.keep, definition.settings) == (4, "trajectories", {"dt": "0.01"})
    assert nmm.Sweep.load("said.yaml").definition.rows == 256
    columns = {column.name for column in columns_of(definition)} - {"index", "q0.x", "q0.theta"}
    told = text[text.index("| column | |") :].split("\n\n")[0]
    known = set(re.findall(r"`(\w+)`", told)) | {f"objective{end}" for end in re.findall(r"`(_\w+)`", told)}
    assert {name for name in columns if "." not in name} <= known
