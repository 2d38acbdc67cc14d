"""Numbers of runs, or of laps, side by side in a table for a paper: LaTeX, CSV or Markdown."""

from nmm.tables.quantities import comparison_table, laps_table
from nmm.tables.table import FORMS, Quantity, Table

__all__ = ["FORMS", "Quantity", "Table", "comparison_table", "laps_table"]
