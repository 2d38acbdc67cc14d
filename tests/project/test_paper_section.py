"""What papers take: a section redone from one file, figures of a stated width, and how to cite."""

from __future__ import annotations

import csv
import json
import re
import runpy
import subprocess
import sys
import tomllib
import zlib
from pathlib import Path
from typing import Any

import pytest
import yaml
from places import ROOT

import nmm
from nmm import figures
from nmm.views.figures import FigureOptions

SECTION = ROOT / "docs" / "paper_section"


def section(*arguments: str | Path) -> int:
    """The exit status of the script, run in this process."""
    status: int = runpy.run_path(str(SECTION / "section.py"))["main"]([*map(str, arguments)])
    return status


def width_of(pdf: Path) -> float:
    """Of a PDF's only page, in."""
    (box,) = re.findall(rb"/MediaBox \[ ([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) \]", pdf.read_bytes())
    return (float(box[2]) - float(box[0])) / 72.0


def check_fonts(pdf: Path) -> None:
    """Every font that text is set in is there whole, as TrueType."""
    content = pdf.read_bytes()
    described = len(re.findall(rb"/Type /FontDescriptor", content))
    assert described == len(re.findall(rb"/FontFile2 \d+ 0 R", content)) > 0
    assert b"/Type3" not in content
    files = [int(number) for number in re.findall(rb"/FontFile2 (\d+) 0 R", content)]
    for number in files:
        found = re.search(rb"\n%d 0 obj\n.*?stream\r?\n(.*?)\r?\nendstream" % number, content, re.DOTALL)
        assert found is not None
        assert zlib.decompress(found[1])[:4] == b"\x00\x01\x00\x00"  # how a TrueType file begins


def test_a_section_from_its_file(tmp_path: Path) -> None:
    """The page's own file; a second time everything is the same to the last byte."""
    once, again = tmp_path / "once", tmp_path / "again"
    command = [sys.executable, str(SECTION / "section.py"), str(SECTION / "section.yaml"), str(once)]
    made = subprocess.run(command, capture_output=True, text=True)
    assert (made.returncode, made.stdout, made.stderr) == (0, "", "")
    assert section(SECTION / "section.yaml", again) == 0
    stated = yaml.safe_load((once / "section.yaml").read_text(encoding="utf-8"))
    written = {path.name for path in once.iterdir()}
    assert written == {*stated["tables"], *stated["figures"], "runs", "section.yaml"}
    for name in [*stated["tables"], *stated["figures"]]:
        assert (once / name).read_bytes() == (again / name).read_bytes()
    for name in stated["figures"]:
        assert width_of(once / name) == pytest.approx(3.5, abs=1e-3)
        check_fonts(once / name)
    with (once / "comparison.csv").open(encoding="utf-8", newline="") as file:
        head, *lines = csv.reader(file)
    assert [line[0] for line in lines] == ["RG", "PG", "PG α=50"]
    for name, line in zip(stated["runs"], lines, strict=True):
        summary = json.loads((once / "runs" / name / "summary.json").read_text(encoding="utf-8"))
        assert float(line[head.index("objective_final")]) == summary["objective_final"]
    first = nmm.Scenario.load("unicycle_2r_position", {"resolver.kind": "pg", "resolver.alpha": 50}).run()
    assert float(lines[2][head.index("input_peak [m/s, rad/s]")]) == first.summary()["input_peak"]


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ("runs: {a: {scenario: nothing}}", "unknown"),
        ("runs: {a: {resolver: rg}}", "a: expected a scenario"),
        ("runs: {a: {scenario: b, speed: 2}}", "a: expected scenario, resolver, set, label, got 'speed'"),
        ("plots: {}", "the file: expected runs, tables, figures, got 'plots'"),
        ("tables: {t.tex: [b]}", "t.tex: expected runs among , got 'b'"),
        ("figures: {f.pdf: {draw: save}}", "f.pdf: draw: expected a drawing of nmm.figures, got 'save'"),
        ("figures: {f.pdf: {draw: errors, of: x}}", "f.pdf: expected runs among , got 'x'"),
        ("[1, 2", "expected"),
    ],
)
def test_a_section_that_cannot_be(
    stated: str, expected: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(stated, encoding="utf-8")
    assert section(file, tmp_path / "out") == 2
    told = capfd.readouterr().err
    assert expected in told
    assert told.count("\n") == 1


def test_a_run_that_fails_is_told(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "singular.yaml"
    unstable = {"scenario": "unicycle_2r_position", "set": {"dt": 1.5, "method": "euler"}}
    file.write_text(yaml.safe_dump({"runs": {"a": unstable}, "tables": {"t.csv": ["a"]}}), encoding="utf-8")
    assert section(file, tmp_path / "out") == 1
    assert capfd.readouterr().err.startswith("a: ")
    assert (tmp_path / "out" / "t.csv").read_text().startswith("run,outcome,")


@pytest.mark.parametrize(("width", "inches"), [("column", 3.5), (4.25, 4.25)])
def test_pdfs_are_as_wide_as_asked(width: Any, inches: float, tmp_path: Path) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 1}).run()
    run.save(tmp_path / "run", figures=FigureOptions(("pdf",), width), ellipsoids=True)
    compared = figures.comparison([run, run], width=inches)
    figures.save(compared, tmp_path / "run" / "comparison.pdf")
    files = sorted((tmp_path / "run").glob("*.pdf"))
    assert len(files) > 4
    for file in files:
        assert width_of(file) == pytest.approx(inches, abs=1e-3), file.name
        check_fonts(file)


def test_how_to_cite() -> None:
    """By the keys of Citation File Format 1.2.0 that it uses, with pyproject's facts."""
    said = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    text = {"cff-version", "message", "title", "abstract", "type", "version", "license"}
    assert set(said) == text | {"date-released", "authors", "keywords", "references"}
    assert all(isinstance(said[key], str) and said[key] for key in text)
    assert (said["cff-version"], said["type"]) == ("1.2.0", "software")
    assert said["version"] == nmm.__version__
    newest = re.search(
        r"^## \[(\d.*)\] - (.*)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert newest is not None
    assert newest.groups() == (nmm.__version__, str(said["date-released"]))
    bibtex = (ROOT / "docs" / "papers.md").read_text(encoding="utf-8")
    assert f"version = {{{nmm.__version__}}}" in bibtex
    for key, theirs in (("title", "name"), ("abstract", "description"), ("license", "license")):
        assert said[key] == project[theirs]
    assert said["authors"] == project["authors"]
    assert said["keywords"] == project["keywords"]
    (paper,) = said["references"]
    number = {"year", "month", "start", "end"}
    assert set(paper) == {"type", "title", "authors", "collection-title", "conference"} | number
    assert (paper["type"], paper["year"]) == ("conference-paper", 2006)
    assert f"pages     = {{{paper['start']}--{paper['end']}}}" in bibtex
    assert paper["title"].replace(" ", "") in (ROOT / "README.md").read_text(encoding="utf-8").replace(
        "\n", ""
    ).replace(" ", "")
    assert all(set(author) == {"family-names", "given-names"} for author in paper["authors"])
    assert set(paper["conference"]) == {"name", "city", "region", "country"}


def test_the_python_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "papers.md").read_text(), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    assert " & RG & PG, as published " in (tmp_path / "comparison.tex").read_text(encoding="utf-8")


def test_the_script_needs_the_public_names_alone() -> None:
    """A user copies it: it imports nmm and nothing inside."""
    imported = re.findall(r"^(?:from|import) (nmm\S*)", (SECTION / "section.py").read_text(), re.MULTILINE)
    assert imported == ["nmm", "nmm"]
