"""The four cases of the paper's section VI: scenarios, figures, names of axes and results."""

from __future__ import annotations

from dataclasses import dataclass

#: The resolvers compared, the paper's own first.
RESOLVERS = ("rg", "pg")
#: Sampling period of all runs, s.
DT = 0.005


@dataclass(frozen=True)
class Case:
    """A case; `zoom`: end, s, of the transient enlarged in the objective's figure; `motion`: a caption."""

    number: int
    scenario: str
    title: str
    symbol: str
    zoom: float
    motion: str

    @property
    def folder(self) -> str:
        return f"case{self.number}"

    @property
    def figures(self) -> tuple[tuple[int, str], tuple[int, str]]:
        """Number and caption of the paper's two figures."""
        symbol = self.symbol.removesuffix("(q)")
        compared = (
            f"RG and PG minimising {symbol}: the whole run with the initial transient enlarged (above), "
            "and on a logarithmic scale down to 10⁻⁸ of the largest value (below)."
        )
        return (2 * self.number + 1, self.motion), (2 * self.number + 2, compared)


@dataclass(frozen=True)
class CaseRow:
    """A row of a case's table: name, unit, and values with RG and PG as text."""

    name: str
    unit: str
    rg: str
    pg: str


@dataclass(frozen=True)
class PaperClaim:
    """A statement about a case, its source, the result, and whether they agree."""

    statement: str
    source: str
    found: str
    holds: bool


@dataclass(frozen=True)
class CaseResult:
    """A case's results as plain data for other processes: numbers, each run's samples, durations, s."""

    number: int
    rows: tuple[CaseRow, ...]
    claims: tuple[PaperClaim, ...]
    samples: int
    seconds: float


CASES = (
    Case(
        1,
        "unicycle_2r_position",
        "Position task, planar arm",
        "H₁(q)",
        2.5,
        "Trajectory tracking with RG. The platform backs up first, then drives round the circle.",
    ),
    Case(
        2,
        "unicycle_2r_pointing",
        "Position and pointing task, planar arm",
        "H₂(q)",
        2.0,
        "Trajectory tracking and target pointing of link 2 with RG.",
    ),
    Case(
        3,
        "unicycle_2r_link_pointing",
        "Configuration-dependent pointing task, planar arm",
        "H₃(q)",
        1.0,
        "Trajectory tracking and configuration-dependent target pointing of link 1 with RG.",
    ),
    Case(
        4,
        "unicycle_3r_position",
        "Position task, elbow-type arm",
        "H₄(q)",
        0.6,
        "Position of the end-effector with RG; the reference motion is dashed.",
    ),
)
