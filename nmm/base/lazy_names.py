"""Names of a package that are loaded when first used, from its stub, which type checkers read, too."""

import re
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

Names = tuple[str, ...]

_LINE = re.compile(r"^from (\S+) import (\w+) as \2$", re.M)


def attach(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], Names]:
    """`__getattr__`, `__dir__` and `__all__` of the module `package` at `file`, from the stub beside it.

    Each line of the stub is `from MODULE import NAME as NAME`, MODULE absolute or relative to the package.
    """
    stub = Path(file).with_suffix(".pyi").read_text("utf-8")
    modules = {name: module for module, name in _LINE.findall(stub)}
    parent = package if Path(file).stem == "__init__" else package.rpartition(".")[0]

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"{package} has no {name}", name=name, obj=sys.modules[package])
        module = modules[name]
        if module == ".":
            value = import_module(f".{name}", parent)
        else:
            value = getattr(import_module(module, parent), name)
        setattr(sys.modules[package], name, value)  # also where its module is called the same
        return value

    return load, lambda: [*modules], tuple(modules)


class ModuleAliases(MetaPathFinder, Loader):
    """Imports modules by a second name: `from nmm.ros import Messages`, from a room inside.

    Parameters
    ----------
    modules : the name of the module by its second name, both in full
    """

    def __init__(self, modules: Mapping[str, str]) -> None:
        self._modules = modules

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname in self._modules else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(self._modules[spec.name])
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """It has run; the import has given it the alias's spec in place of its own."""
        module.__spec__ = module.__spec__.loader_state if module.__spec__ else None
