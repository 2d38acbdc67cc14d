"""G of a robot's platform: its kernel, run on symbols."""

from __future__ import annotations

import numpy as np

from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.frames import Frames
from nmm.analysis.formulas.quotient import Quotient, Untraceable, common_multiple, quotient
from nmm.analysis.formulas.tracing import traced
from nmm.errors import InputError
from nmm.platforms.base import Platform

#: Digits of a number in G beyond which no one reads it: those of roots and the like.
_READABLE = 20
#: G times one factor a column, and these factors.
Columns = tuple[list[list[Expansion]], list[Expansion]]


def platform_columns(frames: Frames) -> Columns:
    """The rows of G (n_p, p), each column multiplied by a common denominator, and the denominators (p).

    Lengths are divided by as they are: a denominator is what may vanish, such as cos(steering).

    Raises
    ------
    InputError : a platform whose kernel does what has no formula
    """
    platform, ring = frames.robot.platform, frames.geometry.ring
    try:
        G = traced_G(platform, frames)[0]
        columns = [[quotient(entry, ring) for entry in column] for column in G.T]
        if any(
            _digits(part) > _READABLE
            for column in columns
            for entry in column
            for part in (entry.over, entry.under)
        ):
            raise Untraceable("its numbers have too many digits to be read")
    except (Untraceable, TypeError) as error:  # TypeError: of numbers alone
        raise InputError(
            f"symbolic: no formula for G of the platform {platform.name!r}: {error} "
            "(the numeric analysis takes every platform)"
        ) from None
    below = [common_multiple(entry.under for entry in column) for column in columns]
    above = [[entry.above(under) for entry in column] for column, under in zip(columns, below, strict=True)]
    return [[column[i] for column in above] for i in range(platform.n_p)], below


def _digits(value: Expansion) -> int:
    return max((len(str(part)) for number in value.terms.values() for part in number), default=0)


def traced_G(platform: Platform, frames: Frames) -> tuple[np.ndarray, np.ndarray]:
    """G (n_p, p) and G_q (n_p, p, n_p) as the platform's kernel writes them; see `Platform.velocity_map`."""
    geometry, names = frames.geometry, platform.parameter_names
    parameters: list[object] = list(platform.parameters)
    if names:
        pairs = zip(platform.parameters, names, strict=True)
        parameters = [Quotient(geometry.length(float(value), name)) for value, name in pairs]
        geometry.notes += [
            f"{name} is {what}" for name, what in names.items() if what and name in geometry.values
        ]
    n_p = platform.n_p
    qp = np.array(frames.coordinates()[:n_p], dtype=object)
    G = np.full((n_p, platform.p), 0.0, dtype=object)
    G_q = np.full((n_p, platform.p, n_p), 0.0, dtype=object)
    traced(platform.velocity_map, frames)(qp, np.array(parameters, dtype=object), G, G_q)
    return G, G_q
