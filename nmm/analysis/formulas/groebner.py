"""Gröbner bases by Buchberger's algorithm with a limit on the work, which SymPy's own has not.

SymPy's `groebner` gives the same bases (a test compares) and takes longer: all questions about the paper's
3R 6.4 s instead of 0.25 s, about UR5's pose 12 s instead of 1.5 s, about a point on two trailers 8 s instead
of 0.5 s, and a sixth of those about a small arm's tip on a unicycle 40 s, where all take 10 s here.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from operator import add, le, sub
from typing import Any, NamedTuple, TypeAlias

#: Exponents of the variables.
Monomial: TypeAlias = tuple[int, ...]


class Undecided(Exception):
    """The work allowed was not enough."""


class Work:
    """Products of terms that may still be taken."""

    def __init__(self, terms: int) -> None:
        self.left = terms

    def spend(self, terms: int) -> None:
        """`Undecided` when none is left."""
        self.left -= terms
        if self.left < 0:
            raise Undecided


class Monic(NamedTuple):
    """A monic polynomial of SymPy's sparse ring with its leading monomial, which is dear to find."""

    head: Monomial
    polynomial: Any


class Basis:
    """A Gröbner basis, in the graded reverse lexicographic order; `with_more` adds generators to it.

    Parameters
    ----------
    members : [1] when there is no common zero (over the complex numbers)
    nonzero : indices of variables that are not 0: they are divided out where they are a factor, so that
        this is a basis of more than the generators' ideal, which vanishes where that does
    """

    def __init__(self, members: Sequence[Monic] = (), nonzero: Sequence[int] = ()) -> None:
        self.members = list(members)
        self.nonzero = tuple(nonzero)

    @property
    def is_one(self) -> bool:
        """Whether 1 is in the ideal (Nullstellensatz: whether nothing is a common zero)."""
        return len(self.members) == 1 and not any(self.members[0].head)

    def contains(self, polynomial: Any, work: Work) -> bool:
        """Whether a polynomial is in the ideal."""
        return not _remainder(polynomial, self.members, work)

    def with_more(self, generators: Iterable[Any], work: Work) -> Basis:
        """The basis of this ideal and more generators."""
        found = list(self.members)
        # Pairs within a basis reduce to zero.
        pairs: list[tuple[int, Monomial, int, int]] = []
        pending: set[tuple[int, int]] = set()
        waiting = sorted((g for g in generators if g), key=len, reverse=True)
        while waiting or pairs:
            if waiting:
                candidate = waiting.pop()
            else:
                _, lcm, i, j = heapq.heappop(pairs)
                pending.remove((i, j))
                if _useless(found, i, j, lcm, pending):
                    continue
                candidate = _s_polynomial(found[i], found[j], lcm)
            rest = self._stripped(_remainder(candidate, found, work))
            if not rest:
                continue
            new = Monic(rest.LM, rest.monic())
            if not any(new.head):
                return Basis([new], self.nonzero)
            for k, old in enumerate(found):
                lcm = tuple(map(max, old.head, new.head))
                heapq.heappush(pairs, (sum(lcm), lcm, k, len(found)))
                pending.add((k, len(found)))
            found.append(new)
        return Basis(_reduced(found, work), self.nonzero)

    def _stripped(self, polynomial: Any) -> Any:
        """Without factors that are not 0."""
        common = [0] * polynomial.ring.ngens
        for i in self.nonzero:
            common[i] = min((monomial[i] for monomial in polynomial), default=0)
        if not any(common):
            return polynomial
        return polynomial.ring.from_dict({_less(m, common): c for m, c in polynomial.items()})


def _remainder(polynomial: Any, divisors: Sequence[Monic], work: Work) -> Any:
    """What is left of a polynomial when its terms are reduced by the divisors' leading ones."""
    rest, left = dict(polynomial), {}
    # Leading monomials first.
    heap = [(-sum(monomial), monomial[::-1]) for monomial in rest]
    heapq.heapify(heap)
    while heap:
        leading = heapq.heappop(heap)[1][::-1]
        coefficient = rest.get(leading)
        if coefficient is None:  # cancelled
            continue
        work.spend(1 + len(divisors) // 4)
        for head, divisor in divisors:
            if _divides(head, leading):
                work.spend(len(divisor))
                shift = _less(leading, head)
                for monomial, number in divisor.items():
                    place = tuple(map(add, monomial, shift))
                    old = rest.get(place)
                    if old is None:
                        heapq.heappush(heap, (-sum(place), place[::-1]))
                        rest[place] = -coefficient * number
                    elif old == coefficient * number:
                        del rest[place]
                    else:
                        rest[place] = old - coefficient * number
                break
        else:
            left[leading] = rest.pop(leading)
    return polynomial.ring.from_dict(left)


def _divides(one: Monomial, other: Monomial) -> bool:
    return all(map(le, one, other))


def _less(one: Monomial, other: Sequence[int]) -> Monomial:
    return tuple(map(sub, one, other))


def _useless(found: list[Monic], i: int, j: int, lcm: Monomial, pending: set[tuple[int, int]]) -> bool:
    """Buchberger's two criteria: coprime leading monomials; a third polynomial whose pairs are done."""
    if not any(map(min, found[i].head, found[j].head)):
        return True
    return any(
        k not in (i, j)
        and _divides(third.head, lcm)
        and (min(i, k), max(i, k)) not in pending
        and (min(j, k), max(j, k)) not in pending
        for k, third in enumerate(found)
    )


def _s_polynomial(one: Monic, two: Monic, lcm: Monomial) -> Any:
    first = one.polynomial.mul_monom(_less(lcm, one.head))
    return first - two.polynomial.mul_monom(_less(lcm, two.head))


def _reduced(found: list[Monic], work: Work) -> list[Monic]:
    """Without those whose leading monomial another one's divides; the rest reduced by each other."""
    kept: list[Monic] = []
    for one in sorted(found, key=lambda led: (sum(led.head), led.head)):
        if not any(_divides(other.head, one.head) for other in kept):
            kept.append(one)
    return [
        Monic(one.head, _remainder(one.polynomial, [other for other in kept if other is not one], work))
        for one in kept
    ]
