"""Floats as the fractions that were meant."""

from __future__ import annotations

from fractions import Fraction


def exact(value: float) -> Fraction:
    """The shortest decimal fraction that is this float, without the dust of its last digits."""
    near = Fraction(value).limit_denominator(1_000_000)
    return near if abs(float(near) - value) < 1e-15 * max(1.0, abs(value)) else Fraction(repr(value))
