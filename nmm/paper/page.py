"""index.html, from its templates."""

from __future__ import annotations

from collections.abc import Sequence

from jinja2 import Environment, PackageLoader, StrictUndefined

from nmm import __version__
from nmm.paper.cases import CASES, DT, RESOLVERS
from nmm.paper.results import CaseResult


def render(results: Sequence[CaseResult]) -> str:
    """The page of these cases; every link in it is relative to the page's folder."""
    environment = Environment(
        loader=PackageLoader("nmm.paper", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    claims = [claim for result in results for claim in result.claims]
    return environment.get_template("index.html").render(
        cases=[(CASES[result.number - 1], result) for result in results],
        resolvers=RESOLVERS,
        dt_ms=f"{1000.0 * DT:g}",
        version=__version__,
        holding=sum(claim.holds for claim in claims),
        claims=len(claims),
    )
