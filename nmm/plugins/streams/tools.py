"""The tools that streams go to, imported when they are asked for."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from nmm.base.errors import InputError

RERUN, FOXGLOVE = "rerun", "foxglove"
#: What to install, and how a file's name ends, by the tool's name, which is its module's, too.
PACKAGES = {RERUN: "rerun-sdk", FOXGLOVE: "foxglove-sdk"}
SUFFIXES = {RERUN: ".rrd", FOXGLOVE: ".mcap"}
#: Where a viewer of Rerun listens, and where Foxglove looks for a server, unless told otherwise.
PORTS = {RERUN: 9876, FOXGLOVE: 8765}
LOOPBACK = "127.0.0.1"


def expect_installed(tool: str) -> None:
    """`InputError` without the tool's package, which says how to install it."""
    if find_spec(tool) is None:
        package = PACKAGES[tool]
        what = f"streams to {tool} need the package {package}: pip install {package}"
        raise InputError(what, where="stream")


def imported(tool: str) -> Any:
    """The tool's module."""
    expect_installed(tool)
    return import_module(tool)
