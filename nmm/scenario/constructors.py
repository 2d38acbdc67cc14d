"""What a class's constructor takes, as its signature and its docstring say: the keys of a scenario's part."""

from __future__ import annotations

import inspect
import re
import typing
from functools import cache
from typing import Any, NamedTuple

#: The key of what a constructor takes with a star: `Coordinates(*combinations)` is `of: [...]`.
STARRED = "of"


class Parameter(NamedTuple):
    """A parameter of a constructor.

    Attributes
    ----------
    name, key : in Python, and as a key of a file
    annotation : its type as the source says it, without "| None"
    hint : the type itself
    default : `inspect.Parameter.empty` where there is none
    text : what the docstring says of it
    starred : whether it takes all positional arguments
    """

    name: str
    key: str
    annotation: str
    hint: Any
    default: Any
    text: str
    starred: bool

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is inspect.Parameter.empty


@cache
def parameters(made: type) -> tuple[Parameter, ...]:
    """What the constructor takes, in order."""
    texts = documented(made)
    hints = typing.get_type_hints(made.__init__)  # type: ignore[misc]  # of this very class
    found = []
    for name, given in inspect.signature(made).parameters.items():
        starred = given.kind is inspect.Parameter.VAR_POSITIONAL
        default = given.default
        if starred and _may_be_called_bare(made):
            default = None
        found.append(
            Parameter(
                name,
                STARRED if starred else name,
                _as_written(given.annotation).removesuffix(" | None"),
                hints[name],
                default,
                texts.get(name, ""),
                starred,
            )
        )
    return tuple(found)


def _as_written(annotation: Any) -> str:
    """An annotation as the source says it, also of a file that does not postpone their evaluation."""
    return annotation.__name__ if isinstance(annotation, type) else str(annotation)


def _may_be_called_bare(made: type) -> bool:
    try:
        made()
    except (TypeError, ValueError):
        return False
    return True


def documented(made: type) -> dict[str, str]:
    """Of each parameter what the section "Parameters" of the docstring says, on one line."""
    _, _, section = (inspect.getdoc(made) or "").partition("\nParameters\n----------\n")
    section = re.split(r"\n\n?[A-Z]\w+\n---", section)[0]
    texts: dict[str, str] = {}
    for names, text in re.findall(r"^([\w, *]+) : (.+(?:\n(?: .*)?)*)", section, re.MULTILINE):
        for name in names.split(","):
            texts[name.strip(" *")] = " ".join(text.split())
    return texts


def summary(made: type) -> str:
    """The first paragraph of the docstring, on one line."""
    return " ".join((inspect.getdoc(made) or "").partition("\n\n")[0].split())
