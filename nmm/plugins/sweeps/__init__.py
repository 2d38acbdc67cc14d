"""Sweeps: many rollouts of a scenario over ranges of its keys, on one machine or a Dask cluster."""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
