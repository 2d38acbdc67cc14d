"""What a person sees or keeps of a run: figures, pages that play, tables, folders.

Nothing here moves a robot.
"""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
