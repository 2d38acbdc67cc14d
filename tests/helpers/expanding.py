"""Bundled robots' files are expanded once for each set of arguments: xacro takes 0.1 s for one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from nmm.base.bundled import bundled_robots
from nmm.model.robots.loading.description import expand
from nmm.model.robots.loading.packages import Packages

Expanded = tuple[str, dict[str, str], tuple[str, ...]]

_known: dict[tuple[Path, tuple[tuple[str, str], ...]], Expanded] = {}


def expanded_once(
    path: Path, arguments: Mapping[str, str], packages: Packages, call: ElementTree.Element | None = None
) -> Expanded:
    """`expand`: nobody writes to the bundled files while the tests run, and they ask for no package."""
    if path not in bundled_robots().values():
        return expand(path, arguments, packages, call)
    key = path, tuple(sorted(arguments.items()))
    if key not in _known:
        _known[key] = expand(path, arguments, packages)
    xml, used, warnings = _known[key]
    return xml, {**used}, warnings
