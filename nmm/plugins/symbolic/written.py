"""Values of rows and auxiliary quantities as they are written; headings as sums of angles where possible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

import sympy

from nmm.base.latex import Formula, formula
from nmm.plugins.symbolic.expansion import Expansion
from nmm.plugins.symbolic.expressions import Product, Sum, Symbol, alone, shown, to_sympy
from nmm.plugins.symbolic.quotient import Linear
from nmm.plugins.symbolic.readable import as_sum, factored


@dataclass(frozen=True)
class Arc:
    """An angle atan2(sine, cosine), with which no kernel can compute."""

    sine: Expansion
    cosine: Expansion


class Turn(NamedTuple):
    """Component 0, 1 or 2 of the rotation vector of a named matrix, the product of turns about an axis (0, 1,
    2) by angles and quarter turns."""

    part: int
    name: str
    product: tuple[tuple[int, tuple[tuple[str, int], ...], int], ...]


class Share(NamedTuple):
    """A factor times an angle, given by name."""

    angle: str
    factor: Expansion


Value: TypeAlias = Expansion | Arc | Linear | Turn | Share


class Auxiliary(NamedTuple):
    """A symbol for a quantity that would make formulas long. Of its arguments a, b, c, the kinds are:
    "length" of a vector (2 or 3), "bearing" atan2(b, a), "elevation" atan2(c, hypot(a, b)), "off axis"
    atan2(hypot(b, c), a), "over sine" (the angle off axis over its sine), "root" of a, "ahead" a itself,
    above 0, "share" a / b, and "log" of a."""

    name: str
    kind: str
    arguments: tuple[Expansion, ...]


def value_without(value: Value, variables: set[int]) -> Value:
    """A value with scalars set to 0."""
    if isinstance(value, Expansion):
        return value.without(variables)
    if isinstance(value, Arc):
        return Arc(value.sine.without(variables), value.cosine.without(variables))
    if isinstance(value, Share):
        return value._replace(factor=value.factor.without(variables))
    return value


class Written(NamedTuple):
    expression: Any
    formula: Formula


#: Names of a rotation vector's components; as functions of the matrix' nine entries, row by row.
ROTATION_VECTOR = tuple(f"rotation_vector_{axis}" for axis in "xyz")


def written(value: Value, symbols: Mapping[str, Any]) -> Written:
    """A row's value; angles are not wrapped."""
    if isinstance(value, Expansion):
        return _of(factored(value), symbols)
    if isinstance(value, Linear):
        return _linear(value, symbols)
    if isinstance(value, Share):
        return _of(alone(Symbol(value.angle)).times(factored(value.factor)), symbols)
    if isinstance(value, Turn):
        axis, expression = "xyz"[value.part], sympy.Function(ROTATION_VECTOR[value.part])
        text, latex = f"log({value.name}).{axis}", rf"\log({value.name})_{axis}"
        return Written(expression(*_matrix(value, symbols)), Formula(text, latex))
    sine, cosine = (_of(factored(part), symbols) for part in (value.sine, value.cosine))
    return _atan2(sine, cosine)


def rotation_formula(turn: Turn) -> Formula:
    """A rotation as a product of turns: Rz(theta + q1) Ry(q2)."""
    turns = [_turn(axis, angle, quarters) for axis, angle, quarters in turn.product]
    return Formula(" ".join(turns) or "1", " ".join(part.latex for part in turns) or "1")


def _turn(axis: int, angle: Sequence[tuple[str, int]], quarters: int) -> Formula:
    inside = [shown(_sum([Product(Fraction(n), ((Symbol(name), 1),)) for name, n in angle]))] if angle else []
    half = Formula("pi/2", r"\frac{\pi}{2}")
    added = {0: [], 1: [" + ", half], 2: [" + ", Formula("pi", r"\pi")], 3: [" - ", half]}[quarters]
    if added and not inside:
        added[0] = "-" if quarters == 3 else ""
    total = formula(*inside, *added)
    return Formula(f"R{'xyz'[axis]}({total})", f"R_{'xyz'[axis]}({total.latex})")


def _matrix(turn: Turn, symbols: Mapping[str, Any]) -> Any:
    product, about = sympy.eye(3), (sympy.rot_ccw_axis1, sympy.rot_ccw_axis2, sympy.rot_ccw_axis3)
    for axis, angle, quarters in turn.product:
        total = sympy.Add(*(n * symbols[name] for name, n in angle), quarters * sympy.pi / 2)
        product = product * about[axis](total)
    return product


def auxiliary_written(auxiliary: Auxiliary, symbols: Mapping[str, Any]) -> Written:
    a, *rest = everything = [_of(as_sum(argument), symbols) for argument in auxiliary.arguments]
    if auxiliary.kind == "root":
        root = Formula(f"sqrt({a.formula})", rf"\sqrt{{{a.formula.latex}}}")
        return Written(sympy.sqrt(a.expression), root)
    if auxiliary.kind == "ahead":
        return a
    if auxiliary.kind == "log":
        return Written(sympy.log(a.expression), Formula(f"log({a.formula})", rf"\log({a.formula.latex})"))
    if auxiliary.kind == "share":
        b = rest[0]
        text, latex = f"({a.formula}) / ({b.formula})", rf"\frac{{{a.formula.latex}}}{{{b.formula.latex}}}"
        return Written(a.expression / b.expression, Formula(text, latex))
    if auxiliary.kind == "length":
        return _hypot(*everything)
    if auxiliary.kind == "bearing":
        return _atan2(rest[0], a)
    if auxiliary.kind == "elevation":
        return _atan2(rest[1], _hypot(a, rest[0]))
    angle = _atan2(_hypot(*rest), a)
    if auxiliary.kind != "over sine":
        return angle
    text, latex = f"a/sin(a), a = {angle.formula}", rf"a / \sin a, \; a = {angle.formula.latex}"
    return Written(1 / sympy.sinc(angle.expression), Formula(text, latex))


def _hypot(*parts: Written) -> Written:
    text = f"hypot({', '.join(part.formula for part in parts)})"
    squares = " + ".join(f"({part.formula.latex})^2" for part in parts)
    root = sympy.sqrt(sympy.Add(*(part.expression**2 for part in parts)))
    return Written(root, Formula(text, rf"\sqrt{{{squares}}}"))


def _atan2(sine: Written, cosine: Written) -> Written:
    text = f"atan2({sine.formula}, {cosine.formula})"
    latex = rf"\mathrm{{atan2}}({sine.formula.latex}, {cosine.formula.latex})"
    return Written(sympy.atan2(sine.expression, cosine.expression), Formula(text, latex))


def _of(product: Product, symbols: Mapping[str, Any]) -> Written:
    return Written(to_sympy(product, symbols), shown(product))


def _sum(terms: list[Product]) -> Product:
    return terms[0] if len(terms) == 1 else alone(Sum(tuple(terms)))


def _linear(value: Linear, symbols: Mapping[str, Any]) -> Written:
    """A combination of coordinates plus quarter turns or another constant."""
    names = value.ring.names
    terms = [Product(n, ((Symbol(names[i]), 1),)) for i, n in value.terms.items()]
    quarters, rest = value.quarters
    if rest:
        return _of(_sum([*terms, Product(value.constant)]), symbols)
    combination = _of(_sum(terms), symbols)
    if not quarters:
        return combination
    turn = {1: " + pi/2", 2: " + pi", -1: " - pi/2"}.get(quarters, f" {quarters:+d} pi/2")
    turn_latex = turn.replace("pi/2", r"\frac{\pi}{2}").replace("+ pi", r"+ \pi")
    total = Formula(combination.formula + turn, combination.formula.latex + turn_latex)
    return Written(combination.expression + quarters * sympy.pi / 2, total)
