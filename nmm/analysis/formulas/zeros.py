"""Factors of minors as polynomials in the cosines and sines of single angles, and where they all vanish."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import sympy
from sympy.polys.orderings import grevlex
from sympy.polys.rings import ring

from nmm.analysis.formulas.expressions import Product, Sum, Symbol, Trig, leaves
from nmm.analysis.formulas.fewest_angles import basis_of
from nmm.analysis.formulas.groebner import Basis, Undecided, Work

#: As `Trig` has it.
Angle: TypeAlias = tuple[tuple[str, int], ...]

#: Products of terms that all questions together may take, and the hard form of one.
_ALL, _ONE = 1_000_000, 50_000


class Zeros:
    """Sets of configurations and lengths in which given products vanish.

    Lengths that are not zero are divided out wherever they are a factor; other denominators have an inverse.
    Common zeros are looked for over the complex numbers: where there are none, there are none over the real
    ones.

    Parameters
    ----------
    products : all that will be asked about
    nonzero : products that do not vanish
    work : products of terms that all answers together may take, after which they raise `Undecided`; if
        none is given, some seconds' worth
    zero : products of lengths that vanish
    """

    def __init__(
        self,
        products: Iterable[Product],
        nonzero: Sequence[Product],
        work: int | None = None,
        zero: Sequence[Product] = (),
    ) -> None:
        found = list(leaves(*products, *nonzero, *zero))
        waves = dict.fromkeys(leaf.angle for leaf in found if isinstance(leaf, Trig))
        scalars = dict.fromkeys(leaf.name for leaf in found if isinstance(leaf, Symbol))
        self._seen = _in_few_angles(list(waves))
        count = max(map(len, self._seen.values()), default=0)
        variables = [f"{kind}{i}" for i in range(count) for kind in ("cos", "sin")]
        # Of the two inverses, y is for the question whether something vanishes, w for what does not.
        self._ring, y, w, *symbols = ring(["y", "w", *variables, *scalars], sympy.QQ, grevlex)
        self._y = y
        self._waves = [(symbols[2 * i], symbols[2 * i + 1]) for i in range(count)]
        self._scalars = dict(zip(scalars, symbols[2 * count :], strict=True))
        self._work = Work(_ALL if work is None else work)
        self._polynomials: dict[Product, Any] = {}
        circles = [c**2 + s**2 - 1 for c, s in self._waves]
        inverse, indices = self._ring.one, []
        for product in nonzero:
            f = self.polynomial(product)
            if f.is_generator:
                indices.append(self._ring.gens.index(f))
            else:
                inverse = inverse * f
        divided = [] if inverse == 1 else [1 - w * inverse]
        vanishing = [self.polynomial(product) for product in zero]
        self.everywhere = Basis((), indices).with_more([*circles, *divided, *vanishing], self._work)

    def within(self, basis: Basis, *products: Product) -> Basis:
        """The part of a set in which more products vanish."""
        return basis.with_more([self.polynomial(product) for product in products], self._work)

    def contains(self, product: Product, basis: Basis) -> bool:
        """Whether it is easy to see that a product vanishes all over a set."""
        if product not in self._polynomials:
            self._polynomials[product] = self.polynomial(product)
        f = self._polynomials[product]
        return basis.contains(f, self._work) or basis.contains(f * f, self._work)

    def vanishes(self, product: Product, basis: Basis) -> bool:
        """Whether a product vanishes all over a set; false also when that would take too long to find out."""
        if self.contains(product, basis):
            return True
        try:
            return basis.with_more([1 - self._y * self._polynomials[product]], Work(_ONE)).is_one
        except Undecided:
            return False

    def known(self, angle: str) -> bool:
        """Whether the single angle is a combination of those in the products."""
        return ((angle, 1),) in self._seen

    def polynomial(self, product: Product) -> Any:
        """A product without its denominators."""
        total = self._ring.one * product.number.numerator / product.number.denominator
        for factor, power in product.factors:
            for _ in range(power):
                total = total * self._factor(factor)
        return total

    def _factor(self, factor: Symbol | Trig | Sum) -> Any:
        if isinstance(factor, Symbol):
            return self._scalars[factor.name]
        if isinstance(factor, Sum):
            return sum((self.polynomial(term) for term in factor.terms), self._ring.zero)
        re, im = self._ring.one, self._ring.zero
        for (c, s), n in zip(self._waves, self._seen[factor.angle], strict=True):
            for _ in range(abs(n)):
                re, im = (re * c - im * s, re * s + im * c) if n > 0 else (re * c + im * s, im * c - re * s)
        return re if factor.kind == "cos" else im


def _in_few_angles(waves: list[Angle]) -> dict[Angle, tuple[int, ...]]:
    """Each wave as a combination of as few angles as there can be, and so each single angle that is one.

    The angles are some of the waves themselves, where the others are whole combinations of these.
    """
    names = list(dict.fromkeys(name for wave in waves for name, _ in wave))
    rows = {wave: tuple(dict(wave).get(name, 0) for name in names) for wave in waves}
    single = {((name, 1),): tuple(int(name == other) for other in names) for name in names}
    picked: list[tuple[int, ...]] = []
    for row in sorted(rows.values(), key=lambda row: sum(map(abs, row))):
        if sympy.Matrix([*picked, row]).rank() > len(picked):
            picked.append(row)
    if not picked:
        return {}
    B = sympy.Matrix(picked)
    right = B.T * (B * B.T).inv()  # k = m B has the solution m = k right, where it has one
    found: dict[Angle, tuple[int, ...]] = {}
    for wave, row in (single | rows).items():
        m = sympy.Matrix([row]) * right
        if m * B == sympy.Matrix([row]) and all(entry.is_integer for entry in m):
            found[wave] = tuple(int(entry) for entry in m)
        elif wave in rows:
            _, seen = basis_of(list((single | rows).values()), len(names))
            return dict(zip(single | rows, seen, strict=True))
    return found
