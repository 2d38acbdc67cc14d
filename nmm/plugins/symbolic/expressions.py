"""Expressions as a person would write them: products of named factors, sums and cosines."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy

from nmm.base.latex import Formula, symbol
from nmm.base.text_format import signed_sum


@dataclass(frozen=True)
class Trig:
    """cos or sin of a combination of angles, ((name, factor), ...)."""

    kind: str
    angle: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Symbol:
    """A length, a straight coordinate, or the name of a factor."""

    name: str


@dataclass(frozen=True)
class Product:
    number: Fraction
    factors: tuple[tuple[Node, int], ...] = ()

    def times(self, other: Product) -> Product:
        powers: dict[Node, int] = {}
        for factor, power in (*self.factors, *other.factors):
            powers[factor] = powers.get(factor, 0) + power
        return Product(self.number * other.number, tuple((f, n) for f, n in powers.items() if n))


@dataclass(frozen=True)
class Sum:
    terms: tuple[Product, ...]


Node = Trig | Symbol | Sum

ZERO = Product(Fraction(0))
_INDEXED = re.compile(r"q\d")


def alone(factor: Node, power: int = 1) -> Product:
    return Product(Fraction(1), ((factor, power),))


def leaves(*products: Product) -> Iterator[Symbol | Trig]:
    for product in products:
        for factor, _ in product.factors:
            if isinstance(factor, Sum):
                yield from leaves(*factor.terms)
            else:
                yield factor


def is_constant(factor: Node, lengths: Collection[str]) -> bool:
    return all(
        leaf.name in lengths if isinstance(leaf, Symbol) else all(name in lengths for name, _ in leaf.angle)
        for leaf in leaves(alone(factor))
    )


def shown(product: Product) -> Formula:
    """One line, "-Λ (d + Λ c1)" with c12 = cos(q1 + q2), and the same as LaTeX."""
    return Formula(_written(product, _TEXT), _written(product, _LATEX))


def inline(product: Product) -> Formula:
    """The same for running text: in LaTeX, too, fractions have a slash."""
    return Formula(_written(product, _TEXT), _written(product, _INLINE))


def to_sympy(product: Product, symbols: Mapping[str, Any]) -> Any:
    def node(factor: Node) -> Any:
        if isinstance(factor, Symbol):
            return symbols[factor.name]
        if isinstance(factor, Trig):
            angle = sympy.Add(*(n * symbols[name] for name, n in factor.angle))
            return sympy.cos(angle) if factor.kind == "cos" else sympy.sin(angle)
        return sympy.Add(*(to_sympy(term, symbols) for term in factor.terms))

    number = sympy.Rational(product.number.numerator, product.number.denominator)
    # Unevaluated, so that a number is not multiplied into a sum.
    factors = [node(factor) ** power for factor, power in product.factors]
    if number in (1, -1) or len(factors) != 1:
        return number * sympy.Mul(*factors)
    return sympy.Mul(number, *factors, evaluate=False)


@dataclass(frozen=True)
class _Style:
    latex: bool
    stacked: bool = False

    def name(self, name: str) -> str:
        return symbol(name).latex if self.latex else str(symbol(name))

    def trig(self, trig: Trig) -> str:
        indexed = all(_INDEXED.fullmatch(name) and n == 1 for name, n in trig.angle)
        if indexed:
            digits = "".join(name[1] for name, _ in trig.angle)
            return f"{trig.kind[0]}_{{{digits}}}" if self.latex else f"{trig.kind[0]}{digits}"
        inside = signed_sum(
            (n, f"{'' if abs(n) == 1 else f'{abs(n)} '}{self.name(of)}") for of, n in trig.angle
        )
        return rf"\{trig.kind}({inside})" if self.latex else f"{trig.kind}({inside})"

    def side_by_side(self, factors: list[str]) -> str:
        """A product; names of several letters are spaced."""
        apart = self.latex and any(r"\mathrm" in factor for factor in factors)
        return (r" \, " if apart else " ").join(factors)

    def power(self, base: str, n: int) -> str:
        if n == 1:
            return base
        # c_{12}^{2} and \cos^{2}(...) alike.
        function = re.match(r"\\?(cos|sin)(?=\()", base)
        end = function.end() if function else len(base)
        return f"{base[:end]}^{f'{{{n}}}' if self.latex else n}{base[end:]}"


_TEXT, _INLINE, _LATEX = _Style(False), _Style(True), _Style(True, stacked=True)


def _written(product: Product, style: _Style) -> str:
    if len(product.factors) == 1 and product.number in (1, -1):
        factor, power = product.factors[0]
        if isinstance(factor, Sum) and power == 1:
            return _terms_written(factor.terms, int(product.number), style)
    sign = "-" if product.number < 0 else ""
    above: list[str] = []
    below: list[str] = []
    for factor, n in product.factors:
        (above if n > 0 else below).append(style.power(_factor(factor, style), abs(n)))
    number = abs(product.number)
    if number.numerator != 1 or not above:
        above.insert(0, str(number.numerator))
    if number.denominator != 1:
        below.insert(0, str(number.denominator))
    top, bottom = style.side_by_side(above), style.side_by_side(below)
    if not bottom:
        return sign + top
    if style.stacked:
        return rf"{sign}\frac{{{top}}}{{{bottom}}}"
    return f"{sign}{top}/{bottom if len(below) == 1 else f'({bottom})'}"


def _factor(factor: Node, style: _Style) -> str:
    if isinstance(factor, Symbol):
        return style.name(factor.name)
    if isinstance(factor, Trig):
        return style.trig(factor)
    return f"({_terms_written(factor.terms, 1, style)})"


def _terms_written(terms: tuple[Product, ...], sign: int, style: _Style) -> str:
    """Terms times a sign, starting with a positive one."""
    parts = [_written(Product(sign * term.number, term.factors), style) for term in terms]
    first = next((i for i, part in enumerate(parts) if not part.startswith("-")), 0)
    start = parts.pop(first)
    return start + "".join(f" - {part[1:]}" if part.startswith("-") else f" + {part}" for part in parts)
