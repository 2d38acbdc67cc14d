"""Values as people write them: "0 or ±π", "±π/2", "0.52 rad (30°)", and relations "q1 + q2 = ±π/2"."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import degrees, pi

from nmm.words import listed

#: Values this near a fraction of pi are written as one: files write pi/2 as 1.5708.
NEAR = 5e-5
#: Denominators of such fractions.
PARTS = (1, 2, 3, 4, 6)


def fraction_of_pi(value: float) -> str:
    """ "0", "π", "-π/2", "3π/4"; "" for anything else."""
    for part in PARTS:
        times = round(value * part / pi)
        if abs(value - times * pi / part) <= NEAR:
            if times == 0:
                return "0"
            number = "" if abs(times) == 1 else str(abs(times))
            return f"{'-' if times < 0 else ''}{number}π{'' if part == 1 else f'/{part}'}"
    return ""


def value_text(value: float, unit: str) -> str:
    """One value with its unit; an angle as a fraction of pi where it is one, in degrees too where not."""
    if unit != "rad":
        return f"{value if abs(value) > NEAR else 0.0:.4g} m"
    return fraction_of_pi(value) or f"{value:.4g} rad ({degrees(value):.4g}°)"


def values_text(values: Iterable[float], unit: str, circular: bool = False) -> str:
    """Several values: "0 or ±π", "±π/2". A circular π is ±π."""
    found: list[str] = []
    left = sorted(values, key=lambda value: (round(abs(value), 6), -value))
    while left:
        value = left.pop(0)
        opposite = next((other for other in left if abs(other + value) <= 2.0 * NEAR), None)
        both = opposite is not None and abs(value) > NEAR
        if both:
            left.remove(opposite)  # type: ignore[arg-type]  # one was found
        text = value_text(abs(value) if both else value, unit)
        whole_turn = circular and unit == "rad" and abs(abs(value) - pi) <= NEAR
        found.append(f"±{text.lstrip('-')}" if both or whole_turn else text)
    return either(found)


def combination_text(coefficients: Mapping[str, int]) -> str:
    """ "q1 + q2", "2 q1 - q3"."""
    text = ""
    for name, number in coefficients.items():
        size = name if abs(number) == 1 else f"{abs(number)} {name}"
        sign = "-" if number < 0 else "+"
        text += f" {sign} {size}" if text else f"{'-' if number < 0 else ''}{size}"
    return text


def either(texts: Sequence[str]) -> str:
    """ "a", "a or b", "a, b or c"."""
    return listed(texts, "or")
