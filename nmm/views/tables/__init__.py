"""Numbers of runs, or of laps, side by side in a table for a paper: LaTeX, CSV or Markdown."""

from nmm.views.tables.quantities import comparison_table, laps_table
from nmm.views.tables.table import FORMS, Quantity, Table

__all__ = ["FORMS", "Quantity", "Table", "comparison_table", "laps_table"]
