"""How manipulability ellipsoids of a run are drawn, asked for where it is saved, played or drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from nmm.base.arrays import positive
from nmm.base.errors import expect_kind

#: How much of each input counts as 1: by name (1 of its unit where not named), or "limits" for its own.
Sizes = Mapping[str, float] | str | None


@dataclass(frozen=True)
class EllipsoidOptions:
    """How ellipsoids are drawn.

    Attributes
    ----------
    frame : the frame; the one that the task positions when not given, or the arm's tip
    sizes : how much of each input counts as 1 (see `nmm.analysis.singular.ellipsoids.ellipsoids_along`)
    scale : metres drawn for each m/s; when not given, so that the largest is up to a third of the robot's
        extent

    Raises
    ------
    InputError : a scale that is not above zero

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_3r_position").run()
    >>> options = nmm.playback.EllipsoidOptions(frame="ee", scale=0.2)
    >>> nmm.playback.write_html([run], "ellipsoids.html", ellipsoids=options).name
    'ellipsoids.html'
    """

    frame: str | None = None
    sizes: Sizes = None
    scale: float | None = None

    def __post_init__(self) -> None:
        if self.scale is not None:
            positive(self.scale, "scale of the ellipsoids")


#: What drawing functions take: whether to, and how.
Wanted = bool | EllipsoidOptions


def options_of(wanted: Wanted) -> EllipsoidOptions | None:
    if isinstance(wanted, EllipsoidOptions):
        return wanted
    expect_kind(wanted, bool, "ellipsoids", "True, False or EllipsoidOptions(...)")
    return EllipsoidOptions() if wanted else None
