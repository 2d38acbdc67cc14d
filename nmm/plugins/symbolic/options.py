"""The options of `nmm singularities` for formulas and for searches, and what it says of a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from nmm.base.errors import InputError, expect
from nmm.base.plugins import OptionGroup
from nmm.cli.options import flag, option
from nmm.cli.output import OK, progress

#: From how many configurations a search starts.
STARTS = 200
NOT_FOUND = "no singular configuration found near this one, nor elsewhere inside the limits"


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
        from nmm.cli.document import say
        from nmm.plugins.symbolic.search.many_starts import find_singularities
        from nmm.plugins.symbolic.search.nearest import nearest_singularity

        studied, length = subject
        options: dict[str, Any] = {
            "seed": self.seed or 0, "part": self.part or "robot", "length": length, "t": studied.t,
        }  # fmt: skip
        if self.search:
            starts = STARTS if self.starts is None else self.starts
            with progress("searching") as options["progress"]:
                search = find_singularities(studied.subject, starts=starts, at=studied.q, **options)
            say(search.text())
        if self.nearest:
            with progress("the nearest") as options["progress"]:
                point = nearest_singularity(studied.subject, studied.q, **options)
            if self.search:
                say()
            say(NOT_FOUND if point is None else point.text())
        return OK
