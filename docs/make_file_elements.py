"""Write docs/file_elements.md from the tables of what is read: `python docs/make_file_elements.py`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from nmm.model.robots.loading.file_elements import READ, SRDF, URDF, ElementRule, How, Table
from nmm.model.robots.loading.mjcf_parts import ELEMENTS, EVERYWHERE

PAGE = Path(__file__).with_name("file_elements.md")
#: By the format's name, as the page has them.
TABLES: dict[str, Table] = {
    "URDF": URDF,
    "SRDF": SRDF,
    "MJCF": {
        "any element": ElementRule(READ, "", {name: How(how) for name, how in EVERYWHERE.items()}),
        **{
            path: ElementRule(row.how, row.why, {name: How(how) for name, how in row.attributes.items()})
            for path, row in ELEMENTS.items()
        },
    },
}

HEAD = """# What is read of a robot's file

Each element, and what becomes of it: *read*, *noted* (it does not count, and a note, in `nmm check` a
warning, says so, one of a kind, with its first line), or *without effect* here. What is not in a table is
noted as unknown, with the name that was probably meant. Elements that are alike share a row. Attributes
without a remark are read. Versions 1.0, 1.1 and 1.2 of URDF are read, others are refused.
"""


def page() -> str:
    """The page's text."""
    lines = (line for name, table in TABLES.items() for line in _section(name, table))
    return "\n".join([HEAD, *lines]).rstrip() + "\n"


def _section(name: str, table: Table) -> Iterator[str]:
    yield f"## {name}\n"
    yield "| element | | attributes |\n|---|---|---|"
    alike: dict[str, list[str]] = {}
    for path, part in table.items():
        cells = _what(part.how, part.why), "; ".join(_attributes(part))
        alike.setdefault(" | ".join(cells), []).append(path)
    for cells, paths in alike.items():
        yield f"| {', '.join(f'`{path}`' for path in paths)} | {cells} |"
    yield ""


def _attributes(part: ElementRule) -> Iterator[str]:
    groups: dict[How, list[str]] = {}
    for name, how in part.attributes.items():
        groups.setdefault(how, []).append(f"`{name}`")
    for how, names in groups.items():
        since = f" (from 1.{how.since} on)" if how.since else ""
        remark = "" if how.how == READ and not how.why else f": {_what(how.how, how.why)}"
        yield f"{', '.join(names)}{since}{remark}"


def _what(how: str, why: str) -> str:
    return re.sub(r"<\w+>", r"`\g<0>`", f"{how}: {why}" if why else how)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
