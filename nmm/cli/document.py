"""What an analysis shows, as items: tables, findings and lines, which a terminal or JSON gets alike."""

import json
from collections.abc import Iterable, Iterator, Sequence
from textwrap import fill
from typing import Any, NamedTuple

from nmm.base.arrays import finite
from nmm.base.findings import Finding
from nmm.base.findings.singularities import number_text
from nmm.cli.output import console, show_table, show_text

#: A number this small beside the largest of its kind is a zero that was rounded.
ZERO = 1e-10


class DocumentTable(NamedTuple):
    """Columns in `numeric` are right-aligned; a `wide` table is transposed or split on a narrow terminal."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[str] = ()
    wide: bool = False


#: A line; "" is an empty one.
Item = DocumentTable | Finding | str


def show(items: Iterable[Item]) -> None:
    for item in items:
        if not isinstance(item, DocumentTable):
            say(str(item))
        elif item.wide:
            _show_wide(item)
        else:
            show_table(item.columns, item.rows, numeric=item.numeric)


def print_json(data: dict[str, Any], items: Iterable[Item]) -> None:
    """Print the data, a key a line, and the findings among the items, with codes, values and words."""
    found = [item.as_json() for item in items if isinstance(item, Finding)]
    data = finite({**data, "findings": found})
    lines = [f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in data.items()]
    print("{\n" + ",\n".join(lines) + "\n}")


def fields(found: object, names: str) -> dict[str, Any]:
    return {name: getattr(found, name) for name in names.split()}


def say(text: str = "") -> None:
    """Print a line; one that is too long for a terminal goes on below itself, two columns in."""
    out = console()
    if out.is_terminal and len(text) > out.width:
        indent = " " * (len(text) - len(text.lstrip()) + 2)
        text = fill(text, out.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    show_text(text)


def rounded(value: float, largest: float) -> float:
    """The value; 0 for what is rounding beside `largest`."""
    return 0.0 if abs(value) <= ZERO * largest else float(value)


def number(value: float, largest: float = 0.0) -> str:
    return number_text(rounded(value, largest))


def _show_wide(table: DocumentTable) -> None:
    """The table, or its transpose where that is narrower and it is too wide; in blocks where both are."""
    lines = [table.columns, *table.rows]
    columns: list[Sequence[str]] = list(zip(*lines, strict=True))
    if sum(map(_width, columns)) > console().width:
        turned: list[Sequence[str]] = [(f"{table.columns[0]}ᵀ", *table.columns[1:]), *table.rows]
        columns = min(columns, turned, key=lambda one: sum(map(_width, one)))
    for some in _blocks(columns):
        names, *rows = zip(*some, strict=True)
        show_table(names, rows, numeric=names[1:])


def _width(column: Sequence[str]) -> int:
    return max(map(len, column)) + 2


def _blocks(columns: Sequence[Sequence[str]]) -> Iterator[list[Sequence[str]]]:
    """Columns that fit beside the first one, with it."""
    first, *rest = columns
    room = console().width - _width(first)
    block: list[Sequence[str]] = []
    for column in rest:
        if block and sum(map(_width, block)) + _width(column) > room:
            yield [first, *block]
            block = []
        block.append(column)
    yield [first, *block]
