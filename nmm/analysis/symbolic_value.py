"""The value of a task's row, written: positions as sums, headings as sums of angles where they are such."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, NamedTuple

from nmm.analysis.symbolic_expansion import Expansion
from nmm.analysis.symbolic_form import factored
from nmm.analysis.symbolic_rows import Arc, Linear
from nmm.analysis.symbolic_tree import Product, Sum, Symbol, latex, text, to_sympy


class Written(NamedTuple):
    """A formula in three forms."""

    expression: Any
    text: str
    latex: str


def written(value: Expansion | Arc | Linear, symbols: Mapping[str, Any]) -> Written:
    """A row's value; the value of an angle is not wrapped."""
    import sympy

    if isinstance(value, Expansion):
        return _of(factored(value), symbols)
    if isinstance(value, Linear):
        return _of(_sum([Product(n, ((Symbol(name), 1),)) for name, n in value.terms]), symbols)
    plain = _plain_angle(value)
    if plain is not None:
        terms, quarters = plain
        angle = _of(_sum([Product(Fraction(n), ((Symbol(name), 1),)) for name, n in terms]), symbols)
        if not quarters:
            return angle
        turn = {1: " + pi/2", 2: " + pi", -1: " - pi/2"}[quarters]
        return Written(
            angle.expression + quarters * sympy.pi / 2,
            angle.text + turn,
            angle.latex + turn.replace("pi/2", r"\frac{\pi}{2}").replace("+ pi", r"+ \pi"),
        )
    sine, cosine = (_of(factored(part), symbols) for part in (value.sine, value.cosine))
    return Written(
        sympy.atan2(sine.expression, cosine.expression),
        f"atan2({sine.text}, {cosine.text})",
        rf"\mathrm{{atan2}}({sine.latex}, {cosine.latex})",
    )


def _of(product: Product, symbols: Mapping[str, Any]) -> Written:
    return Written(to_sympy(product, symbols), text(product), latex(product))


def _sum(terms: list[Product]) -> Product:
    return terms[0] if len(terms) == 1 else Product(Fraction(1), ((Sum(tuple(terms)), 1),))


def _plain_angle(arc: Arc) -> tuple[list[tuple[str, int]], int] | None:
    """k·q and a number of quarter turns, where cosine and sine are those of such an angle."""
    ring = arc.cosine.ring
    half = Fraction(1, 2)
    turns = {(half, 0): 0, (0, half): 1, (-half, 0): 2, (0, -half): -1}
    if not len(arc.cosine.terms) == len(arc.sine.terms) == 2:
        return None
    for key, (re, im) in arc.cosine.terms.items():
        whole = (re, im) in turns and all(ring.is_angle[i] for i, _ in key)
        if whole and arc.sine.terms.get(key) == (im, -re):  # β = -i α
            return [(ring.names[i], n) for i, n in key], turns[re, im]
    return None
