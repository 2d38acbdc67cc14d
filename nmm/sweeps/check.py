"""Whether what varies can vary: asked before anything is computed, so that a wrong key is no row's fault."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, product
from typing import Any

from nmm.errors import InputError
from nmm.scenario import Scenario
from nmm.sweeps.varied import Listed, Range, Varied

#: Where a range is tried: its middle first.
SHARES = (0.5, 0.0, 1.0, 0.25, 0.75)
#: So many combinations of other keys' values are tried with a value that is wrong alone.
MOST_COMBINATIONS = 32


def check_varied(scenario: Scenario, vary: tuple[Varied, ...]) -> None:
    """Each value has to be one that the scenario's key takes, and each key one that the robot knows.

    A value that is right only beside another one (a threshold beside the resolver that has one) is right. A
    start outside limits is not looked at here: where some values of a key do, others are rows that say so.

    Raises
    ------
    ScenarioError : what is wrong with the first one, as `Scenario.override` says it
    InputError : one key is part of another
    """
    for one in vary:
        for other in vary:
            if other.key.startswith(f"{one.key}."):
                raise InputError(
                    f"vary: {other.key} is part of {one.key}, which varies too: expected one of them"
                )
    for one in vary:
        wrong = [_wrong(_changed(scenario, vary, one, value)) for value in _tried(one)]
        if all(wrong):
            raise next(filter(None, wrong))


def _wrong(scenario: Scenario) -> InputError | None:
    """What is wrong with a scenario on its robot."""
    try:
        scenario.controller()
    except InputError as error:
        return error
    return None


def _tried(one: Varied) -> list[Any]:
    if isinstance(one, Listed):
        return list(one.values)
    return [one.lower + share * (one.upper - one.lower) for share in SHARES]


def _changed(scenario: Scenario, vary: tuple[Varied, ...], one: Varied, value: Any) -> Scenario:
    """The scenario with one value set: alone, or in the first combination of the others that takes it."""
    try:
        return scenario.with_settings({one.key: value})
    except InputError as error:
        for settings in islice(_combinations(vary, one, value), MOST_COMBINATIONS):
            try:
                return scenario.with_settings(settings)
            except InputError:
                continue
        raise error


def _combinations(vary: tuple[Varied, ...], one: Varied, value: Any) -> Iterator[dict[str, Any]]:
    choices = [[value] if other is one else _choices(other) for other in vary]
    for chosen in product(*choices):
        yield {other.key: each for other, each in zip(vary, chosen, strict=True)}


def _choices(one: Varied) -> list[Any]:
    return [0.5 * (one.lower + one.upper)] if isinstance(one, Range) else list(one.values)
