"""What a symbolic analysis says as plain text and as LaTeX."""

from __future__ import annotations

from nmm.analysis.formulas.expressions import GREEK, latex, latex_name, text
from nmm.analysis.formulas.result import Formulas
from nmm.analysis.singular.minors import minor_name

#: So many minors that are 0 are not listed.
_MANY = 4


def text_of(formulas: Formulas) -> str:
    """Task, matrix entries that are not zero, named factors, minors; one formula a line."""
    lines = ["f"]
    lines += [
        f"  {name} = {value.text}" for name, value in zip(formulas.row_names, formulas.values, strict=True)
    ]
    moving = formulas.derivation.target_moves
    matrix = "J_bar = (df/dq - dg/dq) S, as the target g depends on q, too, and its" if moving else "J, whose"
    lines.append(f"{matrix} columns are {', '.join(formulas.u_names)}")
    for name, row in zip(formulas.row_names, formulas.short_entries, strict=True):
        lines += [
            f"  [{name}, {column}] = {text(entry)}"
            for column, entry in zip(formulas.u_names, row, strict=True)
            if entry.number
        ]
    if formulas.definition_texts or formulas.named_forms:
        lines.append("with")
        lines += [f"  {name} = {value}" for name, value in formulas.definition_texts.items()]
    lines += [f"  {GREEK[name]} = {text(form)}" for name, form in formulas.named_forms.items()]
    lines.append("maximal minors")
    summed = zeros_summed(formulas)
    for columns, form in formulas.short_forms.items():
        if form.number or not summed:
            lines.append(f"  {minor_name(columns)} = {text(form)}")
    if summed:
        lines.append(f"  the other {summed} are 0")
    lines += [f"note: {note}" for note in formulas.notes]
    return "\n".join(lines)


def zeros_summed(formulas: Formulas) -> int:
    """How many minors that are 0 are not listed, as they are many."""
    zeros = sum(not form.number for form in formulas.short_forms.values())
    return zeros if zeros >= _MANY else 0


def latex_lines(formulas: Formulas) -> list[tuple[str, str]]:
    """Left and right sides: f, what auxiliary symbols are, named factors, minors."""
    lines = [(f"f_{{{i}}}", value.latex) for i, value in enumerate(formulas.values, 1)]
    lines += [(latex_name(name), value) for name, value in formulas.definition_latex.items()]
    lines += [(latex_name(name), latex(form)) for name, form in formulas.named_forms.items()]
    summed = zeros_summed(formulas)
    for columns, form in formulas.short_forms.items():
        if form.number or not summed:
            names = ",".join(latex_name(name) for name in columns)
            lines.append((rf"\Delta_{{{names}}}", latex(form)))
    return lines


def latex_of(formulas: Formulas) -> str:
    """The same, and J column by column after f, as columns of a page are narrow; one align* environment."""
    lines = latex_lines(formulas)
    names = [f"J_{{{latex_name(name)}}}" for name in formulas.u_names]
    moving = formulas.derivation.target_moves
    of = r"\frac{\partial f}{\partial q}"
    of = rf"\left({of} - \frac{{\partial g}}{{\partial q}}\right)" if moving else of
    side_by_side = r" \; ".join(names)
    columns = [("J", rf"{of} S = [\, {side_by_side} \,]")]
    for name, column in zip(names, zip(*formulas.short_entries, strict=True), strict=True):
        entries = r" \\ ".join(map(latex, column))
        columns.append((name, rf"\begin{{bmatrix}} {entries} \end{{bmatrix}}"))
    after_f = len(formulas.values)
    lines[after_f:after_f] = columns
    return (
        "\\begin{align*}\n  "
        + " \\\\\n  ".join(f"{left} &= {right}" for left, right in lines)
        + "\n\\end{align*}"
    )
