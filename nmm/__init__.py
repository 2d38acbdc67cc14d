"""nmm: modelling and redundancy resolution for nonholonomic mobile manipulators, on Pinocchio.

Names are loaded when first used, so that `import nmm` costs nothing (`lazy_loader`; the list of
names is `__init__.pyi`).
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
