"""Analyses of a robot with a task: where J loses rank and why, what is free, and what a person looks at.

Names are loaded when first used (the list is `__init__.pyi`); formulas are in `nmm.plugins.symbolic`.
"""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
