"""A robot that follows a target moved live: what `nmm drive` shows."""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
