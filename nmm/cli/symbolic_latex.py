"""What `nmm singularities --symbolic --latex` prints: all that `--symbolic` says, as a document's body."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import takewhile
from typing import TYPE_CHECKING

from nmm.analysis.formulas.expressions import latex_name
from nmm.analysis.formulas.text import zeros_summed
from nmm.analysis.singular.minors import Columns
from nmm.cli.mathematics import typeset
from nmm.cli.singularity_words import header
from nmm.cli.symbolic_text import geometry, only, what_follows
from nmm.words import counted, listed

if TYPE_CHECKING:
    from nmm.analysis.formulas import SymbolicAnalysis
    from nmm.cli.subjects import Studied

#: A line about the command itself, which a paper does not print.
_HINT = "--set "


def show_latex(given: Studied, analysis: SymbolicAnalysis, chosen: Sequence[Columns] | None) -> None:
    """Print the body, and nothing else."""
    print("\n".join(_body(given, analysis, only(analysis, chosen))))


def _body(given: Studied, analysis: SymbolicAnalysis, shown: SymbolicAnalysis) -> Iterator[str]:
    """The lines; `shown` has the chosen minors alone, what follows is of all."""
    from nmm import __version__

    names = {*analysis.symbols, *analysis.u_names, *analysis.definition_latex}

    def sentence(line: str) -> str:
        written = typeset(line, names).rstrip(".")  # one that begins with a symbol begins with a dollar
        return f"{written[0].upper()}{written[1:]}."

    formulas = shown.latex()
    conclusions = list(_listed(what_follows(given, analysis), names))
    yield f"% nmm {__version__}; needs \\usepackage{{amsmath}}"
    who, *what = header(given)
    yield f"{typeset(who, names)}."
    yield from map(sentence, what)
    yield from map(sentence, geometry(analysis, shown.text()))
    rows = [rf"$f_{{{i}}}$ ({typeset(name, names)})" for i, name in enumerate(analysis.row_names, 1)]
    yield f"The task's value has the rows {listed(rows)}; the columns of $J$ are named after the inputs."
    if analysis.derivation.target_moves:
        yield "The target $g$ depends on $q$, too."
    yield r"$\Delta$ with the names of columns is their minor."
    abbreviations = _abbreviations(f"{formulas} {' '.join(conclusions)}", {*analysis.symbols})
    if abbreviations:
        yield f"Short forms: {', '.join(abbreviations)}."
    yield rf"\begingroup\allowdisplaybreaks{chr(10)}{formulas}{chr(10)}\endgroup"
    if summed := zeros_summed(shown):
        yield f"The other {counted(summed, 'maximal minor')} are $0$."
    yield "What follows:"
    yield from conclusions
    yield from map(sentence, analysis.notes)


def _abbreviations(body: str, taken: set[str]) -> list[str]:
    """What each cosine and sine stands for that is written short: c_{12} = cos(q_1 + q_2)."""
    found = set(re.findall(r"\b([cs])_\{(\d+)\}", body))
    found -= {(name[0], name[1:]) for name in taken if re.fullmatch(r"[cs]\d+", name)}
    functions = {"c": r"\cos", "s": r"\sin"}
    return [
        f"${kind}_{{{digits}}} = {functions[kind]}"
        f"({' + '.join(latex_name(f'q{digit}') for digit in digits)})$"
        for kind, digits in sorted(found, key=lambda one: (len(one[1]), one[1], one[0]))
    ]


def _listed(lines: Sequence[str], names: set[str]) -> Iterator[str]:
    """Statements as items, with their reasons as items below."""
    yield r"\begin{itemize}"
    rest = list(lines)
    while rest:
        statement, *rest = rest
        below = list(takewhile(lambda line: line.startswith(" "), rest))
        rest = rest[len(below) :]
        yield rf"\item {typeset(statement, names)}"
        reasons = [line.strip() for line in below]
        yield from (f"% {line}" for line in reasons if line.startswith(_HINT))
        reasons = [line for line in reasons if not line.startswith(_HINT)]
        if reasons:
            yield r"  \begin{itemize}"
            yield from (rf"  \item {typeset(line, names)}" for line in reasons)
            yield r"  \end{itemize}"
    yield r"\end{itemize}"
