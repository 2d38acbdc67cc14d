"""A robot that follows a target moved live: what `nmm drive` shows."""

from nmm.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
