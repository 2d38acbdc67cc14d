"""Names that rooms show: loaded when first used, whatever was imported before, and by their short modules."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

import nmm


@pytest.mark.parametrize(("short", "module"), nmm.SHORT.items())
def test_a_module_s_short_name_is_the_module(short: str, module: str) -> None:
    code = f"""
import sys
import nmm.{short}, nmm.{module}
print(nmm.{short} is sys.modules["nmm.{module}"], nmm.{short}.__spec__.name)
"""
    for before in ("", f"import nmm.{module}\n", f"import nmm; nmm.{short}\n"):
        done = subprocess.run(
            [sys.executable, "-c", before + code], capture_output=True, text=True, check=True
        )
        assert done.stdout == f"True nmm.{module}\n"
    assert import_module(f"nmm.{short}") is getattr(nmm, short)


@pytest.mark.parametrize("first", ["nmm.analysis.repeatability", "nmm.rendering"])
def test_functions_are_no_modules_whatever_was_called_before(first: str) -> None:
    code = f"import nmm; {first}; print(callable(nmm.analysis.redundancy), callable(nmm.rendering.render))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True True\n"


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"nmm\.analysis has no singularitys"):
        nmm.analysis.singularitys  # noqa: B018
