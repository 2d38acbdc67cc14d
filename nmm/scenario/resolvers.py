"""The resolvers of a scenario: how the redundancy is resolved, with keys of their own."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from nmm.base.errors import InputError
from nmm.base.kinds import RESOLVERS
from nmm.base.text_format import listed as in_words
from nmm.scenario.constructors import MadePart, part_of
from nmm.scenario.keys import KeyedError, OneOf
from nmm.scenario.numbers import Positive, integer
from nmm.scenario.tasks import TaskList, listed


class ResolverPart(MadePart):
    """How the redundancy is resolved."""

    kind: str

    @classmethod
    def unknown(cls, key: str) -> str:
        kinds = kinds_with(key)
        return f", a key of {in_words(kinds)}" if kinds else super().unknown(key)


def kinds_with(key: str) -> list[str]:
    """The kinds of resolver that have the key."""
    return [kind for kind, part in RESOLVER_PARTS.items() if key in part.model_fields]


def _partitions(value: object) -> object:
    if isinstance(value, str):
        if value != "automatic":
            raise InputError(expected="automatic, or a list of lists of inputs", got=value)
        return value
    if not isinstance(value, list | tuple) or not all(isinstance(item, list | tuple) for item in value):
        raise InputError(expected="automatic, or lists of inputs ([[v, q1], [v, omega]])", got=value)
    return [
        [item if isinstance(item, str) and not item.isdecimal() else integer(item) for item in p]
        for p in value
    ]


class WithAddedTask(ResolverPart):
    """With a task that takes up the redundancy; in Python the controller takes it, not the resolver."""

    added_task: Annotated[
        TaskList | None, BeforeValidator(lambda value: None if value is None else listed(value))
    ] = Field(
        None,
        description="the task y = h(q), or a list, of p + n_m - s rows; by default the terms of a "
        "quadratic objective, driven to their targets",
    )
    gain: Positive = Field(
        10.0, description="feedback gain K_y, 1/s, of the added task made from the objective"
    )


#: How files spell what the constructors take, and what a file says beside it.
SPELLED: dict[str, dict[str, Any]] = {
    "rg": {
        "partitions": (
            Annotated[str | list[list[str | int]], BeforeValidator(_partitions)],
            "inputs whose columns may form Ja: automatic, or lists ([[v, q1], [v, omega]])",
        )
    }
}
BASES: dict[str, type[ResolverPart]] = {"ej": WithAddedTask}
RESOLVER_PARTS: dict[str, type[ResolverPart]] = RESOLVERS.made(
    lambda kind, made: part_of(kind, made, BASES.get(kind, ResolverPart), **SPELLED.get(kind, {}))
)


class OwnPart(ResolverPart):
    """The resolver of a Python file, as a run's folder records it. It is named on the command line, or given
    in Python: code of a file that a scenario names is never run."""

    kind: Literal["own"]
    source: str

    def make(self, unit: str = "m") -> Any:
        raise KeyedError(
            ("source",),
            "a scenario runs no Python",
            expected=f"{self.source} as --resolver FILE.py:NAME, or in Python as "
            "scenario.with_resolver(resolver)",
        )

    @model_validator(mode="after")
    def _can_be_made(self) -> OwnPart:
        """Not tried: a folder is read, and plays, without the file."""
        return self

    def explicit(self) -> dict[str, Any]:
        return self.model_dump()


AnyResolver = Annotated[ResolverPart, OneOf({**RESOLVER_PARTS, "own": OwnPart})]
