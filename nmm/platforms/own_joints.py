"""The names of a platform's own joints, which are coordinates after x, y and theta."""

from __future__ import annotations

from collections.abc import Sequence

from nmm.errors import InputError

PLANAR = ("x", "y", "theta")


def coordinates_with(platform: str, joints: Sequence[str]) -> tuple[str, ...]:
    """x, y, theta and the joints, each named once.

    Raises
    ------
    InputError : a name that is none, is x, y or theta, or comes twice
    """
    names = list(PLANAR)
    for joint in joints:
        if not isinstance(joint, str) or not joint:
            raise InputError(f"{platform}: expected the name of a joint, got {joint!r}")
        if joint in PLANAR:
            raise InputError(f"{platform}: expected a joint's name other than x, y, theta, got {joint!r}")
        if joint in names:
            raise InputError(f"{platform}: two joints are named {joint!r}; expected a name for each")
        names.append(joint)
    return tuple(names)
