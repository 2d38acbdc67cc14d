"""Playback: motions in a browser with MeshCat, as one file or live."""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
