"""How a run ended, and what is to be said of it: the outcome, its reasons and the warnings, as findings."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from nmm.base.findings import Finding
from nmm.base.findings.run import MOTORS, line


class Outcome(StrEnum):
    """How a run ended (docs/outcomes.md).

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_3r_out_of_reach").run()
    >>> run.outcome is nmm.Outcome.MISSED, run.complete
    (True, False)
    """

    COMPLETED = "completed"
    MISSED = "missed"
    SINGULAR = "singular"
    DIVERGED = "diverged"
    UNSTABLE = "unstable"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


#: Findings that are told on one line: what was seen, and why.
FindingLine = tuple[Finding, ...]


@dataclass(frozen=True)
class Verdict:
    """An outcome with its reasons (the run's message) and warnings, a line each."""

    outcome: Outcome = Outcome.COMPLETED
    reasons: FindingLine = ()
    warnings: tuple[FindingLine, ...] = ()

    def after(self, warnings: Sequence[Finding]) -> Verdict:
        """The same with other warnings first."""
        return replace(self, warnings=(*((finding,) for finding in warnings), *self.warnings))

    def as_json(self) -> list[dict[str, Any]]:
        """Each finding with the line of which it is a part: "message", or "warnings.0" and so on."""
        lines = {"message": self.reasons} | {f"warnings.{i}": line for i, line in enumerate(self.warnings)}
        return [{**finding.as_json(), "line": name} for name, line in lines.items() for finding in line]


#: Of a run that reached its end, with nothing to say of it.
AS_ASKED = Verdict()


def verdict_of(
    outcome: Outcome, message: str, warnings: Sequence[str], findings: Sequence[Mapping[str, Any]] | None
) -> Verdict:
    """The verdict in a run's folder, from its findings or, in older folders, its sentences."""
    lines: dict[str, FindingLine] = {}
    if findings is None:
        texts = {"message": message} | {f"warnings.{i}": text for i, text in enumerate(warnings)}
        findings = [
            {"code": "said", "values": {"text": texts[name]}, "line": name} for name in texts if texts[name]
        ]
    for finding in findings:
        if finding["line"] == MOTORS:  # found anew, from the motion
            continue
        lines[finding["line"]] = (*lines.get(finding["line"], ()), _finding_of(finding))
    return Verdict(outcome, lines.pop("message", ()), tuple(lines.values()))


def _finding_of(saved: Mapping[str, Any]) -> Finding:
    """The finding, or its sentence if its code or values are another version's."""
    finding = Finding.from_json(saved)
    with suppress(LookupError, TypeError, ValueError, AttributeError, OverflowError):
        if line([finding]):
            return finding
    return Finding("said", {"text": saved["text"]})


class Awaited:
    """The verdict on a run that went wrong, for which a shorter dt is tried on first access.

    `find` takes as long as a few runs; the first thread to read calls it, once. The outcome may be known
    before.
    """

    def __init__(self, find: Callable[[], Verdict], outcome: Outcome | None) -> None:
        self._find: Callable[[], Verdict] | None = find
        self._outcome, self._found = outcome, Verdict()
        self._lock = threading.RLock()

    @property
    def outcome(self) -> Outcome:
        return self._outcome or self._found_out().outcome

    @property
    def reasons(self) -> FindingLine:
        return self._found_out().reasons

    @property
    def warnings(self) -> tuple[FindingLine, ...]:
        return self._found_out().warnings

    def after(self, warnings: Sequence[Finding]) -> Awaited:
        return Awaited(lambda: self._found_out().after(warnings), self._outcome)

    def as_json(self) -> list[dict[str, Any]]:
        return self._found_out().as_json()

    def _found_out(self) -> Verdict:
        with self._lock:
            if self._find is not None:
                self._found, self._find = self._find(), None  # an interrupt leaves it to the next who reads
            return self._found

    def __reduce__(self) -> tuple[Callable[..., Verdict], tuple[Any, ...]]:
        """Copies and pickles hold the verdict, as `find` holds a controller."""
        verdict = self._found_out()
        return Verdict, (verdict.outcome, verdict.reasons, verdict.warnings)
