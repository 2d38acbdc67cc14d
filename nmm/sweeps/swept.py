"""`Swept`: a sweep that was run, its table and its page."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from nmm.sweeps.definition import Definition
from nmm.sweeps.extra import parquet


@dataclass(frozen=True)
class Swept:
    """A sweep that was run.

    Attributes
    ----------
    folder : where it is
    definition : what it is

    Examples
    --------
    >>> sweep = nmm.Sweep("unicycle_2r_position", {"q0.x": (-2, 0)}, samples=4, settings={"duration": 2})
    >>> swept = sweep.run("runs/starts", jobs=1)
    >>> len(swept.table["error_final"]), swept.page.name
    (4, 'index.html')
    """

    folder: Path
    definition: Definition

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
        return {one["values"]: one["counts"] for one in sorted(counts, key=lambda one: -one["counts"])}
