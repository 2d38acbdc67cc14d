"""singularities --search and --nearest: families of singular configurations, and the nearest one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from nmm.cli.output import progress, show_table, show_text
from nmm.words import listed, value_text

if TYPE_CHECKING:
    from nmm.analysis.search.family import SingularFamily
    from nmm.analysis.search.many_starts import SingularitySearch
    from nmm.analysis.search.nearest import SingularPoint
    from nmm.cli.subjects import Studied


def search_command(
    studied: Studied,
    starts: int | None = None,
    seed: int = 0,
    part: str = "robot",
    nearest: bool = False,
    length: float | None = None,
) -> None:
    """Search all singular configurations, the nearest to the one studied, or both; print what was found.

    Parameters
    ----------
    starts : local minimisations of the search; None for no search of families
    nearest : whether to look for the nearest to `studied.q`
    length : so many m count as 1 rad
    """
    from nmm.analysis.search.many_starts import find_singularities
    from nmm.analysis.search.nearest import nearest_singularity

    if starts is not None:
        with progress("searching") as report:
            show_search(
                find_singularities(
                    studied.subject,
                    starts=starts,
                    seed=seed,
                    at=studied.q,
                    part=part,
                    t=studied.t,
                    length=length,
                    progress=report,
                )
            )
    if nearest:
        with progress("the nearest") as report:
            found = nearest_singularity(
                studied.subject, studied.q, seed=seed, part=part, t=studied.t, length=length, progress=report
            )
        if starts is not None:
            show_text()
        show_nearest(found)


def show_search(search: SingularitySearch) -> None:
    """The families in a table, what each loses and where, what was searched."""
    from nmm.analysis.search.family import of_starts

    show_text(search.summary)
    if search.found and not search.everywhere:
        show_table(
            ["", "where", "free", "dimension", "rank", "starts"],
            [_row(number, family) for number, family in enumerate(search.families, 1)],
            numeric=["dimension", "rank", "starts"],
        )
    for number, family in enumerate(search.families, 1):
        at = _values(family.names, family.examples[0], search.units, leave_out=search.indifferent)
        which = "" if search.everywhere else f"{number} "
        show_text(f"{which}loses {listed(family.lost)}{f', at {at}' if at else ''}")
    if search.unsorted:
        show_text(f"{of_starts(search.unsorted)} ended where families meet")
    if search.smallest is not None:
        at = _values(tuple(search.units), search.smallest.q, search.units, leave_out=search.indifferent)
        show_text(f"{search.smallest.text}, at {at}")
    show_text(f"searched: {search.searched_text}")
    if search.indifferent:
        show_text(f"J's singular values do not depend on {', '.join(search.indifferent)}")


def show_nearest(point: SingularPoint | None) -> None:
    """The nearest singular configuration, what moves and by how much, what is lost there."""
    if point is None:
        show_text("no singular configuration found near this one, nor elsewhere inside the limits")
        return
    show_text(point.summary)
    if point.changes:
        units = dict(zip(point.names, point.units, strict=True))
        there = dict(zip(point.names, point.q, strict=True))
        show_table(
            ["", "there", "change"],
            [
                (name, _value(there[name], units[name]), _value(change, units[name]))
                for name, change in point.changes.items()
            ],
        )
        show_text(f"loses {listed(point.lost)} (rank {point.rank} of {point.full_rank})")
    show_text(point.family_text)
    if point.changes:
        show_text(point.proof_text)


def _row(number: int, family: SingularFamily) -> tuple[str, ...]:
    return (
        str(number),
        family.conditions,
        ", ".join(family.free) or "nothing",
        f"{family.dimension} of {family.moving}",
        f"{family.rank} of {family.full_rank}",
        str(family.starts),
    )


def _value(value: float, unit: str) -> str:
    return value_text(float(value), unit)


def _values(
    names: Iterable[str], q: Iterable[float], units: Mapping[str, str], leave_out: Iterable[str]
) -> str:
    left = set(leave_out)
    return ", ".join(
        f"{name} = {_value(value, units[name])}"
        for name, value in zip(names, q, strict=True)
        if name not in left
    )
