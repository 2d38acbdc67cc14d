"""What a symbolic analysis says as plain text and as LaTeX."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nmm.analysis.symbolic_tree import GREEK, latex, latex_name, text

#: So many minors that are 0 are not listed.
_MANY = 4

if TYPE_CHECKING:
    from nmm.analysis.symbolic import SymbolicAnalysis


def minor_name(columns: tuple[str, ...]) -> str:
    """ "Δ[v, omega, q2]"."""
    return f"Δ[{', '.join(columns)}]"


def text_of(analysis: SymbolicAnalysis) -> str:
    """Task, matrix entries that are not zero, named factors, minors; one formula a line."""
    lines = ["f"]
    lines += [
        f"  {name} = {value.text}" for name, value in zip(analysis.row_names, analysis.values, strict=True)
    ]
    lines.append("J, whose columns are " + ", ".join(analysis.u_names))
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


def latex_of(analysis: SymbolicAnalysis) -> str:
    """f, J and the minors; one align* environment."""
    lines = []
    for i, value in enumerate(analysis.values, 1):
        lines.append(f"f_{{{i}}} &= {value.latex}")
    lines += [f"{latex_name(name)} &= {latex(form)}" for name, form in analysis.named_forms.items()]
    rows = [" & ".join(latex(entry) for entry in row) for row in analysis.short_entries]
    lines.append("J &= \\begin{bmatrix} " + r" \\ ".join(rows) + " \\end{bmatrix}")
    for columns, form in analysis.short_forms.items():
        names = ",".join(latex_name(name) for name in columns)
        lines.append(rf"\Delta_{{{names}}} &= {latex(form)}")
    return "\\begin{align*}\n  " + " \\\\\n  ".join(lines) + "\n\\end{align*}"
