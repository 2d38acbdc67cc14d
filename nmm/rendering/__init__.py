"""Videos of runs: the playback page, picture by picture, through a headless Chromium and ffmpeg."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
