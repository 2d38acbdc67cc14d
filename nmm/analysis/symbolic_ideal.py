"""Common zeros of minors as an ideal in the cosines and sines of single angles (Gröbner bases)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nmm.analysis.symbolic import SymbolicAnalysis

#: More variables, or terms in all generators, are not tried: a Gröbner basis cannot be interrupted.
_VARIABLES, _TERMS, _WIDE = 12, 400, 10


class Ideal:
    """The minors of an analysis, without the lengths that are their factors, and cos² + sin² = 1.

    Attributes
    ----------
    nonzero : lengths that are taken not to be 0
    """

    def __init__(
        self, generators: list[Any], variables: list[Any], atoms: dict[Any, Any], nonzero: list[Any]
    ):
        self._generators = generators
        self._variables = variables
        self._atoms = atoms
        self.nonzero = tuple(str(symbol) for symbol in nonzero)

    @classmethod
    def of(cls, analysis: SymbolicAnalysis) -> Ideal | None:
        """The ideal; None when it is too large."""
        import sympy

        atoms = _atoms(list(analysis.minors.values()))
        lengths = {analysis.symbols[name] for name in analysis.geometry}
        lengths |= {symbol for name, symbol in analysis.symbols.items() if name in analysis.definitions}
        generators, nonzero = [], set()
        for minor in analysis.minors.values():
            if minor == 0:
                continue
            polynomial = _polynomial(sympy.numer(sympy.together(minor)), atoms)
            nonzero |= polynomial.free_symbols & lengths
            factors = [f for f, _ in sympy.factor_list(polynomial)[1] if f not in lengths]
            generators.append(sympy.Mul(*factors))
        order = sorted(nonzero, key=lambda symbol: list(analysis.symbols).index(str(symbol)))
        coordinates = set().union(*(g.free_symbols for g in generators)) - set(atoms.values()) - nonzero
        variables = [*atoms.values(), *sorted(coordinates, key=str), *order]
        terms = sum(len(sympy.Add.make_args(sympy.expand(g))) for g in generators)
        if len(variables) > _VARIABLES or terms > _TERMS:
            return None
        generators += _circles(atoms)
        return cls(generators, variables, atoms, order)

    @property
    def is_wide(self) -> bool:
        """Whether `forces` may take minutes."""
        return len(self._variables) > _WIDE

    def is_empty(self, without: Sequence[Any] = ()) -> bool:
        """Whether the minors, divided by factors that all have, share no zero (over the complex numbers)."""
        import sympy

        count = len(self._atoms) // 2
        minors, circles = self._generators[: len(self._generators) - count], self._generators[-count:]
        for factor in without:
            divisor = _polynomial(factor, self._atoms)
            minors = [sympy.cancel(minor / divisor) for minor in minors]
        if any(minor.is_number for minor in minors):
            return True
        return self._is_one([*minors, *(circles if count else [])])

    def forces(self, candidate: Any) -> bool:
        """Whether an expression vanishes at every common zero."""
        import sympy

        y = sympy.Symbol("nmm_y")
        return self._is_one([*self._generators, 1 - y * _polynomial(candidate, self._atoms)], y)

    def _is_one(self, generators: list[Any], *extra: Any) -> bool:
        import sympy

        w = sympy.Symbol("nmm_w")
        # No length is zero: a common one of them is w's inverse.
        inverse = [1 - w * sympy.Mul(*(sympy.Symbol(name, real=True) for name in self.nonzero))]
        basis = sympy.groebner([*generators, *inverse], *extra, w, *self._variables, order="grevlex")
        return bool(basis.exprs == [1])

    @staticmethod
    def vanishes_on(analysis: SymbolicAnalysis, expression: Any, conditions: list[Any]) -> bool:
        """Whether an expression is in the ideal of the conditions; it may vanish where they do without."""
        import sympy

        atoms = _atoms([expression, *conditions])
        generators = [_polynomial(condition, atoms) for condition in conditions] + _circles(atoms)
        value = _polynomial(sympy.numer(sympy.together(expression)), atoms)
        free = set().union(value.free_symbols, *(g.free_symbols for g in generators))
        variables = [*atoms.values(), *sorted(free - set(atoms.values()), key=str)]
        basis = sympy.groebner(generators, *variables, order="grevlex")
        return bool(basis.contains(value))


def _atoms(expressions: list[Any]) -> dict[Any, Any]:
    """A variable for the cosine and the sine of each angle."""
    import sympy

    angles = {
        angle
        for expression in expressions
        for function in sympy.sympify(expression).atoms(sympy.cos, sympy.sin)
        for angle in function.free_symbols
    }
    return {
        function(angle): sympy.Symbol(f"nmm_{function.__name__}_{angle}")
        for angle in sorted(angles, key=str)
        for function in (sympy.cos, sympy.sin)
    }


def _polynomial(expression: Any, atoms: dict[Any, Any]) -> Any:
    import sympy

    return sympy.expand(sympy.expand_trig(expression)).subs(atoms)


def _circles(atoms: dict[Any, Any]) -> list[Any]:
    variables = list(atoms.values())
    return [c**2 + s**2 - 1 for c, s in zip(variables[::2], variables[1::2], strict=True)]
