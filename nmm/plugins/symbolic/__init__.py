"""f, J and its minors as formulas, and what follows from them: where J loses rank, and where it cannot."""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
