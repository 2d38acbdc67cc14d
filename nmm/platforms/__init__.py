"""Platforms: one file each. `PLATFORMS` finds them by name."""

from __future__ import annotations

from nmm.errors import InputError, unknown
from nmm.platforms.base import Platform
from nmm.platforms.unicycle import Unicycle

PLATFORMS: dict[str, type[Platform]] = {kind.name: kind for kind in (Unicycle,)}


def platform_by_name(name: str) -> Platform:
    """The platform of that name with its default parameters; `InputError` lists the names."""
    if name not in PLATFORMS:
        raise InputError(unknown("platform", name, PLATFORMS))
    return PLATFORMS[name]()


__all__ = ["PLATFORMS", "Platform", "Unicycle", "platform_by_name"]
