"""Robots in a browser while they move: live pages, targets that are dragged, videos."""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
