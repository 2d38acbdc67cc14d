"""What a xacro file may do for which nobody vouches: compute, and read its own robot's files.

xacro evaluates Python. Unless a file is trusted, its expressions are names, numbers, arithmetic and xacro's
functions (`expressions.py`), and neither environment variables nor files elsewhere are read.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.base.findings import Finding
from nmm.base.trust import is_trusted
from nmm.model.robots.loading.budget import RefusedContent

if TYPE_CHECKING:
    from nmm.model.robots.loading.packages import Packages

#: Of what a file asks for, so many characters are told.
_TOLD = 100
#: So many folders above a description may be the ROS package that it is of.
_NEAR = 5


def untrusted(what: str, text: str = "") -> RefusedContent:
    told = what if len(what) <= _TOLD else f"{what[: _TOLD - 3]}..."
    return RefusedContent(Finding("xacro_untrusted", {"what": told}), text)


def check_readable(name: str, packages: Packages, pattern: str = "") -> None:
    """`RefusedContent` for a file that is neither in the robot's folder or package nor in one that it asked
    for. Where a file may be that matches a pattern, `name`, no folder is listed before."""
    if is_trusted() or not (pattern or os.path.lexists(name)) or _is_within(name, packages):
        return
    text = os.path.basename(pattern or name)
    raise untrusted(f"reading {text} from outside its folder and packages", text)


def _is_within(name: str, packages: Packages) -> bool:
    path, real = Path(os.path.normpath(os.path.abspath(name))), Path(os.path.realpath(name))
    # In the places that the user names, links lead where the user wants (colcon's --symlink-install).
    asked = {folder for folder in packages.found.values() if folder is not None}
    named = [folder for folder in asked if packages.is_named(folder)]
    if any(_holds(folder, path) for folder in named):
        return True
    own = [packages.file.parent, Path(os.path.realpath(packages.file)).parent]
    roots = [*own, *(folder for start in own if (folder := _package_above(start)) is not None)]
    roots += [folder for folder in asked if (folder / "package.xml").is_file() or not _is_wide(folder)]
    return any(_holds(Path(os.path.realpath(folder)), real) for folder in roots)


def _holds(folder: Path, path: Path) -> bool:
    """Whether the path lies below the folder, and nothing hidden lies between."""
    if not path.is_relative_to(folder):
        return False
    return not any(part.startswith(".") for part in path.relative_to(folder).parts)


def _package_above(start: Path) -> Path | None:
    """The nearest folder that is a ROS package, or the one around a usual folder for descriptions."""
    for folder in (start, *start.parents[:_NEAR]):
        if (folder / "package.xml").is_file():
            return folder
    usual = start.name.lower() in ("urdf", "xacro", "robots", "srdf", "config")
    return start.parent if usual and not _is_wide(start.parent) else None


def _is_wide(folder: Path) -> bool:
    """Whether all kinds of files are there: a home, what holds it, and folders at the file system's root."""
    folder = Path(os.path.realpath(folder))
    return len(folder.parts) <= 2 or Path(os.path.realpath(os.path.expanduser("~"))).is_relative_to(folder)
