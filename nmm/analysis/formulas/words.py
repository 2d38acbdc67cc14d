"""What a symbolic analysis says as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from nmm.analysis.formulas.form import in_names
from nmm.analysis.formulas.tree import GREEK, Product, Trig, latex, latex_name, text
from nmm.analysis.singular.minors import minor_name

#: So many minors that are 0 are not listed.
_MANY = 4

if TYPE_CHECKING:
    from nmm.analysis.formulas.analysis import SymbolicAnalysis


def condition_text(factor: Product, names: Mapping[str, Product]) -> str:
    """A factor of a minor where it is said to vanish: "sin(q2)", "Λ", "d + Λ c1"."""
    node = factor.factors[0][0]
    if isinstance(node, Trig) and len(node.angle) == 1 and node.angle[0][1] == 1:
        return f"{node.kind}({node.angle[0][0]})"
    return text(in_names(factor, names))


def text_of(analysis: SymbolicAnalysis) -> str:
    """Task, matrix entries that are not zero, named factors, minors; one formula a line."""
    lines = ["f"]
    lines += [
        f"  {name} = {value.text}" for name, value in zip(analysis.row_names, analysis.values, strict=True)
    ]
    moving = analysis.derivation.target_moves
    matrix = "J_bar = (df/dq - dg/dq) S, as the target g depends on q, too, and its" if moving else "J, whose"
    lines.append(f"{matrix} columns are {', '.join(analysis.u_names)}")
    for name, row in zip(analysis.row_names, analysis.short_entries, strict=True):
        lines += [
            f"  [{name}, {column}] = {text(entry)}"
            for column, entry in zip(analysis.u_names, row, strict=True)
            if entry.number
        ]
    if analysis.definition_texts or analysis.named_forms:
        lines.append("with")
        lines += [f"  {name} = {value}" for name, value in analysis.definition_texts.items()]
    lines += [f"  {GREEK[name]} = {text(form)}" for name, form in analysis.named_forms.items()]
    lines.append("maximal minors")
    zeros = [columns for columns, form in analysis.short_forms.items() if not form.number]
    for columns, form in analysis.short_forms.items():
        if form.number or len(zeros) < _MANY:
            lines.append(f"  {minor_name(columns)} = {text(form)}")
    if len(zeros) >= _MANY:
        lines.append(f"  the other {len(zeros)} are 0")
    lines += [f"note: {note}" for note in analysis.notes]
    return "\n".join(lines)


def latex_lines(analysis: SymbolicAnalysis) -> list[tuple[str, str]]:
    """Left and right sides: f, what auxiliary symbols are, named factors, minors."""
    lines = [(f"f_{{{i}}}", value.latex) for i, value in enumerate(analysis.values, 1)]
    lines += [(latex_name(name), value) for name, value in analysis.definition_latex.items()]
    lines += [(latex_name(name), latex(form)) for name, form in analysis.named_forms.items()]
    zeros = sum(not form.number for form in analysis.short_forms.values())
    for columns, form in analysis.short_forms.items():
        if form.number or zeros < _MANY:
            names = ",".join(latex_name(name) for name in columns)
            lines.append((rf"\Delta_{{{names}}}", latex(form)))
    return lines


def latex_of(analysis: SymbolicAnalysis) -> str:
    """The same and J; one align* environment."""
    rows = [" & ".join(latex(entry) for entry in row) for row in analysis.short_entries]
    matrix = "\\begin{bmatrix} " + r" \\ ".join(rows) + " \\end{bmatrix}"
    lines = [*latex_lines(analysis), ("J", matrix)]
    return (
        "\\begin{align*}\n  "
        + " \\\\\n  ".join(f"{left} &= {right}" for left, right in lines)
        + "\n\\end{align*}"
    )
