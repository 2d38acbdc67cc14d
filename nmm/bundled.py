"""The robots and scenarios that come with nmm, found by name from a checkout and from an installed wheel."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

from nmm.errors import NmmError

_PACKAGE = Path(__file__).resolve().parent


def bundled_robots() -> dict[str, Path]:
    """The bundled robots: name (the file's name up to the first dot) to xacro file, sorted by name.

    Raises
    ------
    NmmError : the installation has no such folder
    """
    return _files("robots", ".xacro")


def bundled_scenarios() -> dict[str, Path]:
    """The bundled scenarios: name (the file's name up to the first dot) to YAML file, sorted by name.

    Raises
    ------
    NmmError : the installation has no such folder
    """
    return _files("scenarios", ".yaml")


def bundled_sweeps() -> dict[str, Path]:
    """The bundled sweeps of scenarios: name to YAML file, sorted by name.

    Raises
    ------
    NmmError : the installation has no such folder
    """
    return _files("scenarios/sweeps", ".yaml")


def _files(folder: str, suffix: str) -> dict[str, Path]:
    # Only the folder's own files: what lies deeper are parts that those include.
    paths = sorted(_folder(folder).glob(f"*{suffix}"))
    return {path.name.split(".", 1)[0]: path for path in paths if path.is_file()}


@cache
def _folder(name: str) -> Path:
    """The folder of an installed wheel, or else of the checkout that this package is part of."""
    installed = _PACKAGE / "_bundled" / name
    if installed.is_dir():
        return installed
    checkout = _PACKAGE.parent / name
    # In site-packages, a folder `robots` beside nmm would be somebody else's.
    if _is_our_project(_PACKAGE.parent / "pyproject.toml") and checkout.is_dir():
        return checkout
    raise NmmError(f"this installation of nmm is incomplete: found neither {installed} nor {checkout}")


def _is_our_project(pyproject: Path) -> bool:
    try:
        content = tomllib.loads(pyproject.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False
    project = content.get("project")
    return isinstance(project, dict) and project.get("name") == "nmm"
