"""The reference lists every public name once, and each has an example that runs."""

from __future__ import annotations

import doctest
import inspect
import re
from collections import Counter
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import nmm

ROOT = Path(__file__).resolve().parent.parent
#: Packages whose names are public; those that `nmm` has too are listed there.
PUBLIC = ("analysis", "drafts", "driving", "figures", "gallery", "playback", "rendering", "sweeps")


def public_names() -> dict[str, object]:
    """Every public name, in full, with what it is."""
    names = {f"nmm.{name}": getattr(nmm, name) for name in nmm.__all__}
    for room in PUBLIC:
        module = import_module(f"nmm.{room}")
        for name in module.__all__:
            if name not in nmm.__all__:
                names[f"nmm.{room}.{name}"] = getattr(module, name)
    return {name: thing for name, thing in names.items() if not inspect.ismodule(thing)}


THINGS = public_names()


def test_the_reference_lists_every_public_name_once() -> None:
    pages = {path.stem: path.read_text("utf-8") for path in (ROOT / "docs" / "api").glob("*.md")}
    listed = [found for page in pages.values() for found in re.findall(r"\.\. auto(\w+):: (\S+)", page)]
    assert Counter(name for _, name in listed) == Counter([*THINGS])
    for kind, name in listed:
        thing = THINGS[name]
        error = inspect.isclass(thing) and issubclass(thing, Exception)
        assert kind == ("exception" if error else "class" if inspect.isclass(thing) else "function"), name
    assert {*re.findall(r"`(\w+)`", pages["index"])} >= {name.rpartition(".")[2] for _, name in listed}


#: What needs more than nmm: a browser.
NEEDS = {"nmm.rendering.render": pytest.mark.browser}


@pytest.mark.parametrize("name", [pytest.param(one, marks=NEEDS.get(one, ())) for one in THINGS])
def test_a_public_name_has_an_example_that_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In its own docstring, not in one that it inherits; nmm and np are there, as docs/api/index.md says."""
    monkeypatch.chdir(tmp_path)
    thing = THINGS[name]
    text = (vars(thing)["__doc__"] if inspect.isclass(thing) else thing.__doc__) or ""
    example = doctest.DocTestParser().get_doctest(text, {"nmm": nmm, "np": np}, name, None, None)
    assert example.examples, f"{name}: expected a section Examples in its docstring"
    told: list[str] = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example, out=told.append)
    assert not told, "".join(told)
