"""What authors of platforms, tasks, resolvers and of packages above the wall need beside `nmm` itself.

The list of names is `extending.pyi`; docs/api/extending.md says what they are. Names are loaded when they are
first used.
"""

from nmm.base.lazy_names import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
