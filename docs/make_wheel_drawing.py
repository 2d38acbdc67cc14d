"""Draw the wheels of docs/platforms.md: `python docs/make_wheel_drawing.py` writes one SVG."""

from __future__ import annotations

import cmath
import math

from top_view import ANGLE, AXIS, BODY, FOLDER, INK, INPUT, LENGTH, Body, Drawing

WIDE, HIGH = 3.4, 3.1
HEADING = math.radians(25.0)


def panel(drawing: Drawing, column: int, row: int, title: str) -> complex:
    """The origin of a carrier's frame, with its axes and a piece of it; rows count from below."""
    corner = complex(column * WIDE, row * HIGH)
    box = [corner + complex(x, y) for x, y in ((0.1, 0.1), (WIDE - 0.1, 0.1), (WIDE - 0.1, HIGH - 0.45))]
    box.append(corner + complex(0.1, HIGH - 0.45))
    drawing.polygon(box, BODY, BODY)
    drawing.text(corner + complex(WIDE / 2, HIGH - 0.22), title)
    origin = corner + 0.45 + 0.45j
    drawing.arrow(origin, origin + 0.6, AXIS)
    drawing.arrow(origin, origin + 0.6j, AXIS)
    drawing.text(origin + 0.72 - 0.02j, "x", AXIS)
    drawing.text(origin + 0.73j, "y", AXIS)
    drawing.dot(origin, 3, AXIS)
    return origin


def lengths(drawing: Drawing, origin: complex, to: complex) -> None:
    """Dashed lines along the frame's axes to a point."""
    drawing.dashes(complex(to.real, origin.imag), to, LENGTH)
    drawing.dashes(complex(origin.real, to.imag), to, LENGTH)
    drawing.text(complex(to.real, origin.imag - 0.14), "x", LENGTH)
    drawing.text(complex(origin.real - 0.15, to.imag), "y", LENGTH)


def wheel(drawing: Drawing, center: complex, heading: float, ahead: float = 0.85) -> Body:
    """A wheel seen from above, with the direction in which it rolls."""
    body = Body(drawing, center, heading)
    body.wheel(0.0, length=0.62, width=0.2)
    drawing.arrow(body.at(0.0), body.at(ahead), INPUT, 2.2)
    return body


def angle(
    drawing: Drawing, at: complex, radius: float, begin: float, end: float, name: str, away: float = 0.36
) -> None:
    """An angle with its name `away` from the arc's middle."""
    drawing.arc(at, radius, begin, end)
    drawing.text(at + cmath.rect(radius + away, (begin + end) / 2), name, ANGLE)


def fixed(drawing: Drawing) -> None:
    origin = panel(drawing, 0, 1, "FixedWheel")
    center = origin + 1.2 + 1.1j
    lengths(drawing, origin, center)
    drawing.dashes(center, center + 1.2)
    body = wheel(drawing, center, HEADING, 1.0)
    angle(drawing, center, 0.75, 0.0, HEADING, "heading", 0.46)
    drawing.text(body.at(1.12), "v", INPUT)
    drawing.dot(center, 3, "#fff")


def steered(drawing: Drawing) -> None:
    origin = panel(drawing, 1, 1, "SteeredWheel")
    pivot, turned = origin + 1.5 + 1.05j, HEADING + math.radians(35.0)
    lengths(drawing, origin, pivot)
    drawing.dashes(pivot, pivot + cmath.rect(1.0, HEADING))
    frame = Body(drawing, pivot, turned)
    drawing.dashes(frame.at(-0.75), frame.at(0.95))
    place = -0.5 + 0.36j
    drawing.line([frame.at(0.0), frame.at(place.real), frame.at(place)], INK, 2.4)
    wheel(drawing, frame.at(place), turned, 0.75)
    angle(drawing, pivot, 0.75, HEADING, turned, "joint", 0.27)
    drawing.dimension(pivot, frame.at(place.real), -0.2j * frame.e, "trail", -0.24j * frame.e)
    drawing.dimension(frame.at(place.real), frame.at(place), -0.28 * frame.e, "offset", -0.22 * frame.e)
    drawing.dot(pivot, 4.5, "#fff")


def caster(drawing: Drawing) -> None:
    origin = panel(drawing, 2, 1, "CasterWheel")
    pivot, turned = origin + 1.3 + 1.1j, HEADING + math.radians(-60.0)
    lengths(drawing, origin, pivot)
    drawing.dashes(pivot, pivot + cmath.rect(1.15, HEADING))
    frame = Body(drawing, pivot, turned)
    drawing.dashes(pivot, frame.at(0.95))
    drawing.line([pivot, frame.at(-0.5)], INK, 2.4)
    wheel(drawing, frame.at(-0.5), turned, 0.45)
    angle(drawing, pivot, 0.7, HEADING, turned, "swivel", 0.42)
    drawing.dimension(pivot, frame.at(-0.5), -0.24j * frame.e, "trail", -0.2j * frame.e - 0.12)
    drawing.dot(pivot, 4.5, "#fff")


def omni(drawing: Drawing) -> None:
    origin = panel(drawing, 0, 0, "OmniWheel")
    center, roller = origin + 1.3 + 1.0j, math.radians(45.0)
    lengths(drawing, origin, center)
    body = Body(drawing, center, HEADING)
    box = [0.42 + 0.17j, -0.42 + 0.17j, -0.42 - 0.17j, 0.42 - 0.17j]
    drawing.polygon([body.at(point) for point in box], "#c9ced6")
    # The roller that touches the ground lies along the grip; the upper ones, seen from above, mirror it.
    for k in range(-2, 3):
        middle, half = complex(0.17 * k, 0.0), cmath.rect(0.19, -roller)
        drawing.line([body.at(middle - half), body.at(middle + half)], "#777", 5, stroke_linecap="round")
    touching = cmath.rect(0.3, roller)
    drawing.line([body.at(-touching), body.at(touching)], LENGTH, 7, stroke_linecap="round")
    drawing.arrow(center, body.at(1.15), INPUT, 2.2)
    grip = HEADING + roller
    drawing.arrow(center, center + cmath.rect(1.05, grip), LENGTH, 2.2)
    drawing.text(center + cmath.rect(1.0, grip) + 0.3, "grip", LENGTH)
    angle(drawing, center, 0.78, HEADING, grip, "γ", 0.15)
    drawing.dot(center, 3, "#fff")


def hitch(drawing: Drawing) -> None:
    origin = panel(drawing, 1, 0, "Hitch")
    at, turned = origin + 0.95 + 1.25j, math.radians(-35.0)
    lengths(drawing, origin, at)
    drawing.dashes(at, at + 1.3)
    frame = Body(drawing, at, turned)
    drawing.polygon(
        [frame.at(p) for p in (-0.1 + 0.28j, 1.05 + 0.28j, 1.05 - 0.28j, -0.1 - 0.28j)], "#d6e2d9"
    )
    drawing.arrow(at, frame.at(0.75), INK)
    drawing.arrow(at, frame.at(0.55j), INK)
    drawing.text(frame.at(0.87), "x")
    drawing.text(frame.at(0.68j), "y")
    angle(drawing, at, 1.25, 0.0, turned, "joint", 0.26)
    drawing.dot(at, 4.5, "#fff")


def concurrent(drawing: Drawing) -> None:
    corner = panel(drawing, 2, 0, "axes that meet") + 0.05
    center = corner + 0.2 + 1.75j
    places = (1.25 + 1.1j, 1.2 + 0.3j, 2.1 + 0.3j)
    for place in places:
        at = corner + place
        drawing.dashes(at, center)
        Body(drawing, at, cmath.phase(1j * (at - center))).wheel(0.0, length=0.4, width=0.14)
    drawing.dot(center, 3.5, "#fff")
    drawing.text(center + 0.75 + 0.12j, "centre of rotation", INK, 14)


def draw() -> Drawing:
    drawing = Drawing(3 * WIDE, 2 * HIGH)
    for part in (fixed, steered, caster, omni, hitch, concurrent):
        part(drawing)
    return drawing


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / "wheels.svg").write_text(draw().svg(), encoding="utf-8")
