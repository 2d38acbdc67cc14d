"""Sweeps: many rollouts of a scenario over ranges of its keys, on one machine or a Dask cluster."""

from nmm.sweeps.result import SweepResult
from nmm.sweeps.sweep import Sweep

__all__ = ["Sweep", "SweepResult"]
