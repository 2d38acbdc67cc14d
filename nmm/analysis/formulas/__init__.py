"""f, J and its minors as formulas, and what follows from them: where J loses rank, and where it cannot."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
