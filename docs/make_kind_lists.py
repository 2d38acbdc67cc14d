"""Write what follows from nmm/base/kinds.py: `python docs/make_kind_lists.py`.

A class that is registered there gets its line in nmm/__init__.pyi, which makes it `nmm.Name`, its entry on
the page of docs/api about such classes, and its section in docs/scenarios.md. docs/api/index.md lists the
names of each page anew. What stands there already stays where it is.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from nmm.base.kinds import LIMITS, OBJECTIVES, PLATFORMS, REFERENCES, RESOLVERS, TASKS, Kinds

ROOT = Path(__file__).resolve().parent.parent
STUB = ROOT / "nmm" / "__init__.pyi"
API = ROOT / "docs" / "api"
INDEX = API / "index.md"
#: The page of docs/api on which the classes of a list stand.
PAGES: list[tuple[str, Kinds]] = [
    ("robot.md", PLATFORMS),
    ("task.md", TASKS),
    ("reference.md", REFERENCES),
    ("objective.md", OBJECTIVES),
    ("resolver.md", RESOLVERS),
    ("limit.md", LIMITS),
]
_IMPORT = re.compile(r"from (?P<module>\S+) import (?P<name>\w+) as \w+\n")
_ENTRY = re.compile(r"\.\. auto\w+:: nmm\.(?:\w+\.)*(?P<name>\w+)\n")


def stub(text: str) -> str:
    """The text of nmm/__init__.pyi with a line for each registered class, in the order that ruff asks for."""
    found = {(line["module"], line["name"]) for line in _IMPORT.finditer(text)}
    public = {name for _, name in found}
    for _, listed in PAGES:
        for kind in listed.values():
            if kind.__name__ not in public:
                found.add((kind.__module__.removeprefix("nmm"), kind.__name__))
    lines = sorted(found, key=lambda line: (line[0], line[1].islower(), line[1].lower()))
    rest = _IMPORT.sub("", text)
    return "".join(f"from {module} import {name} as {name}\n" for module, name in lines) + rest


def reference(text: str, listed: Kinds) -> str:
    """A page of docs/api with an entry for each class of the list; new ones stand after the last of them."""
    names = [kind.__name__ for kind in listed.values()]
    entries = [entry for entry in _ENTRY.finditer(text) if entry["name"] in names]
    there = {entry["name"] for entry in entries}
    end = entries[-1].end()
    new = "".join(f".. autoclass:: nmm.{name}\n" for name in names if name not in there)
    return text[:end] + new + text[end:]


def index(text: str) -> str:
    """The text of docs/api/index.md, with the names of each page in the page's order."""

    def line(found: re.Match[str]) -> str:
        page = (API / found["page"]).read_text(encoding="utf-8")
        return found["title"] + ", ".join(f"`{entry['name']}`" for entry in _ENTRY.finditer(page))

    return re.sub(r"^(?P<title>- \[.+\]\((?P<page>\w+\.md)\): ).*$", line, text, flags=re.MULTILINE)


def rewrite() -> None:
    """Bring the files up to date, those that others are made of first."""
    sys.path.insert(0, str(Path(__file__).parent))
    import make_scenario_keys

    STUB.write_text(stub(STUB.read_text(encoding="utf-8")), encoding="utf-8")
    for name, listed in PAGES:
        page = API / name
        page.write_text(reference(page.read_text(encoding="utf-8"), listed), encoding="utf-8")
    INDEX.write_text(index(INDEX.read_text(encoding="utf-8")), encoding="utf-8")
    make_scenario_keys.PAGE.write_text(make_scenario_keys.page(), encoding="utf-8")


if __name__ == "__main__":
    rewrite()
