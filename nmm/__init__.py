"""nmm: modelling and redundancy resolution for nonholonomic mobile manipulators, on Pinocchio.

Names are loaded when first used, so that `import nmm` costs nothing (the list is `__init__.pyi`).
"""

import sys
from importlib.util import find_spec

from nmm.base.lazy_call import interrupts_wait
from nmm.base.lazy_names import ModuleAliases, attach
from nmm.base.version import __version__ as __version__

#: Modules that users import by a shorter name than their room's: `from nmm.ros import Messages`.
SHORT = {
    "driving": "plugins.live.driving",
    "figures": "views.figures",
    "folders": "views.folders",
    "playback": "views.playback",
    "rendering": "plugins.live.rendering",
    "ros": "plugins.robot.ros",
}
sys.meta_path.append(ModuleAliases({f"nmm.{name}": f"nmm.{module}" for name, module in SHORT.items()}))

_loaded, __dir__, __all__ = attach(__name__, __file__)


def __getattr__(name: str) -> object:
    with interrupts_wait():
        try:
            return _loaded(name)
        except AttributeError as error:
            if (added := _of_plugins(name)) is not None:
                return added
            from nmm import extending

            if name in extending.__all__:
                raise AttributeError(f"{error}, but nmm.extending has", name=name) from None
            raise


def _of_plugins(name: str) -> object:
    """What a stranger's plugin adds by this name; None where none does, and for nmm's own modules."""
    if name.startswith("_") or find_spec(f"nmm.{name}") is not None:
        return None
    from nmm.base.plugins import additions

    addition = additions("front", __all__).get(name)
    return None if addition is None else addition.load()
