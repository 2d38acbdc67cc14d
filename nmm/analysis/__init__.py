"""Analyses of a robot with a task: where J loses rank and why, what is free, and what a person looks at.

Names are loaded when first used (the list is `__init__.pyi`); formulas are in `nmm.analysis.formulas`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
