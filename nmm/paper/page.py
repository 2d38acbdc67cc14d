"""index.html, from its templates."""

from __future__ import annotations

from collections.abc import Sequence

from nmm import __version__
from nmm.paper.cases import CASES, DT, RESOLVERS
from nmm.paper.results import CaseResult
from nmm.templates import template


def render(results: Sequence[CaseResult]) -> str:
    """The page of these cases; every link in it is relative to the page's folder."""
    claims = [claim for result in results for claim in result.claims]
    return template("nmm.paper", "templates", "index.html").render(
        cases=[(CASES[result.number - 1], result) for result in results],
        resolvers=RESOLVERS,
        dt_ms=f"{1000.0 * DT:g}",
        version=__version__,
        holding=sum(claim.holds for claim in claims),
        claims=len(claims),
    )
