"""The four cases of the paper's section VI: which scenario, which figures, what the axes call things."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes
    ----------
    number : 1 to 4
    scenario : the bundled scenario
    title : a headline
    symbol : the objective's name
    zoom : end of the initial transient that the objective's figure enlarges, s
    figures : number and caption of the paper's two figures
    """

    number: int
    scenario: str
    title: str
    symbol: str
    zoom: float
    figures: tuple[tuple[int, str], tuple[int, str]]

    @property
    def folder(self) -> str:
        """Name of its folder in the paper's."""
        return f"case{self.number}"


#: The resolvers compared, the paper's own first.
RESOLVERS = ("rg", "pg")
#: Sample time of all runs, s.
DT = 0.005


def _comparison(symbol: str) -> str:
    return (
        f"RG and PG minimising {symbol}: the whole run with the initial transient enlarged (above), "
        "and on a logarithmic scale down to 10⁻⁸ of the largest value (below)."
    )


CASES = (
    Case(
        1,
        "unicycle_2r_position",
        "Position task, planar arm",
        "H₁(q)",
        2.5,
        (
            (3, "Trajectory tracking with RG. The platform backs up first, then drives round the circle."),
            (4, _comparison("H₁")),
        ),
    ),
    Case(
        2,
        "unicycle_2r_pointing",
        "Position and pointing task, planar arm",
        "H₂(q)",
        2.0,
        (
            (5, "Trajectory tracking and target pointing of link 2 with RG."),
            (6, _comparison("H₂")),
        ),
    ),
    Case(
        3,
        "unicycle_2r_link_pointing",
        "Configuration-dependent pointing task, planar arm",
        "H₃(q)",
        1.0,
        (
            (7, "Trajectory tracking and configuration-dependent target pointing of link 1 with RG."),
            (8, _comparison("H₃")),
        ),
    ),
    Case(
        4,
        "unicycle_3r_position",
        "Position task, elbow-type arm",
        "H₄(q)",
        0.6,
        (
            (9, "Position of the end-effector with RG; the reference motion is dashed."),
            (10, _comparison("H₄")),
        ),
    ),
)
