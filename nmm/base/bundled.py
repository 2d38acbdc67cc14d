"""The robots and scenarios that come with nmm, found by name from a checkout and from an installed wheel."""

import tomllib
from functools import cache
from pathlib import Path

from nmm.base.errors import NmmError

_PACKAGE = Path(__file__).resolve().parents[1]


def bundled_robots() -> dict[str, Path]:
    """The bundled robots: name (the file's name up to the first dot) to xacro file, sorted by name."""
    return _files("robots", ".xacro")


def bundled_scenarios() -> dict[str, Path]:
    """The bundled scenarios' YAML files by name."""
    return _files("scenarios", ".yaml")


def bundled_sweeps() -> dict[str, Path]:
    return _files("scenarios/sweeps", ".yaml")


def _files(folder: str, suffix: str) -> dict[str, Path]:
    # Files in subfolders are parts that these include.
    paths = sorted(_folder(folder).glob(f"*{suffix}"))
    return {path.name.split(".", 1)[0]: path for path in paths if path.is_file()}


@cache
def _folder(name: str) -> Path:
    """The folder of an installed wheel, or else of the checkout that this package is part of."""
    installed = _PACKAGE / "_bundled" / name
    if installed.is_dir():
        return installed
    checkout = _PACKAGE.parent / name
    # In site-packages, a folder `robots` beside nmm would belong to another project.
    if _is_our_project(_PACKAGE.parent / "pyproject.toml") and checkout.is_dir():
        return checkout
    raise NmmError(f"found neither {installed} nor {checkout}", where="an incomplete installation")


def _is_our_project(pyproject: Path) -> bool:
    try:
        content = tomllib.loads(pyproject.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False
    project = content.get("project")
    return isinstance(project, dict) and project.get("name") == "nmm"
