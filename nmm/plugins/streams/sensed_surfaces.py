"""Surfaces of what is sensed while a stream goes on, made where they are drawn."""

from __future__ import annotations

import numpy as np

from nmm.base.text_format import one_line
from nmm.model.collisions.elements.cell_mesh import cell_triangles
from nmm.plugins.streams.pictures import RobotPicture, Said, SensedCells, Still, Surface, Triangles, Undrawn

LONGEST = 300


class SensedSurfaces:
    """Makes surfaces, and says of which bodies there is none, and why, where that is news."""

    def __init__(self, still: Still) -> None:
        self._names = [body.name for body in still.bodies]
        self._undrawn: dict[int, str] = {}

    def of(self, number: int, picture: RobotPicture) -> tuple[Triangles | None, Said | None]:
        """The surface that a body has in a picture that changes it, None for none; and what is to be said."""
        made = meshed(picture.changed[number])
        if isinstance(made, Triangles):
            self._undrawn.pop(number, None)
            return made, None
        known, self._undrawn[number] = self._undrawn.get(number, ""), made.why
        if made.why in ("", known):
            return None, None
        text = one_line(f"{self._names[number]} is not drawn: {made.why}", LONGEST)
        return None, Said(picture.t, picture.stamp, "", text, True)


def meshed(shape: Surface) -> Triangles | Undrawn:
    """The surface of what was sensed; what is none says why."""
    if not isinstance(shape, SensedCells):
        return shape
    try:
        vertices, faces = cell_triangles(shape.points, shape.corner, shape.cell)
    except Exception as error:  # of numbers that came from a sensor
        return Undrawn(f"no surface can be made of what was sensed ({type(error).__name__}: {error})")
    drawn = len(faces) and np.isfinite(vertices).all()
    return Triangles(vertices, faces) if drawn else Undrawn("no surface can be made of what was sensed")
