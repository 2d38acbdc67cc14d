"""Videos of runs: the playback page, picture by picture, through a headless Chromium and ffmpeg.

chromium  a page in a browser without a window, and pictures of it
encoder   pictures made into a file, by ffmpeg
render    which page, which instants
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
