"""The errors that nmm raises: one root, and below it what the user can tell apart.

Every message says what was expected, what came, and what is available.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

from nmm.words import one_line, quoted


class NmmError(Exception):
    """Root of every error that nmm raises on purpose."""


class InputError(NmmError, ValueError):
    """Something that the user gave is wrong: a name, a shape, a number, a file."""


class RobotError(InputError):
    """A robot description (URDF, xacro, `pin.Model`) cannot be used, and why."""


class ScenarioError(InputError):
    """A scenario file or a `--set` is wrong: the message names file, key and what was expected."""


class RunError(NmmError, RuntimeError):
    """A computation that began with good input could not go on."""


class SingularError(RunError):
    """The matrix that a resolver has to invert lost rank."""


class DivergedError(RunError):
    """The motion grew without bound; `alpha * dt` is usually too large."""


#: A longer name is no misspelling.
LONGEST = 200


def unknown(kind: str, name: object, available: Iterable[str], where: str = "") -> str:
    """One line for a name that does not exist: what came, the nearest match, what there is.

    >>> unknown("frame", "eee", ["ee", "link1"])
    "unknown frame 'eee' (did you mean 'ee'?); available: ee, link1"
    """
    import difflib  # here: every start would pay

    names, asked = list(available), str(name)
    near = difflib.get_close_matches(asked, names, n=1) if len(asked) < LONGEST else []
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    listing = ", ".join(one_line(name, LONGEST) for name in names) if names else "none"
    prefix = f"{where}: " if where else ""
    return f"{prefix}unknown {kind} {quoted(name)}{hint}; available: {listing}"


def expect_known(
    kind: str, name: object, available: Collection[Any], where: str = "", error: type[InputError] = InputError
) -> None:
    """The error, in the words of `unknown`, for a name that is not among those available."""
    if name not in available:
        raise error(unknown(kind, name, available, where))
