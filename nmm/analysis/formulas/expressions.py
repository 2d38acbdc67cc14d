"""Expressions as a person would write them: products of named factors, sums and cosines, and their text."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy

from nmm.words import signed_sum


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
    """A number times powers of factors."""

    number: Fraction
    factors: tuple[tuple[Node, int], ...] = ()

    def times(self, other: Product) -> Product:
        """Their product, powers of the same factor added."""
        powers: dict[Node, int] = {}
        for factor, power in (*self.factors, *other.factors):
            powers[factor] = powers.get(factor, 0) + power
        return Product(self.number * other.number, tuple((f, n) for f, n in powers.items() if n))


@dataclass(frozen=True)
class Sum:
    """A sum of products."""

    terms: tuple[Product, ...]


Node = Trig | Symbol | Sum

ZERO = Product(Fraction(0))
_INDEXED = re.compile(r"q\d")


def alone(factor: Node, power: int = 1) -> Product:
    """A factor, to a power, as a product."""
    return Product(Fraction(1), ((factor, power),))


def leaves(*products: Product) -> Iterator[Symbol | Trig]:
    """The symbols, cosines and sines in products, sums in them opened."""
    for product in products:
        for factor, _ in product.factors:
            if isinstance(factor, Sum):
                yield from leaves(*factor.terms)
            else:
                yield factor


def is_constant(factor: Node, lengths: Collection[str]) -> bool:
    """Whether a factor is made of lengths and fixed angles alone."""
    return all(
        leaf.name in lengths if isinstance(leaf, Symbol) else all(name in lengths for name, _ in leaf.angle)
        for leaf in leaves(alone(factor))
    )


def text(product: Product) -> str:
    """One line: "-Λ (d + Λ c1)", with c12 = cos(q1 + q2)."""
    return _written(product, _TEXT)


def latex(product: Product) -> str:
    """As LaTeX."""
    return _written(product, _LATEX)


def to_sympy(product: Product, symbols: Mapping[str, Any]) -> Any:
    """As a SymPy expression of the symbols given by name."""

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
    """How names, functions, powers and fractions are written."""

    latex: bool

    def name(self, name: str) -> str:
        return latex_name(name) if self.latex else GREEK.get(name, name)

    def trig(self, trig: Trig) -> str:
        indexed = all(_INDEXED.fullmatch(name) and n == 1 for name, n in trig.angle)
        if indexed:
            digits = "".join(name[1] for name, _ in trig.angle)
            return f"{trig.kind[0]}_{{{digits}}}" if self.latex else f"{trig.kind[0]}{digits}"
        inside = _linear(trig.angle, self.name, " ")
        return rf"\{trig.kind}({inside})" if self.latex else f"{trig.kind}({inside})"

    def side_by_side(self, factors: list[str]) -> str:
        """A product; names of several letters stand apart."""
        apart = self.latex and any(r"\mathrm" in factor for factor in factors)
        return (r" \, " if apart else " ").join(factors)

    def power(self, base: str, n: int) -> str:
        if n == 1:
            return base
        if self.latex:
            # c_{12}^{2} and \cos^{2}(...) alike.
            if base.startswith(("\\cos(", "\\sin(")):
                return f"{base[:4]}^{{{n}}}{base[4:]}"
            return f"{base}^{{{n}}}"
        if base.startswith(("cos(", "sin(")):
            return f"{base[:3]}^{n}{base[3:]}"
        return f"{base}^{n}"


_TEXT, _LATEX = _Style(False), _Style(True)
#: Names that text writes with a Greek letter.
GREEK = {"Lambda": "Λ", "Gamma": "Γ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω"}


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
    if style.latex:
        return rf"{sign}\frac{{{top}}}{{{bottom}}}"
    return f"{sign}{top}/{bottom if len(below) == 1 else f'({bottom})'}"


def _factor(factor: Node, style: _Style) -> str:
    if isinstance(factor, Symbol):
        return style.name(factor.name)
    if isinstance(factor, Trig):
        return style.trig(factor)
    return f"({_terms_written(factor.terms, 1, style)})"


def _terms_written(terms: tuple[Product, ...], sign: int, style: _Style) -> str:
    """Terms times a sign, one that is positive first."""
    parts = [_written(Product(sign * term.number, term.factors), style) for term in terms]
    first = next((i for i, part in enumerate(parts) if not part.startswith("-")), 0)
    written = parts.pop(first)
    for part in parts:
        written += f" - {part[1:]}" if part.startswith("-") else f" + {part}"
    return written


def _linear(angle: tuple[tuple[str, int], ...], name: Any, space: str) -> str:
    return signed_sum((n, f"{'' if abs(n) == 1 else f'{abs(n)}{space}'}{name(of)}") for of, n in angle)


def latex_name(name: str) -> str:
    greek = re.fullmatch(r"(theta|rho|omega|alpha|beta|kappa|Lambda|Gamma|Phi|Psi|Omega)(\d*)", name)
    if greek:
        return f"\\{greek[1]}" + (f"_{{{greek[2]}}}" if greek[2] else "")
    letters = re.fullmatch(r"([A-Za-z])(\d+)", name)
    if letters:
        return f"{letters[1]}_{{{letters[2]}}}" if len(letters[2]) > 1 else f"{letters[1]}_{letters[2]}"
    head, _, tail = name.partition("_")
    if len(head) == 1 and tail:
        return f"{head}_{{\\mathrm{{{tail.replace('_', ',')}}}}}"
    return name if len(name) == 1 else rf"\mathrm{{{name.replace('_', chr(92) + '_')}}}"
