"""What the page says of the cases: plain data, which goes from process to process."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A quantity in the table of a case: its name, its unit, its value with RG and with PG as text."""

    name: str
    unit: str
    rg: str
    pg: str


@dataclass(frozen=True)
class Claim:
    """A statement about a case, where it comes from, what came out, and whether they agree."""

    statement: str
    source: str
    found: str
    holds: bool


@dataclass(frozen=True)
class CaseResult:
    """What the page says of a case, in plain data that goes from process to process.

    Attributes
    ----------
    number : of the case
    rows, claims : its numbers
    samples : of each run
    seconds : that running, drawing and writing took
    """

    number: int
    rows: tuple[Row, ...]
    claims: tuple[Claim, ...]
    samples: int
    seconds: float
