"""Runs side by side in a table for a paper.

table           names, units and numbers, a column a run; written as LaTeX, CSV or Markdown
quantities      which numbers of runs, and of laps, stand in it
"""

from nmm.tables.quantities import comparison_table, laps_table
from nmm.tables.table import FORMS, Quantity, Table

__all__ = ["FORMS", "Quantity", "Table", "comparison_table", "laps_table"]
