"""How runs look, in figures, playback and tables: a resolver's colour and dashes, symbols of quantities."""

import math
import re
from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple

from nmm.base.kinds import RESOLVERS

#: Okabe and Ito's colours, told apart by colour-blind readers.
BLUE, VERMILLION, GREEN, PINK = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, BLACK = "#E69F00", "#56B4E9", "#222222"
#: Of curves of one run, in a figure: its components, inputs, coordinates.
CYCLE = (BLUE, VERMILLION, GREEN, PINK, ORANGE, SKY, BLACK)
DASHES = ("-", "--", "-.", ":")

#: Colours of runs: each pair differs by more than 12 in CIEDE2000 for readers with any colour vision, and
#: each from white and from a dark page by a contrast of 3.
OF_RUNS = (BLUE, VERMILLION, GREEN, PINK, "#8C87F2", "#646573")

_GREEK = {"theta": "θ", "omega": "ω", "phi": "φ", "psi": "ψ", "alpha": "α", "beta": "β", "delta": "δ"}
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


class RunStyle(NamedTuple):
    """How a run appears among several: its name, its colour, its dashes."""

    name: str
    color: str
    dashes: str

    @property
    def rgb(self) -> tuple[float, float, float]:
        """The colour as shares of red, green and blue, 0 to 1."""
        red, green, blue = (int(self.color[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        return red, green, blue


def resolver_styles() -> dict[str, tuple[str, str]]:
    """Colour and dashes of each registered resolver, the same everywhere; no two of 24 are alike."""
    several = math.lcm(len(OF_RUNS), len(DASHES))  # then the dashes move on by one
    return {
        name: (OF_RUNS[k % len(OF_RUNS)], DASHES[(k + k // several) % len(DASHES)])
        for k, name in enumerate(RESOLVERS)
    }


def looks(resolvers: Sequence[str]) -> list[RunStyle]:
    """The look of each of several runs: its resolver's, unless another run has it already.

    Others take a colour that no resolver has, then the rest, with dashes that the colour has not had; no two
    of twenty runs look alike.
    """
    own = resolver_styles()
    spare = [color for color in OF_RUNS if color not in {color for color, _ in own.values()}]
    colors = [*spare, *(color for color in OF_RUNS if color not in spare)]
    every = [(color, dashes) for dashes in DASHES for color in colors]
    others = cycle([look for look in every if look not in own.values()] or every)
    assigned: list[RunStyle] = []
    for k, resolver in enumerate(resolvers):
        earlier = resolvers[:k].count(resolver)
        name = resolver.upper() if not earlier else f"{resolver.upper()} ({earlier + 1})"
        color, dashes = own[resolver] if resolver in own and not earlier else next(others)
        assigned.append(RunStyle(name, color, dashes))
    return assigned


def looks_of_labels(labels: Sequence[str]) -> list[RunStyle]:
    """The looks of labelled motions, a resolver's where the label names one; repeated labels get a number."""
    labelled = []
    for k, (label, look) in enumerate(zip(labels, looks([label.lower() for label in labels]), strict=True)):
        earlier = labels[:k].count(label)
        labelled.append(look._replace(name=f"{label} ({earlier + 1})" if label and earlier else label))
    return labelled


def pretty(name: str) -> str:
    """A coordinate's or an input's name as the paper writes it: theta → θ, q1 → q₁."""
    if name in _GREEK:
        return _GREEK[name]
    indexed = re.fullmatch(r"([A-Za-z])_?(\d+)", name)
    return indexed[1] + indexed[2].translate(_SUBSCRIPTS) if indexed else name


def rate(name: str) -> str:
    """What a joint's rate is called: q1's with a dot above its q."""
    symbol = pretty(name)
    return f"{symbol[0]}\u0307{symbol[1:]}" if symbol != name or len(name) == 1 else f"rate of {name}"
