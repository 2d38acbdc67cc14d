"""Where factors of minors, as polynomials in the cosines and sines of single angles, all vanish. The Gröbner
bases are FLINT's: Buchberger's algorithm in C, with limits, which SymPy's lacks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import lcm
from typing import Any, NamedTuple, TypeAlias

import flint
import sympy

from nmm.plugins.symbolic.expansion import rational
from nmm.plugins.symbolic.expressions import Product, Sum, Symbol, Trig, leaves
from nmm.plugins.symbolic.trigonometric_factors import basis_of

#: As `Trig` has it.
Angle: TypeAlias = tuple[tuple[str, int], ...]


class Undecided(Exception):
    """Not within the limits: of a Gröbner basis, or of a proof's cases."""


class GroebnerLimits(NamedTuple):
    """Limits while a Gröbner basis is computed: its polynomials, their terms, and bits of coefficients."""

    members: int
    terms: int
    bits: int


#: For the sets themselves, and for the hard form of one question about them.
_SET, _QUESTION = GroebnerLimits(200, 2000, 10_000), GroebnerLimits(60, 1000, 10_000)


class GroebnerBasis:
    """A reduced Gröbner basis of integer polynomials in graded reverse lexicographic order. Variables that
    are not 0 (`nonzero`, by index) are divided out of each member: the ideal may be larger than the
    generators', with the same zeros where these are not 0."""

    def __init__(self, context: Any, members: Iterable[Any] = (), nonzero: Sequence[int] = ()) -> None:
        self.context = context
        self.members = flint.fmpz_mpoly_vec(list(members), context)
        self.nonzero = tuple(nonzero)

    @property
    def is_one(self) -> bool:
        """Whether 1 is in the ideal (Nullstellensatz: whether there is no common zero)."""
        return len(self.members) == 1 and bool(self.members[0].is_constant())

    def contains(self, polynomial: Any) -> bool:
        return not polynomial.reduction_primitive_part(self.members)

    def with_more(self, generators: Iterable[Any], limits: GroebnerLimits) -> GroebnerBasis:
        """The basis of this ideal and more generators; `Undecided` beyond the limits."""
        ideal, more = self, [self._stripped(generator) for generator in generators if generator]
        while more:
            everything = flint.fmpz_mpoly_vec([*ideal.members, *more], self.context)
            basis, finished = everything.buchberger_naive(limits=limits)
            if not finished:
                raise Undecided
            ideal = GroebnerBasis(self.context, basis.autoreduction(), self.nonzero)
            more = [shorter for member in ideal.members if (shorter := self._stripped(member)) != member]
        return ideal

    def _stripped(self, polynomial: Any) -> Any:
        """Without factors that are not 0."""
        powers = [
            power if i in self.nonzero else 0 for i, power in enumerate(polynomial.term_content().degrees())
        ]
        return polynomial / self.context.term(exp_vec=powers) if any(powers) else polynomial


class Zeros:
    """Where products vanish, for complex configurations and lengths: no common zero there means no real one.
    `products` are all that will be asked about; `nonzero` do not vanish, `zero` do. Nonzero lengths are
    divided out, other denominators have an inverse. `Undecided` beyond the limits."""

    def __init__(
        self,
        products: Iterable[Product],
        nonzero: Sequence[Product],
        limits: GroebnerLimits | None = None,
        zero: Sequence[Product] = (),
    ) -> None:
        all_leaves = list(leaves(*products, *nonzero, *zero))
        waves = dict.fromkeys(leaf.angle for leaf in all_leaves if isinstance(leaf, Trig))
        scalars = dict.fromkeys(leaf.name for leaf in all_leaves if isinstance(leaf, Symbol))
        self._seen = _in_few_angles(list(waves))
        count = max(map(len, self._seen.values()), default=0)
        variables = [f"{kind}{i}" for i in range(count) for kind in ("cos", "sin")]
        # Of the two inverses, y is for the question whether something vanishes, w for what does not.
        names = ["y", "w", *variables, *scalars]
        self._rational = flint.fmpq_mpoly_ctx.get(names, "degrevlex")
        self._integer = flint.fmpz_mpoly_ctx.get(names, "degrevlex")
        _, _, *symbols = self._rational.gens()
        self._y, w, *_ = gens = self._integer.gens()
        self._waves = [(symbols[2 * i], symbols[2 * i + 1]) for i in range(count)]
        self._scalars = dict(zip(scalars, symbols[2 * count :], strict=True))
        self._limits = _SET if limits is None else limits
        self._polynomials: dict[Product, Any] = {}
        circles = [self._whole(c**2 + s**2 - 1) for c, s in self._waves]
        inverse, indices = self._integer.constant(1), []
        for product in nonzero:
            f = self.polynomial(product)
            if f in gens:
                indices.append(gens.index(f))
            else:
                inverse = inverse * f
        divided = [] if inverse == 1 else [1 - w * inverse]
        vanishing = [self.polynomial(product) for product in zero]
        whole = GroebnerBasis(self._integer, (), indices)
        self.everywhere = whole.with_more([*circles, *divided, *vanishing], self._limits)

    def within(self, basis: GroebnerBasis, *products: Product) -> GroebnerBasis:
        """The part of a set where more products vanish, too."""
        return basis.with_more([self.polynomial(product) for product in products], self._limits)

    def contains(self, product: Product, basis: GroebnerBasis) -> bool:
        """Whether a product is easily seen to vanish throughout a set."""
        if product not in self._polynomials:
            self._polynomials[product] = self.polynomial(product)
        f = self._polynomials[product]
        return basis.contains(f) or basis.contains(f * f)

    def vanishes(self, product: Product, basis: GroebnerBasis) -> bool:
        """Whether a product vanishes throughout a set; false also if deciding takes too long."""
        if self.contains(product, basis):
            return True
        try:
            return basis.with_more([1 - self._y * self._polynomials[product]], _QUESTION).is_one
        except Undecided:
            return False

    def known(self, angle: str) -> bool:
        """Whether a single angle is a combination of those in the products."""
        return ((angle, 1),) in self._seen

    def polynomial(self, product: Product) -> Any:
        """A product without its denominators."""
        return self._whole(self._multiplied(product))

    def _whole(self, polynomial: Any) -> Any:
        """A polynomial times the denominators of its coefficients."""
        over = lcm(*(int(coefficient.q) for coefficient in polynomial.coeffs()))
        return self._integer.from_dict({key: int((n * over).p) for key, n in polynomial.to_dict().items()})

    def _multiplied(self, product: Product) -> Any:
        total = self._rational.constant(rational(product.number))
        for factor, power in product.factors:
            for _ in range(power):
                total = total * self._factor(factor)
        return total

    def _factor(self, factor: Symbol | Trig | Sum) -> Any:
        if isinstance(factor, Symbol):
            return self._scalars[factor.name]
        if isinstance(factor, Sum):
            return sum(map(self._multiplied, factor.terms), self._rational.constant(0))
        re, im = self._rational.constant(1), self._rational.constant(0)
        for (c, s), n in zip(self._waves, self._seen[factor.angle], strict=True):
            for _ in range(abs(n)):
                re, im = (re * c - im * s, re * s + im * c) if n > 0 else (re * c + im * s, im * c - re * s)
        return re if factor.kind == "cos" else im


def _in_few_angles(waves: list[Angle]) -> dict[Angle, tuple[int, ...]]:
    """Each wave as a combination of as few angles as possible, and each single angle that is one. The angles
    are some of the waves themselves, where the others are integer combinations of these."""
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
    combinations: dict[Angle, tuple[int, ...]] = {}
    for wave, row in (single | rows).items():
        m = sympy.Matrix([row]) * right
        if m * B == sympy.Matrix([row]) and all(entry.is_integer for entry in m):
            combinations[wave] = tuple(int(entry) for entry in m)
        elif wave in rows:
            _, seen = basis_of(list((single | rows).values()), len(names))
            return dict(zip(single | rows, seen, strict=True))
    return combinations
