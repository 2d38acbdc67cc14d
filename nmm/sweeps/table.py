"""The rows of a sweep in Parquet: parts written whole or not at all, and one table of them at the end."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from nmm.sweeps.columns import columns_of
from nmm.sweeps.definition import Definition
from nmm.sweeps.extra import arrow, parquet
from nmm.writing import whole_file

#: Rows of a group in the finished table.
GROUP = 65_536


def schema_of(definition: Definition) -> Any:
    """The table's pyarrow schema; it carries the definition and what each column is."""
    pa = arrow()
    kinds = {"count": pa.int64(), "number": pa.float64(), "text": pa.string()}
    fields = [
        pa.field(column.name, kinds[column.kind], metadata={"unit": column.unit, "about": column.about})
        for column in columns_of(definition)
    ]
    return pa.schema(fields, metadata={"nmm": json.dumps(definition.plain())})


def write_part(rows: Sequence[Mapping[str, Any]], path: Path, schema: Any) -> None:
    """Rows as a Parquet file, which is there whole or not at all, whenever this is killed."""
    table = arrow().Table.from_pylist(list(rows), schema=schema)
    with whole_file(path) as temporary:
        parquet().write_table(table, temporary)


def rows_in(path: Path) -> int:
    """How many rows a file has; -1 for one that cannot be read."""
    try:
        return int(parquet().read_metadata(path).num_rows)
    except (OSError, arrow().ArrowException):
        return -1


def join_parts(parts: Sequence[Path], path: Path, schema: Any) -> None:
    """One file of the parts' rows, in their order; so many rows at a time are in memory as a group has."""
    pa, pq = arrow(), parquet()
    with whole_file(path) as temporary, pq.ParquetWriter(temporary, schema) as writer:
        tables: list[Any] = []
        for part in parts:
            tables.append(pq.read_table(part, schema=schema, partitioning=None))
            if sum(table.num_rows for table in tables) >= GROUP:
                writer.write_table(pa.concat_tables(tables).combine_chunks())
                tables = []
        if tables:
            writer.write_table(pa.concat_tables(tables).combine_chunks())
