"""Videos of runs: the playback page, picture by picture, through a headless Chromium and ffmpeg."""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
