"""The site: it builds without a warning, no link is broken, and no page asks for anything outside."""

from __future__ import annotations

import json
import re
import shutil
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest
from site_pages import ROOT, Asked, built


@cache
def asked(page: Path) -> Asked:
    return Asked(page.read_text(encoding="utf-8"))


def broken(site: Path, page: Path, link: str) -> bool:
    """Whether a link of a page leads nowhere within the site."""
    place, anchor = urldefrag(link)
    place = place.partition("?")[0]
    target = (page.parent / unquote(place)).resolve() if place else page
    if not target.is_file() or not target.is_relative_to(site):
        return True
    if "=" in anchor:  # a setting of a playback page (docs/command_line.md), no place in it
        return False
    return bool(anchor) and target.suffix == ".html" and unquote(anchor) not in asked(target).ids


def test_every_link_leads_somewhere(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 30
    assert broken(site, site / "index.html", "index.html#no-such-place")
    assert broken(site, site / "index.html", "no_such_page.html")
    wrong = [
        f"{page.relative_to(site)}: {link}"
        for page in pages
        for link in [*asked(page).links, *asked(page).fetched]
        if not re.match(r"\w+:", link) and broken(site, page, link)
    ]
    assert wrong == []


def test_pages_ask_for_nothing_outside(site: Path) -> None:
    for page in site.rglob("*.html"):
        outside = [one for one in asked(page).fetched if re.match(r"(\w+:)?//", one)]
        assert outside == [], page
    for style in site.rglob("*.css"):
        text = style.read_text(encoding="utf-8")
        assert not re.search(r"@import|url\(\s*['\"]?(https?:)?//", text), style


def test_formulas_are_drawn_with_nothing_to_load(site: Path) -> None:
    pytest.importorskip("latex2mathml")
    for written in (ROOT / "docs").glob("*.md"):
        page = (site / f"{written.stem}.html").read_text(encoding="utf-8")
        formulas = re.findall(r"<math .*?</math>", page, flags=re.DOTALL)
        assert len(formulas) == written.read_text(encoding="utf-8").count("```math\n"), written
        assert [one for one in formulas if re.search(r"\\\w", one)] == [], "a command that is not LaTeX's"


def test_every_page_of_the_docs_is_in_the_site(site: Path) -> None:
    """And can be reached from the first: Sphinx warns of a page that no contents list."""
    written = {path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")}
    assert {site / path.with_suffix(".html") for path in written} <= {*site.rglob("*.html")}


def test_signatures_lead_to_the_public_names(site: Path) -> None:
    """A type of a signature is a name of a private file; its link is that of the public name."""
    page = (site / "api" / "run.html").read_text(encoding="utf-8")
    assert re.search(r'href="controller\.html#nmm\.Controller"[^>]*><span class="pre">Controller<', page)
    assert 'id="nmm.Trajectory.save"' in page


def test_types_are_told_by_their_names(site: Path) -> None:
    """Not by objects of Sphinx's, nor as text that it could not read."""
    for page in (site / "api").glob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"TypeAliasForwardRef|~nmm\.|&lt;factory&gt;", text), page.name


@pytest.mark.parametrize("made", [True, False])
def test_tutorials_and_notebooks_are_in_the_site_when_they_are_there(tmp_path: Path, made: bool) -> None:
    """With the page that a frame shows; without it the frame is left out."""
    docs = tmp_path / "docs"
    shutil.copytree(
        ROOT / "docs" / "building", docs / "building", ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copy(ROOT / "docs" / "conf.py", docs)
    index = "# Docs\n\n```{toctree}\n:glob:\n\ntutorials/*\n```\n\n```{toctree}\n:glob:\n\nlab/*\n```\n"
    (docs / "index.md").write_text(index, encoding="utf-8")
    (docs / "tutorials").mkdir()
    (docs / "tutorials" / "first.md").write_text(
        '# First\n\n<iframe src="first/run/playback.html#t=2" title="A run"></iframe>\n', encoding="utf-8"
    )
    if made:
        (docs / "tutorials" / "first" / "run").mkdir(parents=True)
        (docs / "tutorials" / "first" / "run" / "playback.html").write_text("<p>here</p>", encoding="utf-8")
        cells = [
            {"cell_type": "markdown", "source": ["# Lab\n", "\n", "See [first](../tutorials/first.md)."]},
            {"cell_type": "code", "source": ["print(1 + 1)"], "outputs": [{"text": ["2\n"]}]},
        ]
        (docs / "lab").mkdir()
        (docs / "lab" / "one.ipynb").write_text(json.dumps({"cells": cells}), encoding="utf-8")
    site = built(tmp_path, docs)
    page = (site / "tutorials" / "first.html").read_text(encoding="utf-8")
    assert ("<iframe" in page) is made
    assert (site / "tutorials" / "first" / "run" / "playback.html").exists() is made
    assert (site / "lab" / "one.html").exists() is made
    if made:
        lab = asked(site / "lab" / "one.html")
        assert "../tutorials/first.html" in lab.links
        assert any(link.endswith("/one.ipynb") for link in lab.links)
