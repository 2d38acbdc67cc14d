"""Tables for papers: the CSV is the summary, the LaTeX and the Markdown say the same and can be read."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_line import Result
from findings import refused
from typeset import check_text

import nmm
from nmm.analysis.null_space import repeatability
from nmm.base import latex
from nmm.cli.exit_status import status_of
from nmm.motion.verdict import Verdict
from nmm.views.tables import Quantity, Table, comparison_table, laps_table

Command = Callable[..., Result]
SHORT = ("--set", "duration=0.5")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run nmm in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: Result(status_of([*arguments]), *capfd.readouterr())


def tabular(text: str) -> list[list[str]]:
    """The cells of a LaTeX table: a reader that knows of braces, escapes, rows and cells alone."""
    lines = [line for line in text.splitlines() if not line.startswith("%")]
    begin = re.fullmatch(r"\\begin\{tabular\}\{@\{\}l(r+)@\{\}\}", lines[0])
    assert begin is not None
    assert lines[-1] == r"\end{tabular}"
    rules = [line.strip() for line in lines if line.strip().endswith("rule")]
    assert rules == [r"\toprule", r"\midrule", r"\bottomrule"]
    rows = []
    for line in lines[1:-1]:
        if line.strip() in rules:
            continue
        assert line.endswith(r" \\")
        rows.append([cell.strip() for cell in re.split(r"(?<!\\)&", line.removesuffix(r"\\"))])
        assert len(rows[-1]) == 1 + len(begin[1])
        for cell in rows[-1]:
            check_text(cell)
    return rows


def value_of(cell: str) -> float | None:
    """A number of a LaTeX cell."""
    if cell == "--":
        return None
    found = re.fullmatch(r"\$(-?[\d.]+)(?: \\times 10\^\{(-?\d+)\})?\$", cell)
    assert found is not None, cell
    return float(found[1]) * 10.0 ** int(found[2] or 0)


def in_summary(summary: dict[str, Any], key: str) -> Any:
    for name in key.split("."):
        summary = summary[name]
    return summary


def test_the_csv_of_a_comparison_is_its_summary(run: Command, tmp_path: Path) -> None:
    result = run("compare", "unicycle_2r_position", *SHORT, "--out", "out", "--table", "csv")
    assert (result.status, result.err) == (0, "files in  out\n")
    runs = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["runs"]
    head, *lines = csv.reader(io.StringIO(result.out))
    assert [line[0] for line in lines] == ["RG", "PG"]
    names = {re.sub(r" \[.*\]$", "", name) for name in head[1:]}
    assert {"error_rms", "input_peak", "u_max.v", "u_max.q2", "objective_integral", "sigma_min"} <= names
    units = dict(re.findall(r"^([\w.]+) \[(.*)\]$", name)[0] for name in head[1:] if "[" in name)
    assert (units["u_max.v"], units["error_rms"], units["input_rms"]) == ("m/s", "m", "m/s, rad/s")
    for summary, line in zip(runs.values(), lines, strict=True):
        for name, cell in zip(head[1:], line[1:], strict=True):
            key = re.sub(r" \[.*\]$", "", name)
            if cell:
                assert float(cell) == in_summary(summary, key)
            else:
                assert (key, summary["resolver"]) == ("partition_switches", "pg") or summary[key] is None


def test_latex_and_markdown_say_what_the_csv_says(run: Command) -> None:
    """But for what happened in no run: RG never switched here."""
    command = ("compare", "unicycle_2r_position", *SHORT, "--resolvers", "rg,rg:alpha=5", "--out", "out")
    head, *lines = csv.reader(io.StringIO(run(*command, "--table", "csv").out))
    k = head.index("partition_switches")
    assert {line.pop(k) for line in lines} == {"0"}
    assert head.pop(k) == "partition_switches"
    written = tabular(run(*command, "--table", "latex").out)
    assert written[0] == ["", "RG", r"RG $\alpha$=5"]
    marked = run(*command, "--table", "markdown").out.splitlines()
    assert marked[:2] == ["|  | RG | RG α=5 |", "| --- | ---: | ---: |"]
    assert len(written) == len(marked) - 1 == len(head)
    for column, (cells, line) in enumerate(zip(written[1:], marked[2:], strict=True), 1):
        unit = re.search(r"\[(.*)\]", head[column])
        if unit:
            assert f"({unit[1]})" in cells[0]
            assert f"({unit[1]})" in line
        assert len(re.split(r"(?<!\\)\|", line)) == 5
        for cell, told in zip(cells[1:], (line[column] for line in lines), strict=True):
            assert value_of(cell) == (pytest.approx(float(told), rel=5e-3) if told else None)


def test_a_run_that_failed_is_told_beside_the_table(run: Command) -> None:
    command = ("compare", "unicycle_2r_position", "--resolvers", "pg", "--set", "dt=1.5", "--out", "out")
    result = run(*command, "--set", "method=euler", "--table", "csv")
    assert result.status == 1
    assert result.out.startswith("run,outcome,")
    assert "nmm compare: PG" in result.err


def test_the_terminals_table_is_there_without_it(run: Command) -> None:
    result = run("compare", "unicycle_2r_position", *SHORT, "--out", "out")
    assert "tracking ‖e‖" in result.out
    wrong = run("compare", "unicycle_2r_position", "--table", "html", "--out", "other")
    assert (wrong.status, wrong.out) == (2, "")
    assert "--table: expected latex, csv or markdown, got 'html'" in wrong.err


def test_runs_that_fail_and_that_have_limits() -> None:
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5})
    plain, limited = scenario.run(), scenario.override("limits", True).run()
    keys = [one.key for one in comparison_table([plain]).quantities]
    assert not {"outcome", "scale_min", "clearance_min", "sliding_max"} & set(keys)
    both = {one.key: one for one in comparison_table([plain, replace(limited, label="a_b & c")]).quantities}
    assert both["scale_min"].values == (None, limited.summary()["scale_min"])
    failed = replace(plain, verdict=Verdict(nmm.Outcome.SINGULAR), label="J_e & [50 %]")
    rows = tabular(comparison_table([plain, failed]).latex())
    assert rows[0] == ["", "RG", r"J\_e \& {[}50 \%{]}"]
    assert rows[1] == ["outcome", "completed", "singular"]
    with refused("comparison_table"):
        comparison_table([])


def test_laps_stand_in_one_table(run: Command, tmp_path: Path) -> None:
    scenario = nmm.Scenario.load("unicycle_2r_position")
    found = repeatability(scenario, laps=2, dt=0.05)
    table = laps_table(found)
    head, *lines = csv.reader(io.StringIO(table.csv()))
    assert head[:4] == ["run", "distance.1 [m, rad]", "displacement.1 [m]", "errors.1 [m]"]
    for one, line in zip(found.laps, lines, strict=True):
        expected = [x for k in range(2) for x in (one.distance[k], one.displacement[k], one.errors[k + 1])]
        assert [float(cell) for cell in line[1:]] == expected
    assert len(tabular(table.latex())) == 1 + 2 * 3
    assert laps_table(repeatability(scenario, laps=3, dt=0.05)).quantities[-1].key == "factor"
    result = run("laps", "unicycle_2r_position", "--laps", "2", "--set", "dt=0.05", "--table", "latex")
    assert result.status == 0
    assert result.out == table.latex()
    assert (tmp_path / "runs" / "unicycle_2r_position-laps" / "laps.csv").exists()


def test_files_by_their_suffix(tmp_path: Path) -> None:
    table = Table(("a|b",), (Quantity("k", "k*", "$k$", "m^2", (math.nan,)),))
    assert table.save(tmp_path / "t.tex").read_text() == table.latex()
    assert table.save(tmp_path / "t.csv").read_text() == "run,k [m^2]\na|b,nan\n"
    assert r"| k\* (m^2) | – |" in table.save(tmp_path / "t.md").read_text(encoding="utf-8")
    assert tabular(table.latex())[1] == ["$k$ (m$^{2}$)", "--"]
    with refused("t.pdf"):
        table.save(tmp_path / "t.pdf")
    with refused("t.csv"):
        table.save(tmp_path / "no" / "t.csv")


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, "--"), (math.nan, "--"), (-math.inf, r"$-\infty$"), (0.0, "$0$"), (-0.5, "$-0.500$"),
        (1234.0, r"$1.23 \times 10^{3}$"), (-2.07e-29, r"$-2.07 \times 10^{-29}$"),
    ],
)  # fmt: skip
def test_numbers_as_latex_writes_them(value: float | None, expected: str) -> None:
    assert latex.number(value) == expected


def test_every_printable_character_is_escaped() -> None:
    for code in (*range(0x20, 0x7F), *range(0x391, 0x3CA), 0x2016, 0xB7, 0xD7, 0xB0):
        check_text(latex.escaped(f"a{chr(code)}b"))
    assert latex.escaped("λ Λ Η\n") == r"$\lambda$ $\Lambda$ $H$ \textbackslash{}n".replace(
        " \\text", "\\text"
    )
    assert latex.escaped("a_b{c}\\~^") == r"a\_b\{c\}\textbackslash{}\textasciitilde{}\textasciicircum{}"
