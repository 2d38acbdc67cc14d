"""The site: it builds without a warning, no link is broken, and no page asks for anything outside."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest
from site_pages import ROOT, Asked, built


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("site"))


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


def test_every_page_of_the_docs_is_in_the_site(site: Path) -> None:
    """And can be reached from the first: Sphinx warns of a page that no contents list."""
    written = {path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")}
    assert {site / path.with_suffix(".html") for path in written} <= {*site.rglob("*.html")}


def test_signatures_lead_to_the_public_names(site: Path) -> None:
    """A type of a signature is a name of a private file; its link is that of the public name."""
    page = (site / "api" / "run.html").read_text(encoding="utf-8")
    assert re.search(r'href="controller\.html#nmm\.Controller"[^>]*><span class="pre">Controller<', page)
    assert 'id="nmm.Trajectory.save"' in page
