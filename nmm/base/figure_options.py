"""As what figures are written, and how wide, asked for where a run is saved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from nmm.base.errors import InputError, expect_kind
from nmm.base.text_format import listed

#: The formats there are: pixels, and two of lines and text.
FORMATS = ("png", "pdf", "svg")
#: Widths by name, in: a column and the page of two columns in IEEE's journals and conferences.
WIDTHS = {"column": 3.5, "page": 7.16}
#: The narrowest figure that has room for its labels, and the widest, in.
LEAST, MOST = 3.0, 40.0


@dataclass(frozen=True)
class FigureOptions:
    """Formats and width of figures.

    Attributes
    ----------
    formats : some of "png", "pdf" and "svg"; each figure is written as each
    width : in, or "column" (3.5 in) or "page" (7.16 in); when not given, what reads well on a screen

    Raises
    ------
    InputError : an unknown format or width

    Examples
    --------
    >>> options = nmm.figures.FigureOptions(formats=["pdf", "png"], width="column")
    >>> options.inches
    3.5
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> folder = run.save("case1", figures=nmm.figures.FigureOptions(width=4.0))
    """

    formats: Sequence[str] = ("png",)
    width: float | str | None = None

    def __post_init__(self) -> None:
        known = listed(list(FORMATS), "or")
        if isinstance(self.formats, str) or not self.formats or not set(self.formats) <= set(FORMATS):
            raise InputError(where="formats of figures", expected=f"some of {known}", got=self.formats)
        _ = self.inches

    @property
    def inches(self) -> float | None:
        """The width, in; None for the figure's own."""
        if self.width is None or (isinstance(self.width, str) and self.width in WIDTHS):
            return None if self.width is None else WIDTHS[str(self.width)]
        number = isinstance(self.width, int | float) and not isinstance(self.width, bool)
        if not number or not LEAST <= float(self.width) <= MOST or not math.isfinite(float(self.width)):
            names = listed([f"{name!r} ({inches:g} in)" for name, inches in WIDTHS.items()], "or")
            raise InputError(
                where="width of figures",
                expected=f"{names}, or from {LEAST:g} to {MOST:g} in",
                got=self.width,
            )
        return float(self.width)

    def across(self) -> dict[str, Any]:
        """The width as the keyword of functions that draw; nothing where each draws its own."""
        return {} if self.inches is None else {"width": self.inches}


#: PNG, as wide as reads well on a screen.
PLAIN = FigureOptions()

#: What is taken where figures may be left out, too.
Drawn = bool | FigureOptions


def drawn_as(wanted: Drawn) -> FigureOptions | None:
    if isinstance(wanted, FigureOptions):
        return wanted
    expect_kind(wanted, bool, "figures", "True, False or FigureOptions(...)")
    return FigureOptions() if wanted else None
