"""Sweeps: many rollouts of a scenario over ranges of its keys, on one machine or a Dask cluster.

varied, sampling, definition    what varies, points of it by their number, the settings of each row
columns, rows    what is measured of a rollout; rows by their numbers (where an engine of many goes)
table, folder    rows in Parquet; the folder, which a killed sweep goes on from
work, cluster    a chunk of rows computed; by the workers of a Dask cluster
check, estimate  keys that cannot vary, and sweeps that are too large, before anything is computed
sweep, swept, files    `Sweep`, what it gives, and sweeps as YAML files
told, page       what the command line prints, and the page
"""

from nmm.sweeps.sweep import Sweep
from nmm.sweeps.swept import Swept

__all__ = ["Sweep", "Swept"]
