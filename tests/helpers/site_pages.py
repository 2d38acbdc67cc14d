"""The site, built for the tests as the gate builds it, and what its pages ask for."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from places import ROOT


def built(folder: Path, docs: Path = ROOT / "docs") -> Path:
    """The site's folder; a warning is an error."""
    if importlib.util.find_spec("sphinx") is None:
        pytest.skip("Sphinx is not here: pip install '.[docs]'")
    options = ["-W", "--keep-going", "-q", "-b", "html", "-d", str(folder / "doctrees")]
    command = [sys.executable, "-P", "-m", "sphinx", *options, str(docs), str(folder / "html")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr[-5000:]
    return folder / "html"


class Asked(HTMLParser):
    """A page's ids, where its links lead, and what the browser fetches without being asked."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.ids |= {value for key in ("id", "name") if (value := given.get(key))}
        if tag == "a":
            self.links += [given["href"]] if given.get("href") else []
        elif tag == "link" and given.get("rel") in ("index", "search", "next", "prev", "author"):
            self.links.append(given["href"] or "")
        else:
            self.fetched += [value for key in ("src", "href", "data") if (value := given.get(key))]
