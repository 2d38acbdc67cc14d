"""Draw the platforms of docs/platforms.md: `python docs/make_platform_drawings.py`.

Each drawing is a view from above of one platform with its coordinates, lengths and inputs.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

from top_view import ANGLE, AXIS, BODY, FOLDER, INK, Body, Drawing

TILT = math.radians(25.0)


def unicycle() -> Drawing:
    drawing = Drawing(3.9, 2.5)
    drawing.world()
    body = Body(drawing, 1.75 + 1.1j, TILT)
    body.hull(-0.5, 0.75, 0.42, 0.2)
    body.axle(0.0, 0.55)
    body.heading(1.75, 1.33, 1.15)
    body.input(0.75, 1.55, "v", 0.17)
    body.turning(0.95, 105, 155)
    body.point(-0.24 - 0.1j)
    return drawing


def differential() -> Drawing:
    drawing = Drawing(4.2, 2.9)
    drawing.world()
    body = Body(drawing, 2.15 + 1.3j, TILT)
    body.hull(-0.5, 0.75, 0.42, 0.2)
    body.axle(0.0, 0.6)
    body.heading(1.75, 1.33, 1.15)
    for y, name, label in ((0.6, "ω_left", 0.26 + 0.02j), (-0.6, "ω_right", 0.24 - 0.12j)):
        body.input(complex(0.2, y), complex(0.75, y), name, label)
    drawing.dimension(body.at(0.6j), body.at(-0.6j), -0.85 * body.e, "track", -0.3 * body.e)
    drawing.dimension(body.at(-0.17 + 0.6j), body.at(0.17 + 0.6j), 0.3j * body.e, "2 radius", -0.05 + 0.22j)
    body.point(-0.24 - 0.1j)
    return drawing


def skid_steer() -> Drawing:
    drawing = Drawing(5.0, 3.6)
    drawing.world()
    body, half, out, ahead = Body(drawing, 2.6 + 1.75j, math.radians(18.0)), complex(0.6, 0.55), 1.0, -0.2
    body.hull(-0.85, 0.95, 0.42, 0.12)
    for x in (half.real, -half.real):
        drawing.line([body.at(complex(x, -half.imag)), body.at(complex(x, half.imag))], INK, 2)
        for y in (half.imag, -half.imag):
            body.wheel(complex(x, y), 0.0)
    drawing.dashes(body.at(complex(ahead, -out - 0.2)), body.at(complex(ahead, out + 0.2)))
    for y, name, label in ((out, "left", -0.36 + 0.1j), (-out, "right", -0.42 - 0.12j)):
        drawing.dot(body.at(complex(ahead, y)), 3.5)
        drawing.text(body.at(complex(ahead, y)) + label, name, AXIS, 14)
    body.heading(1.45, 1.05, 0.9)
    for y, name, label in ((half.imag, "ω_left", 0.1 + 0.2j), (-half.imag, "ω_right", 0.32 - 0.1j)):
        body.input(complex(half.real + 0.2, y), complex(half.real + 0.7, y), name, label)
    rear = -half
    drawing.dimension(body.at(rear), body.at(half.conjugate()), -0.75j * body.e, "length", 0.1 - 0.2j)
    drawing.dimension(body.at(rear), body.at(-half.conjugate()), -0.7 * body.e, "width", -0.38 * body.e)
    body.point(0.22 - 0.14j)
    return drawing


def bicycle(front_drive: bool) -> Drawing:
    drawing = Drawing(4.1, 2.95)
    drawing.world()
    body, wheelbase, steering = Body(drawing, 1.55 + 1.0j, math.radians(22.0)), 1.45, math.radians(42.0)
    body.hull(-0.35, 1.95, 0.42, 0.15)
    center = 1j * wheelbase / math.tan(steering)
    for wheel in (0, wheelbase):
        drawing.dashes(body.at(wheel), body.at(center))
    drawing.dot(body.at(center), 2.5)
    drawing.text(body.at(center) + 0.12 + 0.2j, "centre of turning", AXIS, 14)
    body.axle(0.0, 0.55)
    drawing.line([body.at(0), body.at(wheelbase)], INK, 2)
    drawing.dashes(body.at(wheelbase), body.at(wheelbase + 1.05))
    drawing.arc(body.at(wheelbase), 0.85, body.angle, body.angle + steering)
    drawing.text(body.at(wheelbase + cmath.rect(1.0, steering / 2)), "δ", ANGLE)
    if not front_drive:
        drawing.dashes(body.at(wheelbase), body.at(wheelbase + cmath.rect(1.0, steering)))
    body.wheel(wheelbase, steering)
    body.heading(1.2, 0.86, 1.02)
    if front_drive:
        ahead = cmath.exp(1j * steering)
        body.input(wheelbase + 0.17 * ahead, wheelbase + 1.1 * ahead, "v", 0.15 * ahead)
    else:
        body.input(0.0, 0.75, "v", -0.05 + 0.16j)
    drawing.dimension(body.at(0), body.at(wheelbase), -0.8j * body.e, "wheelbase L", 0.3 - 0.2j)
    body.point(0.3 - 0.14j)
    return drawing


def tractor() -> Drawing:
    drawing = Drawing(6.0, 3.2)
    drawing.world(5.15 + 0.35j)
    front = Body(drawing, 4.35 + 1.9j, math.radians(28.0))
    hitch, lengths, angles = 0.6, (1.5, 1.4), (math.radians(-30.0), math.radians(26.0))
    first = Body(drawing, front.at(-hitch), front.angle + angles[0])
    second = Body(drawing, first.at(-lengths[0]), first.angle + angles[1])
    for body, length in ((second, lengths[1]), (first, lengths[0])):
        body.hull(-length - 0.35, -length + 0.3, 0.36)
        drawing.line([body.at(-length), body.origin], INK, 2)
        body.axle(-length, 0.5)
    front.hull(-0.35, 0.7, 0.4, 0.2)
    drawing.line([front.at(-hitch), front.origin], INK, 2)
    front.axle(0.0, 0.52)
    for body, ahead, name in ((first, front, "hitch1"), (second, first, "hitch2")):
        drawing.dashes(body.origin, body.origin - 0.95 * ahead.e)
        drawing.arc(body.origin, 0.78, ahead.angle + math.pi, body.angle + math.pi)
        beyond = math.copysign(0.26, ahead.angle - body.angle)
        drawing.text(body.origin - cmath.rect(0.85, ahead.angle + beyond), name, ANGLE, 15)
        drawing.dot(body.origin, 3, "#fff")
    front.heading(1.3, 1.2, 1.02)
    front.input(0.7, 1.3, "v", 0.15)
    front.turning(0.9, 52, 96)
    front.point(0.32 - 0.14j)
    drawing.dimension(front.at(-hitch), front.at(0), -0.85j * front.e, "hitch", 0.12 - 0.2j)
    drawing.dimension(first.at(-lengths[0]), first.at(0), 0.75j * first.e, "length", 0.15j)
    drawing.dimension(second.at(-lengths[1]), second.at(0), -0.75j * second.e, "length", 0.1 - 0.2j)
    return drawing


def omnidirectional() -> Drawing:
    drawing = Drawing(3.9, 3.1)
    drawing.world()
    body = Body(drawing, 1.8 + 1.35j, TILT)
    drawing.polygon([body.at(cmath.rect(0.62, k * math.pi / 24)) for k in range(48)], BODY)
    for k in range(3):
        out = cmath.exp(1j * (math.pi + k * 2 * math.pi / 3))
        body.wheel(0.62 * out, cmath.phase(out) + math.pi / 2)
    body.heading(1.75, 1.33, 1.15)
    body.input(0.0, 1.5, "v_x", 0.19)
    body.input(0.0, 1.2j, "v_y", 0.2j)
    body.turning(0.9, 120, 165)
    body.point(-0.24 - 0.1j)
    return drawing


def mecanum() -> Drawing:
    drawing = Drawing(4.9, 3.4)
    drawing.world(0.35 + 0.3j)
    body, half = Body(drawing, 2.55 + 1.9j, math.radians(18.0)), complex(0.9, 0.62)
    body.hull(-1.1, 1.15, 0.48, 0.1)
    slant = {"left": -0.66 + 0.13j, "right": 0.62 - 0.13j}
    for x, end in ((half.real, "front"), (-half.real, "rear")):
        drawing.line([body.at(complex(x, -half.imag)), body.at(complex(x, half.imag))], INK, 2)
        for y, side in ((half.imag, "left"), (-half.imag, "right")):
            center, slope = complex(x, y), math.copysign(1.0, x * y)
            body.wheel(center, 0.0, 0.52, 0.22)
            for k in (-1, 0, 1):
                roller = complex(0.085, 0.085 * slope)
                drawing.line(
                    [body.at(center + 0.16 * k - roller), body.at(center + 0.16 * k + roller)], "#fff", 2
                )
            drawing.text(body.at(center) + slant[side], f"{end} {side}", INK, 14)
    body.heading(1.55, 0.72, 0.55)
    # The direction in which the wheel in front to the left grips, across the axes of its lower rollers.
    corner, grip = body.at(half), body.e * cmath.exp(-1j * math.pi / 4)
    drawing.dashes(corner, corner + 0.95 * body.e)
    drawing.dashes(corner, corner + 0.95 * grip, ANGLE)
    drawing.arc(corner, 0.75, body.angle, body.angle - math.pi / 4)
    drawing.text(corner + cmath.rect(0.9, body.angle - math.pi / 8), "γ", ANGLE)
    right, rear = body.at(half.conjugate()), body.at(-half)
    drawing.dimension(rear, right, -0.6j * body.e, "length", 0.1 - 0.2j)
    drawing.dimension(rear, body.at(-half.conjugate()), -0.75 * body.e, "width", -0.35 * body.e)
    body.point(-0.05 - 0.22j)
    return drawing


def fixed() -> Drawing:
    drawing = Drawing(2.8, 2.2)
    body = Body(drawing, 1.0 + 0.75j, 0.0)
    body.hull(-0.5, 0.5, 0.5)
    for corner in (0.38 + 0.38j, 0.38 - 0.38j, -0.38 + 0.38j, -0.38 - 0.38j):
        drawing.dot(body.at(corner), 4, "#fff")
    drawing.arrow(body.origin, body.at(1.1), AXIS)
    drawing.arrow(body.origin, body.at(1.1j), AXIS)
    drawing.text(body.at(1.25), "x", AXIS)
    drawing.text(body.at(1.15j - 0.16), "y", AXIS)
    drawing.dot(body.origin, fill="#fff")
    return drawing


DRAWINGS: dict[str, Callable[[], Drawing]] = {
    "unicycle": unicycle,
    "differential": differential,
    "car": lambda: bicycle(front_drive=False),
    "front_drive_car": lambda: bicycle(front_drive=True),
    "tractor": tractor,
    "omnidirectional": omnidirectional,
    "skid_steer": skid_steer,
    "mecanum": mecanum,
    "fixed": fixed,
}

if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWINGS.items():
        (FOLDER / f"{name}.svg").write_text(draw().svg(), encoding="utf-8")
