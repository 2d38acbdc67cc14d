"""Platforms: one file each. `PLATFORMS` finds them by name."""

from __future__ import annotations

from nmm.errors import InputError, unknown
from nmm.platforms.base import Platform
from nmm.platforms.layout import Layout, Pivot, RollingJoint
from nmm.platforms.unicycle import Unicycle

PLATFORMS: dict[str, type[Platform]] = {kind.name: kind for kind in (Unicycle,)}


def platform_by_name(name: str) -> type[Platform]:
    """The kind of platform of that name; `InputError` lists the names."""
    if name not in PLATFORMS:
        raise InputError(unknown("platform", name, PLATFORMS))
    return PLATFORMS[name]


__all__ = ["PLATFORMS", "Layout", "Pivot", "Platform", "RollingJoint", "Unicycle", "platform_by_name"]
