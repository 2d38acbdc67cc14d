"""`SweepResult`: a finished sweep, a summary of its quantities, and its page with the rows."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array, finite
from nmm.base.files import whole_file
from nmm.base.resolver_style import resolver_styles
from nmm.base.templates import template
from nmm.base.text_format import listed
from nmm.plugins.sweeps.definition import Definition
from nmm.plugins.sweeps.rows import Column, columns_of, parquet

#: Quantities of all rollouts.
QUANTITIES = (
    "error_rms", "error_final", "arrival", "objective_integral", "scale_min", "sigma_min", "margin_min",
    "clearance_min", "effort",
)  # fmt: skip
#: Values closer than this share of their size count as equal.
ALIKE = 1e-4
#: Combinations of listed values compared in a table at most.
MOST_COMPARED = 24

#: Rollouts of a page at most: of more, evenly spaced points, each with all combinations.
MOST_ROWS = 10_000
#: Digits of measured values; varied ones have all, so that the commands repeat the rollouts.
DIGITS = 7
SCRIPTS = ("data.js", "colours.js", "points.js", "parallel.js", "table.js", "start.js")


@dataclass(frozen=True)
class SweepResult:
    """A sweep that was run.

    Attributes
    ----------
    folder : where it is
    definition : what it is
    computed_again : how many rows were there, in files that are damaged

    Examples
    --------
    >>> sweep = nmm.Sweep("unicycle_2r_position", {"q0.x": (-2, 0)}, samples=4, settings={"duration": 2})
    >>> swept = sweep.run("runs/starts", jobs=1)
    >>> len(swept.table["error_final"]), swept.page.name
    (4, 'index.html')
    """

    folder: Path
    definition: Definition
    computed_again: int = 0

    @cached_property
    def table(self) -> Any:
        """A `pyarrow.Table`, one row a rollout (`.to_pandas()` where pandas is installed)."""
        return parquet().read_table(self.folder / "rows.parquet", partitioning=None)

    @property
    def page(self) -> Path:
        """The page that shows it."""
        return self.folder / "index.html"

    @property
    def outcomes(self) -> dict[str, int]:
        """How many rollouts ended how, the most frequent first."""
        counts = self.table["outcome"].value_counts().to_pylist()
        return {row["values"]: row["counts"] for row in sorted(counts, key=lambda row: -row["counts"])}


class Compared(NamedTuple):
    """One combination of the listed values (text by key), over all points: the share of its rollouts that
    completed; medians of error_rms, objective_integral and effort, where known; and `best`, the share of
    points where its ∫ H dt is the least, of those where all combinations completed, None without objective or
    with one point only."""

    values: dict[str, str]
    completed: float
    medians: dict[str, float]
    best: float | None


def column(table: Any, name: str) -> Array:
    """A column of numbers (N,), NaN where unknown."""
    return np.asarray(table[name].to_numpy(zero_copy_only=False), dtype=float)


def spreads(swept: SweepResult) -> Iterator[tuple[str, float, float, float]]:
    """Name, least, median and largest value of each quantity that differs between rollouts."""
    for name in QUANTITIES:
        values = column(swept.table, name)
        values = values[np.isfinite(values)]
        if len(values) and np.ptp(values) > ALIKE * np.abs(values).max():
            yield name, float(values.min()), float(np.median(values)), float(values.max())


def compared(swept: SweepResult) -> list[Compared]:
    definition = swept.definition
    count = definition.combinations
    if not 2 <= count <= MOST_COMPARED:
        return []
    table = swept.table
    completed = np.array([end == "completed" for end in table["outcome"].to_pylist()]).reshape(-1, count)
    names = ("error_rms", "objective_integral", "effort")
    by = {name: column(table, name).reshape(-1, count) for name in names}
    H = by["objective_integral"]
    both = H[completed.all(axis=1)]
    least = np.argmin(both, axis=1) if len(both) > 1 and np.ptp(H[np.isfinite(H)]) > 0.0 else None
    keys = {axis.key for axis in definition.listed}
    comparisons = []
    for k, row in enumerate(definition.parameters(range(count))):
        medians = {
            name: float(np.median(known))
            for name, values in by.items()
            if len(known := values[:, k][np.isfinite(values[:, k])])
        }
        best = None if least is None else float(np.mean(least == k))
        values = {key: v if isinstance(v, str) else f"{v:.6g}" for key, v in row.items() if key in keys}
        comparisons.append(Compared(values, float(completed[:, k].mean()), medians, best))
    return comparisons


def write_page(swept: SweepResult, units: Mapping[str, str]) -> None:
    """Write index.html, whole or not at all: maps, fronts, parallel coordinates and a table with filters;
    `units` are those of columns that have none by themselves."""
    definition = swept.definition
    data = _data(swept, units)
    text = template("nmm.plugins.sweeps", "web", "page.html").render(
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
    text = f"{definition.rows} rollouts of {definition.scenario}: "
    parts = []
    if definition.ranges:
        keys = [f"{axis.key} from {axis.lower:.4g} to {axis.upper:.4g}" for axis in definition.ranges]
        how = f"{definition.samples} points ({definition.sampler}, seed {definition.seed})"
        parts.append(f"{how} of {listed(keys)}")
    parts += [
        f"{axis.key} {listed([f'{value}' for value in axis.cells], 'or')}"
        if len(axis.cells) <= 6
        else f"{len(axis.cells)} values of {axis.key}, from {axis.cells[0]} to {axis.cells[-1]}"
        for axis in definition.listed
    ]
    return text + "; ".join(parts) + "."


def _data(swept: SweepResult, units: Mapping[str, str]) -> dict[str, Any]:
    definition, table = swept.definition, swept.table
    count = definition.combinations
    every = math.ceil(definition.rows / MOST_ROWS)
    # Whole points, if any are left; of a grid larger than the page, evenly spaced rows.
    points = definition.samples > every
    rows = [i for i in range(definition.rows) if (i // count if points else i) % every == 0]
    shown = table.take(rows)
    listed_keys, varied = {axis.key for axis in definition.listed}, {axis.key for axis in definition.vary}
    return {
        "shown": len(rows),
        "command": definition.command(0)[: 3 + 2 * len(definition.settings)],
        "combinations": count if points else 1,
        "keep": definition.keep,
        "resolvers": {name: color for name, (color, _) in resolver_styles().items()},
        "outcomes": swept.outcomes,
        "columns": [
            {
                **column._asdict(),
                "unit": column.unit or units.get(column.name, ""),
                "varied": column.name in varied,
                "listed": column.name in listed_keys,
                **_cells(column, shown[column.name].to_pylist(), exact=column.name in varied),
            }
            for column in columns_of(definition)
        ],
    }


def _cells(column: Column, values: list[Any], *, exact: bool) -> dict[str, Any]:
    """A column's values, only once if they are all the same, and text as numbers of its levels."""
    if column.kind == "number":
        values = finite(values)
        if not exact:
            values = [None if value is None else float(f"{value:.{DIGITS}g}") for value in values]
    if all(value == values[0] for value in values):
        return {"same": values[0]}
    if column.kind != "text":
        return {"values": values}
    levels = sorted({value for value in values if value is not None})
    codes = {level: k for k, level in enumerate(levels)}
    return {"levels": levels, "codes": [codes.get(value, -1) for value in values]}
