"""How well a matrix J moves its task, as one number: a table of measures, each vectorised over many J.

B. Bayle, J.-Y. Fourquet and M. Renaud, "Manipulability of Wheeled Mobile Manipulators: Application to Motion
Generation", IJRR 22(7-8), 2003, generalise manipulability to mobile manipulators. Here that of the whole
robot (platform and arm, w), that of the arm alone (w_b) and the two weighed by α are each computed as their
lines say.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from nmm.analysis.singular.parts import singular_values, some_columns
from nmm.arrays import Array
from nmm.errors import InputError, expect_known


class Spectra:
    """Singular values of J (N, s, m), part by part, each computed once and when it is asked for.

    Parameters
    ----------
    J : (N, s, m), not a number where there is none
    columns : of each part, by its name
    """

    def __init__(self, J: Array, columns: Mapping[str, Sequence[int]]) -> None:
        self.undefined = np.asarray(~np.isfinite(J).all(axis=(1, 2)))
        self._J = np.where(self.undefined[:, np.newaxis, np.newaxis], 0.0, J) if self.undefined.any() else J
        self._columns = columns
        self._found: dict[str, Array] = {}

    def of(self, part: str) -> Array:
        """(N, s), falling; zeros where the part has fewer inputs than the task rows; NaN where J is."""
        if part not in self._found:
            values = singular_values(some_columns(self._J, self._columns[part]))
            values[self.undefined] = np.nan
            self._found[part] = values
        return self._found[part]


class Measure(NamedTuple):
    """One number for each J.

    Attributes
    ----------
    symbol : as figures write it
    about : what it is, a line
    unit : of a singular value ("sigma"), of the product of s of them ("volume"), or none
    of : (spectra, part, alpha) -> (N,)
    on_part : whether it speaks of the part asked for; the others have parts of their own
    better : 1 where more is better, -1 where less is
    needs : a part that it speaks of, whichever was asked for; "" for none
    """

    symbol: str
    about: str
    unit: Literal["sigma", "volume", ""]
    of: Callable[[Spectra, str, float], Array]
    on_part: bool = True
    better: float = 1.0
    needs: str = ""


def volume(spectra: Spectra, part: str) -> Array:
    """sqrt(det J Jᵀ), Yoshikawa's w, as the product of the singular values; 0 with too few inputs."""
    return np.asarray(np.prod(spectra.of(part), axis=-1))


def inverse_condition(spectra: Spectra, part: str) -> Array:
    """σ_min / σ_max, from 0 (lost rank, also where J = 0) to 1 (moves alike in every direction)."""
    values = spectra.of(part)
    largest = values[:, 0]
    return np.asarray(values[:, -1] / np.where(largest == 0.0, 1.0, largest))


def eccentricity(spectra: Spectra, part: str) -> Array:
    """sqrt(1 - (σ_min / σ_max)²), from 0 (a ball of velocities) to 1 (a flat one: lost rank)."""
    ratio = inverse_condition(spectra, part)
    return np.asarray(np.sqrt((1.0 - ratio) * (1.0 + ratio)))


def weighted(spectra: Spectra, part: str, alpha: float) -> Array:
    """α w_b + (1 - α) w: the arm's and the whole robot's manipulability, weighed by α in [0, 1]."""
    return alpha * volume(spectra, "arm") + (1.0 - alpha) * volume(spectra, part)


def _of_part(part: str, symbol: str) -> Measure:
    about = f"manipulability of the {part} alone"
    return Measure(symbol, about, "volume", lambda J, _, __: volume(J, part), on_part=False, needs=part)


#: The measures by name. A new one is a line here.
MEASURES: Mapping[str, Measure] = {
    "sigma_min": Measure(
        "σ_min",
        "the task's slowest velocity for inputs of size 1",
        "sigma",
        lambda J, part, _: J.of(part)[:, -1],
    ),
    "inverse_condition": Measure(
        "σ_min / σ_max",
        "inverse condition number: 1 isotropic, 0 singular",
        "",
        lambda J, part, _: inverse_condition(J, part),
    ),
    "manipulability": Measure(
        "w", "manipulability sqrt(det J Jᵀ)", "volume", lambda J, part, _: volume(J, part)
    ),
    "arm_manipulability": _of_part("arm", "w_b"),
    "platform_manipulability": _of_part("platform", "w_p"),
    "weighted": Measure(
        "α w_b + (1 − α) w",
        "manipulability of arm and whole robot, weighed",
        "volume",
        lambda J, _, alpha: weighted(J, "robot", alpha),
        on_part=False,
        needs="arm",
    ),
    "eccentricity": Measure(
        "w_5",
        "eccentricity sqrt(1 − (σ_min/σ_max)²): 0 isotropic, 1 singular",
        "",
        lambda J, part, _: eccentricity(J, part),
        better=-1.0,
    ),
}


def chosen(names: str | Sequence[str]) -> dict[str, Measure]:
    """Measures by name, in the order given.

    Raises
    ------
    InputError : none, or an unknown name
    """
    wanted = [names] if isinstance(names, str) else list(names)
    if not wanted:
        raise InputError(f"measures: expected at least one of {', '.join(MEASURES)}")
    for name in wanted:
        expect_known("measure", name, MEASURES, "measures")
    return {name: MEASURES[name] for name in wanted}


def unit_of(measure: Measure, row_units: Sequence[str], input_units: Sequence[str]) -> str:
    """A measure's unit: "m/rad", "(m/rad)²"; "mixed units" where rows or inputs have several; "" for none."""
    if not measure.unit or not input_units:
        return ""
    if len(set(row_units)) > 1 or len(set(input_units)) > 1:
        return "mixed units"
    row, per = row_units[0], input_units[0].removesuffix("/s")
    if row == per:
        return ""
    base, s = f"{row}/{per}", len(row_units)
    if measure.unit == "sigma" or s == 1:
        return base
    return f"({base}){str(s).translate(str.maketrans('0123456789', '⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
