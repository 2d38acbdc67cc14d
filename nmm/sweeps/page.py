"""The page of a sweep: one file, offline, with the rows in it."""

from __future__ import annotations

import json
import math
from typing import Any

from nmm.sweeps.columns import Column, columns_of
from nmm.sweeps.definition import Definition
from nmm.sweeps.swept import Swept
from nmm.templates import template
from nmm.words import listed
from nmm.writing import whole_file

#: The most rollouts of a page; of more, points at equal distances are shown, each with all combinations.
MOST_ROWS = 10_000
#: Digits of what is measured; what varies has all of them, so that the commands give the same rollouts.
DIGITS = 7
SCRIPTS = ("data.js", "colours.js", "points.js", "parallel.js", "table.js", "start.js")


def write_page(swept: Swept) -> None:
    """Write index.html, whole or not at all: maps, fronts, parallel coordinates and a table that filters."""
    definition = swept.definition
    data = _data(swept)
    text = template("nmm.sweeps", "web", "page.html").render(
        name=definition.name,
        title=definition.title,
        about=_about(definition),
        version=definition.version,
        rows=definition.rows,
        shown=data["shown"],
        scripts=SCRIPTS,
        # nothing in a message may end the script that holds it
        data=json.dumps(data, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c"),
    )
    with whole_file(swept.page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _about(definition: Definition) -> str:
    """What was swept, in a sentence."""
    text = f"{definition.rows} rollouts of {definition.scenario}: "
    parts = []
    if definition.ranges:
        keys = [f"{one.key} from {one.lower:.4g} to {one.upper:.4g}" for one in definition.ranges]
        how = f"{definition.samples} points ({definition.sampler}, seed {definition.seed})"
        parts.append(f"{how} of {listed(keys)}")
    parts += [
        f"{one.key} {listed([f'{value}' for value in one.told], 'or')}"
        if len(one.told) <= 6
        else f"{len(one.told)} values of {one.key}, from {one.told[0]} to {one.told[-1]}"
        for one in definition.listed
    ]
    return text + "; ".join(parts) + "."


def _data(swept: Swept) -> dict[str, Any]:
    definition, table = swept.definition, swept.table
    count = definition.combinations
    every = math.ceil(definition.rows / MOST_ROWS)
    # Whole points where there are any left; of a grid larger than the page simply every so many rows.
    points = definition.samples > every
    rows = [i for i in range(definition.rows) if (i // count if points else i) % every == 0]
    shown = table.take(rows)
    listed_keys, varied = {one.key for one in definition.listed}, {one.key for one in definition.vary}
    return {
        "shown": len(rows),
        "command": definition.command(0)[: 3 + 2 * len(definition.settings)],
        "combinations": count if points else 1,
        "keep": definition.keep,
        "outcomes": swept.outcomes,
        "columns": [
            {
                **column._asdict(),
                "varied": column.name in varied,
                "listed": column.name in listed_keys,
                **_cells(column, shown[column.name].to_pylist(), exact=column.name in varied),
            }
            for column in columns_of(definition)
        ],
    }


def _cells(column: Column, values: list[Any], *, exact: bool) -> dict[str, Any]:
    """A column's values, once where they are all the same, and text as numbers of its levels."""
    if column.kind == "number":
        values = [_number(value, exact=exact) for value in values]
    if all(value == values[0] for value in values):
        return {"same": values[0]}
    if column.kind != "text":
        return {"values": values}
    levels = sorted({value for value in values if value is not None})
    codes = {level: k for k, level in enumerate(levels)}
    return {"levels": levels, "codes": [codes.get(value, -1) for value in values]}


def _number(value: float | None, *, exact: bool) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return value if exact else float(f"{value:.{DIGITS}g}")
