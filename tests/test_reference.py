"""The reference lists every public name once."""

from __future__ import annotations

import inspect
import re
from collections import Counter
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name

import nmm

ROOT = Path(__file__).resolve().parent.parent
#: Packages whose names are public; those that `nmm` has too are listed there.
PUBLIC = ("analysis", "drafts", "driving", "figures", "gallery", "paper", "playback", "rendering", "sweeps")


def public_names() -> dict[str, object]:
    """Every public name, in full, with what it is."""
    names = {f"nmm.{name}": getattr(nmm, name) for name in nmm.__all__}
    for room in PUBLIC:
        module = import_module(f"nmm.{room}")
        for name in module.__all__:
            if name not in nmm.__all__:
                names[f"nmm.{room}.{name}"] = getattr(module, name)
    return {name: thing for name, thing in names.items() if not inspect.ismodule(thing)}


def test_the_reference_lists_every_public_name_once() -> None:
    pages = {path.stem: path.read_text("utf-8") for path in (ROOT / "docs" / "api").glob("*.md")}
    listed = [found for page in pages.values() for found in re.findall(r"\.\. auto(\w+):: (\S+)", page)]
    assert Counter(name for _, name in listed) == Counter([*public_names()])
    for kind, name in listed:
        thing = resolve_name(name)
        error = inspect.isclass(thing) and issubclass(thing, Exception)
        assert kind == ("exception" if error else "class" if inspect.isclass(thing) else "function"), name
    assert {*re.findall(r"`(\w+)`", pages["index"])} >= {name.rpartition(".")[2] for _, name in listed}
