"""From a trigonometric polynomial to the form that a person would write. SymPy's `simplify`, `fu` and
`factor(trigsimp(...))` take 6 to 8 s for the paper's 3R, which takes 0.4 s here, and leave products such as
Λ (d + Λ c1) as sums of ten terms; `trigsimp` by Gröbner bases takes 28 s for one."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from math import gcd, lcm

from nmm.base.latex import Formula, symbol
from nmm.plugins.symbolic.expansion import Expansion, Gaussian, Key, Ring, collected
from nmm.plugins.symbolic.expressions import (
    ZERO,
    Node,
    Product,
    Sum,
    Symbol,
    Trig,
    alone,
    inline,
    is_constant,
)
from nmm.plugins.symbolic.trigonometric_factors import factors_of

#: Names of factors that several minors have, in the order in which they are given.
FACTOR_NAMES = ("Lambda", "Gamma", "Phi", "Psi", "Omega")
#: A factor gets a name when at least so many minors have it.
_OFTEN = 3
#: Sums of at least so many cosines and sines are tried as products.
_MANY = 4
#: A sum of more waves is not tried as a whole.
_LONG = 100


def factored(value: Expansion) -> Product:
    """The value as a product; inside sums, cosines and sines of sums are split where that is shorter."""
    if not value:
        return ZERO
    number, scalars, factors = factors_of(value)
    parts = [part for factor, power in factors for part in [as_sum(factor)] * power]
    start = Product(number).times(_scalars(value, scalars))
    return tidy(reduce(Product.times, sorted(parts, key=_length), start))


def expanded(product: Product, ring: Ring) -> Expansion:
    """Multiply out a product without named factors."""
    total = ring.number(product.number)
    for factor, power in product.factors:
        if isinstance(factor, Symbol):
            total = total * ring.scalar(factor.name, power)
            continue
        if isinstance(factor, Sum):
            value = sum((expanded(term, ring) for term in factor.terms), ring.number(0))
        else:
            angle = {ring.variable(name, True): n for name, n in factor.angle}
            value = ring.cos(angle) if factor.kind == "cos" else ring.sin(angle)
        total = total * value.power(power)
    return total


def named(
    products: Sequence[Product], taken: Collection[str], lengths: Collection[str]
) -> tuple[dict[str, Product], list[Product]]:
    """Free names for sums that several products have as a factor, those of lengths alone last, and the
    products in these names."""
    names: dict[str, Product] = {}
    products = list(products)
    for name in (name for name in FACTOR_NAMES if name not in taken):
        counts = Counter(node for product in products for node in dict.fromkeys(_sums(product)))
        often = [node for node, count in counts.items() if count >= _OFTEN]
        if not often:
            break
        node = max(often, key=lambda node: (not is_constant(node, lengths), counts[node], _size(node)))
        names[name] = alone(node)
        products = [_replaced(product, node, Symbol(name)) for product in products]
    return names, products


def in_names(product: Product, names: Mapping[str, Product]) -> Product:
    for name, form in names.items():
        node = form.factors[0][0]
        if isinstance(node, Sum):
            product = _replaced(product, node, Symbol(name))
    return product


def condition(factor: Product, names: Mapping[str, Product]) -> Formula:
    """A factor of a minor as it is said to vanish: "sin(q2)", "Λ", "d + Λ c1"."""
    node = factor.factors[0][0]
    if isinstance(node, Trig) and len(node.angle) == 1 and node.angle[0][1] == 1:
        angle = symbol(node.angle[0][0])
        return Formula(f"{node.kind}({angle})", rf"\{node.kind}({angle.latex})")
    return inline(in_names(factor, names))


def as_sum(value: Expansion) -> Product:
    """A value, not factored, as a number times one sum (or one cosine)."""
    if not value:
        return ZERO
    ring = value.ring
    by_scalars: dict[Key, dict[Key, tuple[Fraction, Fraction]]] = {}
    for key, coefficient in value.terms.items():
        lengths = tuple((i, n) for i, n in key if not ring.is_angle[i])
        angles = tuple((i, n) for i, n in key if ring.is_angle[i])
        by_scalars.setdefault(lengths, {})[angles] = coefficient
    terms: list[Product] = []
    for lengths, waves in sorted(by_scalars.items()):
        part = Expansion(ring, waves)
        plain = _terms(part)
        if len(by_scalars) > 1 and len(plain) > 1:
            product = factored(part)
            if _length(product) <= sum(map(_length, plain)):
                plain = [product]
        if len(plain) >= _MANY:
            split = _split(part)
            if split is not None and sum(map(_length, split)) < sum(map(_length, plain)):
                plain = split
        terms += [tidy(_scalars(value, lengths).times(term)) for term in plain]
    if len(by_scalars) > 1 and len(terms) >= _MANY and len(value.terms) <= _LONG:
        split = _split(value)
        if split is not None and _length(_written(split)) <= _length(_written(terms)):
            terms = split
    return _written(terms)


def _written(terms: list[Product]) -> Product:
    return _normalised(_collected(terms))


def _split(value: Expansion) -> list[Product] | None:
    """C cos φ + S sin φ + R for the angle that leaves the fewest waves; None where none leaves fewer."""
    candidates: list[tuple[int, int, tuple[Expansion, Expansion, Expansion]]] = []
    for angle in value.variables():
        if value.ring.is_angle[angle] and all(abs(dict(key).get(angle, 0)) <= 1 for key in value.terms):
            parts = _harmonics(value, angle)
            candidates.append((sum(len(part.terms) for part in parts), angle, parts))
    if not candidates:
        return None
    left, angle, (cosine, sine, rest) = min(candidates, key=lambda candidate: candidate[:2])
    if left >= len(value.terms):
        return None
    name = ((value.ring.names[angle], 1),)
    split = [
        tidy(factored(part).times(alone(Trig(kind, name))))
        for kind, part in (("cos", cosine), ("sin", sine))
        if part
    ]
    return [*split, factored(rest)] if rest else split


def _harmonics(value: Expansion, angle: int) -> tuple[Expansion, Expansion, Expansion]:
    """C, S and R of C cos φ + S sin φ + R; φ occurs once in each wave or not at all."""
    cosine: list[tuple[Key, Gaussian]] = []
    sine: list[tuple[Key, Gaussian]] = []
    for key, (re, im) in value.terms.items():
        n = dict(key).get(angle, 0)
        if n:
            # (a e^{ir}) e^{iφ} and its conjugate: C gets a e^{ir}, S gets i a e^{ir}, and their conjugates.
            other = tuple((i, k) for i, k in key if i != angle)
            cosine.append((other, (re, im)))
            sine.append((other, (-n * im, n * re)))
    return collected(value.ring, cosine), collected(value.ring, sine), value.without({angle})


def _terms(value: Expansion) -> list[Product]:
    """The cosines and sines of an expansion, each with its number and scalars."""
    ring, terms = value.ring, []
    for key, (re, im) in value.terms.items():
        angle = [(i, n) for i, n in key if ring.is_angle[i]]
        lengths = _scalars(value, tuple((i, n) for i, n in key if not ring.is_angle[i]))
        if not angle:
            terms.append(lengths.times(Product(re)))
            continue
        total = sum(n for _, n in angle)
        if total < 0 or (total == 0 and angle[0][1] < 0):
            continue  # the conjugate
        named_angle = tuple((ring.names[i], n) for i, n in angle)
        for kind, number in (("cos", 2 * re), ("sin", -2 * im)):
            if number:
                terms.append(lengths.times(Product(number, ((Trig(kind, named_angle), 1),))))
    return sorted(terms, key=_rank)


def _scalars(value: Expansion, key: Key) -> Product:
    return Product(Fraction(1), tuple((Symbol(value.ring.names[i]), n) for i, n in sorted(key)))


def _collected(terms: list[Product]) -> list[Product]:
    """Terms with the most frequent cosine or sine factored out: d + c1 (l2 s2 + l3 s23)."""
    counts = Counter(f for term in terms for f, n in term.factors if not isinstance(f, Symbol) and n > 0)
    shared = [f for f, count in counts.most_common() if count > 1]
    if not shared or counts[shared[0]] == len(terms):
        return sorted(terms, key=_rank)
    common = shared[0]
    inside = [term.times(alone(common, -1)) for term in terms if common in dict(term.factors)]
    outside = [term for term in terms if common not in dict(term.factors)]
    bracket = _normalised(_collected(inside))
    return sorted([*outside, tidy(alone(common).times(bracket))], key=_rank)


def _normalised(terms: list[Product]) -> Product:
    """A sum with coprime integer coefficients, the first one positive, times what was factored out."""
    if len(terms) == 1:
        return terms[0]
    over = lcm(*(term.number.denominator for term in terms))
    content = gcd(*(int(term.number * over) for term in terms))
    number = Fraction(content, over) * (-1 if terms[0].number < 0 else 1)
    shared = [
        (f, min(dict(term.factors).get(f, 0) for term in terms))
        for f, _ in terms[0].factors
        if isinstance(f, Symbol)
    ]
    front = Product(number, tuple((f, n) for f, n in shared if n))
    back = Product(1 / number, tuple((f, -n) for f, n in front.factors))
    return front.times(alone(Sum(tuple(term.times(back) for term in terms))))


def _rank(term: Product) -> tuple[int, int]:
    """Constants first, then by the number of joints in the angle."""
    factors = [factor for factor, _ in term.factors if not isinstance(factor, Symbol)]
    angles = [sum(abs(n) for _, n in f.angle) if isinstance(f, Trig) else 9 for f in factors]
    return len(angles), sum(angles)


def _length(product: Product) -> int:
    """How many letters, roughly, a product takes."""
    return sum(abs(n) * _size(f) if isinstance(f, Sum) else 1 for f, n in product.factors)


def _size(node: Sum) -> int:
    return sum(_length(term) + 1 for term in node.terms)


def _sums(product: Product) -> Iterator[Sum]:
    for factor, _ in product.factors:
        if isinstance(factor, Sum):
            yield factor
            for term in factor.terms:
                yield from _sums(term)


def _replaced(product: Product, node: Sum, symbol: Symbol) -> Product:
    """The product with a sum, or its terms among those of a larger sum, replaced by a symbol."""
    factors: list[tuple[Node, int]] = []
    for factor, power in product.factors:
        if factor == node:
            factors.append((symbol, power))
        elif isinstance(factor, Sum):
            terms = [_replaced(term, node, symbol) for term in factor.terms]
            for sign in (1, -1):
                part = [Product(term.number * sign, term.factors) for term in node.terms]
                if all(term in terms for term in part):
                    rest = [term for term in terms if term not in part]
                    terms = [*rest, Product(Fraction(sign), ((symbol, 1),))]
            factors.append((Sum(tuple(terms)), power))
        else:
            factors.append((factor, power))
    return tidy(Product(product.number, tuple(factors)))


def tidy(product: Product) -> Product:
    """Factors in the usual order: lengths, names, cosines and sines by their joints, sums."""
    return Product(product.number, tuple(sorted(product.factors, key=lambda entry: _place(entry[0]))))


def _place(factor: Node) -> tuple[int, int, str]:
    if isinstance(factor, Symbol):
        return (1 if factor.name in FACTOR_NAMES else 0, 0, "")
    if isinstance(factor, Trig):
        return (2, len(factor.angle), factor.angle[0][0])
    return (3, 0, "")
