"""A robot description: the expanded URDF text of a .urdf or .xacro file, and where it came from."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nmm.errors import RobotError
from nmm.robots.loading.packages import Packages
from nmm.robots.loading.text import read_text
from nmm.robots.loading.xacro_file import expand
from nmm.robots.loading.xml_tree import XmlError, parse
from nmm.words import one_line

SUFFIXES = (".urdf", ".xacro")
_LINK = re.compile(r"<link\b")


@dataclass(frozen=True)
class Description:
    """An expanded description.

    Attributes
    ----------
    xml : URDF text
    path : the file it was read from
    packages : where its packages and meshes are
    expanded : whether xacro wrote the text, so that its lines are not the file's
    arguments : the xacro arguments used, defaults included
    notes : what xacro warned of
    """

    xml: str
    path: Path
    packages: Packages
    expanded: bool
    arguments: Mapping[str, str]
    notes: tuple[str, ...]


def describe(
    path: str | Path,
    arguments: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | Path] = (),
) -> Description:
    """Read a .urdf, .xacro or .urdf.xacro file.

    Parameters
    ----------
    path : the file
    arguments : values of its `xacro:arg`s: strings, numbers or booleans
    package_dirs : folders that are, or hold, the ROS packages that the file speaks of

    Raises
    ------
    RobotError : the file cannot be read or expanded, or an argument is unknown
    """
    file = Path(os.path.expanduser(path))  # pathlib's raises when there is no such user
    texts = argument_texts(arguments)
    _check_file(file)
    packages = Packages(file, package_dirs)
    if file.suffix.lower() == ".xacro":
        xml, used, warnings = expand(file.absolute(), texts, packages)
        if not _LINK.search(xml):
            _complain_of_macros(file)
        notes = tuple(f"xacro {warning}" for warning in warnings)
        return Description(xml, file, packages, True, used, notes)
    if texts:
        raise RobotError(f"{file}: arguments ({', '.join(texts)}) are for .xacro files, a .urdf has none")
    return Description(read_text(file), file, packages, False, {}, ())


def _complain_of_macros(file: Path) -> None:
    """`RobotError` that names the macros of a file that only defines some."""
    try:
        macros = [one for one in parse(read_text(file)).iter("xacro:macro") if one.get("name")]
    except XmlError:
        return
    if macros:
        told = "; ".join(
            f"{one.get('name')} ({one.get('params', '').strip() or 'no parameters'})" for one in macros
        )
        raise RobotError(
            f"{file}: holds no robot, only macros: {one_line(told, 400)}; write a .xacro file that includes "
            f"it and calls one: <xacro:include filename={str(file.name)!r}/> "
            f"<xacro:{macros[0].get('name', '').removeprefix('xacro:')} .../>"
        )


def argument_texts(arguments: Mapping[str, object] | None) -> dict[str, str]:
    """The arguments as xacro wants them: text, with booleans as true and false.

    Raises
    ------
    RobotError : a name that is no string, or a value that is no string, number or boolean
    """
    if arguments is not None and not isinstance(arguments, Mapping):
        raise RobotError(f"arguments: expected a value for each name, got {arguments!r}")
    texts: dict[str, str] = {}
    for name, value in (arguments or {}).items():
        if not isinstance(name, str):
            raise RobotError(f"arguments: expected names as strings, got {name!r}")
        if isinstance(value, bool | np.bool_):
            texts[name] = "true" if value else "false"
        elif isinstance(value, str | int | float | np.integer | np.floating):
            texts[name] = str(value)
        else:
            raise RobotError(f"arguments: {name}: expected a string, a number or a boolean, got {value!r}")
    return texts


def _check_file(file: Path) -> None:
    try:
        exists = file.exists()
    except (OSError, ValueError) as error:  # too long a name, a null character, a locked folder
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise RobotError(f"{one_line(repr(str(file)), 100)} cannot be read ({reason})") from None
    if not exists:
        raise RobotError(f"{file}: no such file")
    if file.is_dir():
        raise RobotError(f"{file}: expected a .urdf or .xacro file, this is a directory")
    if file.suffix.lower() not in SUFFIXES:
        raise RobotError(f"{file}: expected a name that ends in .urdf or .xacro")
