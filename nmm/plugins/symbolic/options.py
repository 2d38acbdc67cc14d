"""The options of `nmm singularities` for formulas and for searches, and what it says of a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from nmm.base.errors import InputError, expect
from nmm.base.plugins import OptionGroup
from nmm.base.text_format import listed, value_text
from nmm.cli.options import flag, option
from nmm.cli.output import OK, progress, show_table, show_text

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied
    from nmm.plugins.symbolic.search.many_starts import SingularitySearch
    from nmm.plugins.symbolic.search.nearest import SingularPoint

#: From how many configurations a search starts.
STARTS = 200


@dataclass(frozen=True)
class FormulaOptions(OptionGroup):
    """f, J and its minors as formulas, on a terminal or as LaTeX."""

    answers: ClassVar[tuple[str, ...]] = ("--symbolic",)

    symbolic: bool = flag("--symbolic", "f, J and its minors as formulas, and what follows from them.")
    latex: bool = flag("--latex", "With --symbolic: the same as LaTeX, the body of a document.")

    def asked(self) -> str:
        return "--symbolic" if self.symbolic else ""

    def check(self) -> None:
        expect(self.symbolic or not self.latex, "--latex", "--symbolic with it, whose formulas it writes")

    def answer(self, *subject: Any) -> int | None:
        """Show the formulas of a robot's task, with the minors that are named; None where there are none."""
        studied, minor = subject
        from nmm.analysis.singular.jacobians import Jacobians
        from nmm.cli.document import say
        from nmm.plugins.symbolic import symbolic
        from nmm.plugins.symbolic.cli import show_formulas, show_latex

        Jacobians(studied.subject)  # complains about what is wrong with the input, formulas or not
        try:
            formulas = symbolic(studied.robot, studied.task)
        except InputError as error:
            if self.latex:
                raise InputError(error.what, where="--latex") from None
            say(f"No formulas: {error.what}. Here are the numbers.")
            say()
            return None
        (show_latex if self.latex else show_formulas)(studied, formulas, minor)
        return OK


@dataclass(frozen=True)
class SearchOptions(OptionGroup):
    """Singular configurations that are searched: all of them, or the nearest."""

    answers: ClassVar[tuple[str, ...]] = ("--search", "--nearest")

    search: bool = flag("--search", "Look for singular configurations from many starts.")
    nearest: bool = flag("--nearest", "Look for the singular configuration nearest to --at.")
    starts: int | None = option("N", "From how many configurations --search starts.", show=str(STARTS))
    seed: int | None = option("N", "Draws other starts of --search and --nearest.", show="0")
    part: str | None = option(
        "NAME",
        "Of --search and --nearest: where this part is singular; platform, arm, or an arm's name.",
        show="the whole robot",
    )

    def asked(self) -> str:
        return "--search" if self.search else "--nearest" if self.nearest else ""

    def check(self) -> None:
        expect(self.search or self.starts is None, "--starts", "with --search")
        for name, value in (("--seed", self.seed), ("--part", self.part)):
            expect(self.asked() or value is None, name, "with --search or --nearest")

    def answer(self, *subject: Any) -> int | None:
        """Search for a robot with its task, with a characteristic length, and print the result."""
        studied, length = subject
        starts = STARTS if self.starts is None else self.starts
        options = {"seed": self.seed or 0, "part": self.part or "robot", "length": length}
        search_command(studied, starts if self.search else None, self.nearest, **options)
        return OK


def search_command(
    studied: Studied, starts: int | None = None, nearest: bool = False, **options: Any
) -> None:
    """Search all singular configurations from so many starts, the nearest to the one studied, or both; print
    what was found. `options` : seed, part and length of `find_singularities`."""
    from nmm.plugins.symbolic.search.many_starts import find_singularities
    from nmm.plugins.symbolic.search.nearest import nearest_singularity

    options["t"] = studied.t
    if starts is not None:
        with progress("searching") as options["progress"]:
            search = find_singularities(studied.subject, starts=starts, at=studied.q, **options)
        show_search(search)
    if nearest:
        with progress("the nearest") as options["progress"]:
            found = nearest_singularity(studied.subject, studied.q, **options)
        if starts is not None:
            show_text()
        show_nearest(found)


def show_search(search: SingularitySearch) -> None:
    """The families in a table, what each loses and where, what was searched."""
    show_text(search.summary)
    if search.found and not search.everywhere:
        rows = [
            (
                str(number),
                family.conditions,
                ", ".join(family.free) or "nothing",
                f"{family.dimension} of {family.moving}",
                f"{family.rank} of {family.full_rank}",
                str(family.starts),
            )
            for number, family in enumerate(search.families, 1)
        ]
        columns = ["", "where", "free", "dimension", "rank", "starts"]
        show_table(columns, rows, numeric=columns[3:])
    for number, family in enumerate(search.families, 1):
        at = search.configuration_text(family.examples[0])
        which = "" if search.everywhere else f"{number} "
        show_text(f"{which}loses {listed(family.lost)}{f', at {at}' if at else ''}")
    for line in search.remarks:
        show_text(line)


def show_nearest(point: SingularPoint | None) -> None:
    if point is None:
        show_text("no singular configuration found near this one, nor elsewhere inside the limits")
        return
    show_text(point.summary)
    if point.changes:
        rows = [
            (name, value_text(float(there), unit), value_text(point.changes[name], unit))
            for name, there, unit in zip(point.names, point.q, point.units, strict=True)
            if name in point.changes
        ]
        show_table(["", "there", "change"], rows)
    for line in point.remarks:
        show_text(line)
