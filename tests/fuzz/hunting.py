"""What a hunt is: cases that are drawn, and what must hold for each of them."""

from __future__ import annotations

import hashlib
import json
import os
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from nmm.base.errors import NmmError

KEPT = Path(__file__).parent / "kept"
#: An error is read by a person: one line, and not a page.
LONGEST_LINE = 10_000
#: What a hostile value is made of, and how much of it an error may repeat.
ECHO = 300 * "a"
#: No case takes longer, in seconds of processor of this process and those that it has started and ended.
PATIENCE = 60.0


@dataclass(frozen=True)
class Hunt:
    """Cases (plain data) and a check, which returns in a word what came of one, and raises what must not."""

    name: str
    cases: st.SearchStrategy[Any]
    check: Callable[[Any], str]


@dataclass
class Found:
    """What came of a hunt."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: list[tuple[Any, BaseException]] = field(default_factory=list)
    seconds: float = 0.0


def tried(hunt: Hunt, case: Any) -> str:
    """Check one case, within its time and without a warning of NumPy's that nobody asked for."""
    began = sum(os.times()[:4])
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        word = hunt.check(case)
    took = sum(os.times()[:4]) - began
    assert took < PATIENCE, f"took {took:.1f} s"
    return word


def refused(error: NmmError) -> str:
    """An error as it has to be: one line that a person can read."""
    text = str(error)
    assert text.strip(), "an error without a word"
    assert len(text) <= LONGEST_LINE, f"an error of {len(text)} characters: {text[:200]} …"
    assert ECHO not in text, f"an error that repeats a value: {text[:200]} …"
    assert text.isprintable(), f"an error with control characters: {text[:200]!r}"
    return "refused"


def some(hunt: Hunt, examples: int) -> Found:
    """The same few cases each time: for the gate. The first that fails raises."""
    found = Found()

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(hunt.cases)
    def go(case: Any) -> None:
        found.counts[tried(hunt, case)] += 1

    began = time.monotonic()
    go()
    found.seconds = time.monotonic() - began
    return found


def many(hunt: Hunt, seconds: float, keep: Path = KEPT) -> Found:
    """Other cases each time, until the time is over; failures are made small, kept as files, and told."""
    found, began = Found(), time.monotonic()
    known: set[str] = set()
    while time.monotonic() - began < seconds:
        failing: list[tuple[Any, BaseException]] = []

        def fails(case: Any, failing: list[tuple[Any, BaseException]] = failing) -> bool:
            if not failing and time.monotonic() - began > seconds:
                return False
            try:
                found.counts[tried(hunt, case)] += 1
                return False
            except Exception as caught:  # whatever it is: that is what is hunted
                error = caught
            if _where(error) in known:
                found.counts["known failure"] += 1
                return False
            if failing and _where(failing[0][1]) != _where(error):
                return False
            failing[:] = [(case, error)]
            return True

        try:
            find(
                hunt.cases,
                fails,
                settings=settings(
                    max_examples=200, deadline=None, database=None, suppress_health_check=list(HealthCheck)
                ),
            )
        except NoSuchExample:
            continue
        case, error = failing[0]
        known.add(_where(error))
        found.failures.append((case, error))
        kept(hunt, case, keep)
    found.seconds = time.monotonic() - began
    return found


def kept(hunt: Hunt, case: Any, keep: Path) -> Path:
    """The file of a case that failed."""
    text = json.dumps(case, indent=1, ensure_ascii=True, sort_keys=True)
    keep.mkdir(exist_ok=True)
    path = keep / f"{hunt.name}-{hashlib.sha256(text.encode()).hexdigest()[:10]}.json"
    path.write_text(text + "\n", encoding="utf-8")
    return path


def _where(error: BaseException) -> str:
    """What tells one failure from another: its type and the line that raised it."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = "" if trace is None else f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}"
    return f"{type(error).__name__} {place}"
