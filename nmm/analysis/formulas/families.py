"""Where all minors vanish, by distinguishing which of their factors do."""

from __future__ import annotations

from dataclasses import dataclass, field

from nmm.analysis.formulas.expressions import Product, Trig, alone, leaves
from nmm.analysis.formulas.groebner import Basis
from nmm.analysis.formulas.readable import condition_text
from nmm.analysis.formulas.zeros import Zeros

#: More cases than that no one reads.
_CASES = 200


class TooMany(Exception):
    """More cases than are gone through."""


@dataclass(eq=False)
class Cases:
    """The case distinction.

    Parameters
    ----------
    zeros : decides what vanishes
    minors : (name and formula as text, the factors that may vanish) of each minor that is not 0
    names : factors that have names, by these

    Attributes
    ----------
    families : sets of factors; all minors vanish exactly where all factors of one of them do
    steps : the proof, a sentence each
    """

    zeros: Zeros
    minors: list[tuple[str, list[Product]]]
    names: dict[str, Product]
    families: list[list[Product]] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    _count: int = 0

    def explore(self) -> None:
        """Find the families.

        Raises
        ------
        Undecided, TooMany : it takes too long
        """
        self._case([], self.zeros.everywhere)
        self.families = [self._plain(family) for family in self.families]
        self._drop_parts()

    def _case(self, given: list[Product], basis: Basis) -> None:
        self._count += 1
        if self._count > _CASES:
            raise TooMany
        where = "" if not given else f"where {self._said(given)}: "
        for family in self.families:
            if all(self.zeros.vanishes(factor, basis) for factor in family):
                self.steps.append(f"{where}a part of {self._said(family)}")
                return
        left = [minor for minor in self.minors if not any(self.zeros.contains(f, basis) for f in minor[1])]
        while left:  # the easy question is answered; the hard one only for the minor that is taken
            minor = min(left, key=lambda minor: len(minor[1]))
            hidden = [factor for factor in minor[1] if self.zeros.vanishes(factor, basis)]
            if not hidden:
                break
            basis = self.zeros.within(basis, hidden[0])
            left = [one for one in left if not any(self.zeros.contains(f, basis) for f in one[1])]
        if not left:
            self.steps.append(f"{where}every minor has a factor that is 0")
            self.families.append(given)
            return
        text, factors = minor
        if not factors:
            self.steps.append(f"{where}{text} is not 0")
            return
        possible = [(factor, self.zeros.within(basis, factor)) for factor in factors]
        ways = [self._said([factor]) for factor, inside in possible if not inside.is_one]
        out = [self._said([factor]) for factor, inside in possible if inside.is_one]
        reason = f"; {' and '.join(out)} cannot be there (Nullstellensatz)" if out else ""
        self.steps.append(f"{where}{text} is 0 {'where ' + ' or '.join(ways) if ways else 'nowhere'}{reason}")
        for factor, inside in possible:
            if not inside.is_one:
                self._case([*given, factor], inside)

    def _plain(self, family: list[Product]) -> list[Product]:
        """The same set by fewer and simpler factors: cosines and sines of single angles where it has them."""
        zeros, basis = self.zeros, self.zeros.within(self.zeros.everywhere, *family)
        waves = _single_waves([name for name in _angles(family) if zeros.known(name)])
        single = [wave for wave in waves if zeros.vanishes(wave, basis)]
        chosen: list[Product] = []
        inside = zeros.everywhere
        for factor in [*single, *sorted(family, key=condition_size)]:
            if all(zeros.vanishes(one, inside) for one in family):
                break
            if not zeros.vanishes(factor, inside):
                chosen.append(factor)
                inside = zeros.within(inside, factor)
        for factor in list(chosen):
            others = [one for one in chosen if one is not factor]
            if others and zeros.vanishes(factor, zeros.within(zeros.everywhere, *others)):
                chosen = others
        if set(chosen) != set(family):
            self.steps.append(
                f"{self._said(family)} is the same as {self._said(chosen)} (each vanishes on the other)"
            )
        return chosen

    def _drop_parts(self) -> None:
        """Without families that are parts of others."""
        kept: list[list[Product]] = []
        for family in sorted(self.families, key=len):
            basis = self.zeros.within(self.zeros.everywhere, *family)
            for other in kept:
                if all(self.zeros.vanishes(factor, basis) for factor in other):
                    if set(family) != set(other):
                        self.steps.append(f"{self._said(family)} is a part of {self._said(other)}")
                    break
            else:
                kept.append(family)
        self.families = kept

    def _said(self, factors: list[Product]) -> str:
        return ", ".join(f"{condition_text(factor, self.names)} = 0" for factor in factors)


def condition_size(product: Product) -> int:
    """Short factors first."""
    return len(condition_text(product, {}))


def _angles(family: list[Product]) -> list[str]:
    """Names of the angles that occur."""
    waves = [leaf for leaf in leaves(*family) if isinstance(leaf, Trig)]
    return list(dict.fromkeys(name for wave in waves for name, _ in wave.angle))


def _single_waves(angles: list[str]) -> list[Product]:
    """sin and cos of each angle."""
    return [alone(Trig(kind, ((name, 1),))) for name in angles for kind in ("sin", "cos")]
