"""What the legs of a run warn of: a warning that several of them have is told once, with when they began."""

from __future__ import annotations

import re
from collections.abc import Sequence

from nmm.words import listed

_NUMBER = re.compile(r"-?\d[\d.]*(?:e[+-]?\d+)?")


def told_once(legs: Sequence[tuple[str, float, Sequence[str]]]) -> list[str]:
    """The warnings of all legs; those that differ in numbers alone stand once, as the first leg has them.

    Parameters
    ----------
    legs : of each what it is called ("with reach from t = 0 to 2 s: "), when it began, s, and its warnings
    """
    alike: dict[str, list[tuple[str, float, str]]] = {}
    for called, begins, warnings in legs:
        for warning in warnings:
            # What is beyond a colon or semicolon explains, and may differ.
            kind = re.split(r"[:;]", _NUMBER.sub("#", warning), maxsplit=1)[0]
            alike.setdefault(kind, []).append((called, begins, warning))
    said = []
    for found in alike.values():
        called, begins, warning = found[0]
        others = list(dict.fromkeys(f"{later:.4g}" for _, later, _ in found if later != begins))
        if len({text for *_, text in found}) == 1 and len(others) + 1 == len(legs):
            said.append(warning)  # of the whole run
        else:
            also = f"; likewise with the tasks from t = {listed(others)} s on" if others else ""
            said.append(f"{called}{warning}{also}")
    return said
