"""Values of rows and auxiliary quantities, written; headings as sums of angles where they are such."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, NamedTuple

import sympy

from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.expressions import Product, Sum, Symbol, alone, latex, text, to_sympy
from nmm.analysis.formulas.quotient import Linear
from nmm.analysis.formulas.readable import as_sum, factored
from nmm.analysis.formulas.row_values import Auxiliary, Share, Turn, Value


class Written(NamedTuple):
    """A formula in three forms."""

    expression: Any
    text: str
    latex: str


#: Names of a rotation vector's components; as functions of the matrix' nine entries, row by row.
ROTATION_VECTOR = tuple(f"rotation_vector_{axis}" for axis in "xyz")


def written(value: Value, symbols: Mapping[str, Any]) -> Written:
    """A row's value; the value of an angle is not wrapped."""
    if isinstance(value, Expansion):
        return _of(factored(value), symbols)
    if isinstance(value, Linear):
        return _linear(value, symbols)
    if isinstance(value, Share):
        return _of(alone(Symbol(value.angle)).times(factored(value.factor)), symbols)
    if isinstance(value, Turn):
        axis = "xyz"[value.part]
        return Written(
            sympy.Function(ROTATION_VECTOR[value.part])(*_matrix(value, symbols)),
            f"log({value.name}).{axis}",
            rf"\log({value.name})_{axis}",
        )
    sine, cosine = (_of(factored(part), symbols) for part in (value.sine, value.cosine))
    return _atan2(sine, cosine)


def matrix_text(turn: Turn) -> str:
    """A rotation as a product of turns: Rz(theta + q1) Ry(q2)."""
    return _turns_written(turn, text, "R{axis}({angle})", "pi/2", "pi")


def matrix_latex(turn: Turn) -> str:
    """The same as LaTeX."""
    return _turns_written(turn, latex, "R_{axis}({angle})", r"\frac{\pi}{2}", r"\pi")


def _turns_written(turn: Turn, style: Callable[[Product], str], form: str, half: str, whole: str) -> str:
    written = []
    for axis, angle, quarters in turn.product:
        inside = (
            style(_sum([Product(Fraction(n), ((Symbol(name), 1),)) for name, n in angle])) if angle else ""
        )
        constant = {0: "", 1: f" + {half}", 2: f" + {whole}", 3: f" - {half}"}[quarters]
        if not inside:
            constant = constant.replace(" + ", "").replace(" - ", "-")
        written.append(form.replace("{axis}", "xyz"[axis]).replace("{angle}", inside + constant))
    return " ".join(written) or "1"


def _matrix(turn: Turn, symbols: Mapping[str, Any]) -> Any:
    """A rotation as a SymPy matrix."""
    product = sympy.eye(3)
    for axis, angle, quarters in turn.product:
        total = sympy.Add(*(n * symbols[name] for name, n in angle), quarters * sympy.pi / 2)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        matrix = sympy.eye(3)
        matrix[i, i] = matrix[j, j] = sympy.cos(total)
        matrix[i, j], matrix[j, i] = -sympy.sin(total), sympy.sin(total)
        product = product * matrix
    return product


def auxiliary_written(auxiliary: Auxiliary, symbols: Mapping[str, Any]) -> Written:
    """What an auxiliary symbol stands for."""
    everything = [_of(as_sum(argument), symbols) for argument in auxiliary.arguments]
    if auxiliary.kind == "root":
        (a,) = everything
        return Written(sympy.sqrt(a.expression), f"sqrt({a.text})", rf"\sqrt{{{a.latex}}}")
    a, b, *rest = everything
    if auxiliary.kind == "length":
        return _hypot(*everything)
    if auxiliary.kind == "bearing":
        up, along = b, a
    elif auxiliary.kind == "elevation":
        up, along = rest[0], _hypot(a, b)
    else:
        up, along = _hypot(b, rest[0]), a
    angle = _atan2(up, along)
    if auxiliary.kind != "over sine":
        return angle
    return Written(
        1 / sympy.sinc(angle.expression),
        f"a/sin(a), a = {angle.text}",
        rf"a / \sin a, \; a = {angle.latex}",
    )


def _hypot(*parts: Written) -> Written:
    return Written(
        sympy.sqrt(sympy.Add(*(part.expression**2 for part in parts))),
        f"hypot({', '.join(part.text for part in parts)})",
        r"\sqrt{" + " + ".join(f"({part.latex})^2" for part in parts) + "}",
    )


def _atan2(sine: Written, cosine: Written) -> Written:
    return Written(
        sympy.atan2(sine.expression, cosine.expression),
        f"atan2({sine.text}, {cosine.text})",
        rf"\mathrm{{atan2}}({sine.latex}, {cosine.latex})",
    )


def _of(product: Product, symbols: Mapping[str, Any]) -> Written:
    return Written(to_sympy(product, symbols), text(product), latex(product))


def _sum(terms: list[Product]) -> Product:
    return terms[0] if len(terms) == 1 else alone(Sum(tuple(terms)))


def _linear(value: Linear, symbols: Mapping[str, Any]) -> Written:
    """A combination of coordinates, and a number of quarter turns or what else is added."""
    names = value.ring.names
    terms = [Product(n, ((Symbol(names[i]), 1),)) for i, n in value.terms.items()]
    quarters, rest = value.quarters
    if rest:
        return _of(_sum([*terms, Product(value.constant)]), symbols)
    found = _of(_sum(terms), symbols)
    if not quarters:
        return found
    turn = {1: " + pi/2", 2: " + pi", -1: " - pi/2"}.get(quarters, f" {quarters:+d} pi/2")
    return Written(
        found.expression + quarters * sympy.pi / 2,
        found.text + turn,
        found.latex + turn.replace("pi/2", r"\frac{\pi}{2}").replace("+ pi", r"+ \pi"),
    )
