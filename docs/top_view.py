"""Top views of platforms as plain SVG, written by hand: small, and the same on every machine.

Points are complex numbers in metres, x to the right and y up.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable
from pathlib import Path

#: Where the drawings are kept.
FOLDER = Path(__file__).parent / "images" / "platforms"

INK, BODY, WHEEL, AXIS = "#222", "#e9edf3", "#333", "#888"
#: Coordinates that are angles, lengths, inputs.
ANGLE, LENGTH, INPUT = "#b3261e", "#1f5fae", "#19783a"


class Drawing:
    """A sheet of so many metres, on which shapes are drawn one over another."""

    def __init__(self, width: float, height: float, scale: float = 100.0) -> None:
        self.width, self.height, self.scale = width, height, scale
        self.parts: list[str] = []

    def pixel(self, point: complex) -> tuple[float, float]:
        return round(self.scale * point.real, 1), round(self.scale * (self.height - point.imag), 1)

    def add(self, kind: str, **attributes: object) -> None:
        listed = " ".join(f'{name.replace("_", "-")}="{value}"' for name, value in attributes.items())
        self.parts.append(f"<{kind} {listed}/>")

    def line(self, points: Iterable[complex], color: str = INK, width: float = 1.2, **more: object) -> None:
        listed = " ".join(f"{x:g},{y:g}" for x, y in map(self.pixel, points))
        self.add("polyline", points=listed, fill="none", stroke=color, stroke_width=width, **more)

    def dashes(self, a: complex, b: complex, color: str = AXIS) -> None:
        self.line([a, b], color, 1, stroke_dasharray="5 4")

    def polygon(self, points: Iterable[complex], fill: str, stroke: str = INK) -> None:
        listed = " ".join(f"{x:g},{y:g}" for x, y in map(self.pixel, points))
        self.add(
            "polygon", points=listed, fill=fill, stroke=stroke, stroke_width=1.2, stroke_linejoin="round"
        )

    def arrow(self, a: complex, b: complex, color: str = INK, width: float = 1.6) -> None:
        """From a to b, with a head at b."""
        self.line([a, b - 0.06 * (b - a) / abs(b - a)], color, width)
        self.head(b, (b - a) / abs(b - a), color)

    def head(self, tip: complex, direction: complex, color: str) -> None:
        self.polygon(
            [tip, tip - direction * (0.13 + 0.045j), tip - direction * (0.13 - 0.045j)], color, color
        )

    def arc(self, center: complex, radius: float, begin: float, end: float, color: str = ANGLE) -> None:
        """From angle to angle (rad), with a head at the end."""
        turn = math.copysign(1.0, end - begin)
        stop = end - turn * 0.1 / radius
        points = [center + cmath.rect(radius, begin + k / 24 * (stop - begin)) for k in range(25)]
        self.line(points, color, 1.4)
        # The head is straight: it points along the chord of the arc below it.
        self.head(
            center + cmath.rect(radius, end), cmath.exp(1j * (end - turn * 0.06 / radius)) * 1j * turn, color
        )

    def dimension(self, a: complex, b: complex, away: complex, text: str, label: complex) -> None:
        """The length from a to b, drawn `away` from them, with its text at `label` from the middle."""
        u = (b - a) / abs(b - a)
        for point in (a, b):
            self.line([point, point + away * (1 + 0.05 / abs(away))], LENGTH, 0.8)
        self.line([a + away, b + away], LENGTH, 1.2)
        self.head(a + away, -u, LENGTH)
        self.head(b + away, u, LENGTH)
        self.text((a + b) / 2 + away + label, text, LENGTH)

    def text(self, at: complex, text: str, color: str = INK, size: int = 17) -> None:
        """Centred at a point. Names in italics; what follows "_" is a subscript."""
        x, y = self.pixel(at)
        name, _, below = text.partition("_")
        small = f'<tspan font-size="{size - 5}" dy="5">{below}</tspan>' if below else ""
        self.parts.append(
            f'<text x="{x:g}" y="{y + size / 3:.1f}" font-size="{size}" fill="{color}">{name}{small}</text>'
        )

    def dot(self, at: complex, radius: float = 3.5, fill: str = INK) -> None:
        x, y = self.pixel(at)
        self.add("circle", cx=f"{x:g}", cy=f"{y:g}", r=radius, fill=fill, stroke=INK, stroke_width=1.2)

    def world(self, at: complex = 0.35 + 0.35j) -> None:
        """The world's axes, in the corner."""
        self.arrow(at, at + 0.75, AXIS)
        self.arrow(at, at + 0.75j, AXIS)
        self.text(at + 0.75 - 0.16j, "x", AXIS)
        self.text(at + 0.75j - 0.16, "y", AXIS)

    def svg(self) -> str:
        w, h = round(self.width * self.scale), round(self.height * self.scale)
        style = 'font-family="Georgia, \'DejaVu Serif\', serif" font-style="italic" text-anchor="middle"'
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{w}" height="{h}" viewBox="0 0 {w} {h}" {style}>'
        )
        return "\n".join([head, f'<rect width="{w}" height="{h}" fill="#fff"/>', *self.parts, "</svg>", ""])


class Body:
    """A body's frame in a drawing: `at(point)` is where a point of it is, `e` its direction."""

    def __init__(self, drawing: Drawing, origin: complex, angle: float) -> None:
        self.drawing, self.origin, self.angle, self.e = drawing, origin, angle, cmath.exp(1j * angle)

    def at(self, point: complex) -> complex:
        return self.origin + self.e * point

    def hull(self, x0: float, x1: float, half: float, nose: float = 0.0) -> None:
        """A box, with its front corners cut by `nose`."""
        corners = [complex(x0, -half), complex(x1 - nose, -half), complex(x1, nose - half)]
        corners += [point.conjugate() for point in reversed(corners)]
        self.drawing.polygon(map(self.at, corners), BODY)

    def wheel(self, center: complex, heading: float = 0.0, length: float = 0.34, width: float = 0.12) -> None:
        turn = cmath.exp(1j * heading)
        box = [complex(sx * length / 2, sy * width / 2) for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        self.drawing.polygon([self.at(center + turn * corner) for corner in box], WHEEL)

    def axle(self, x: float, half: float) -> None:
        self.drawing.line([self.at(complex(x, -half)), self.at(complex(x, half))], INK, 2)
        for y in (half, -half):
            self.wheel(complex(x, y))

    def heading(self, forward: float, label: float = 0.62, radius: float = 0.5) -> None:
        """The angle theta, from a parallel of the world's x axis to the body's own."""
        drawing = self.drawing
        drawing.dashes(self.origin, self.origin + forward)
        drawing.arc(self.origin, radius, 0.0, self.angle)
        drawing.text(self.origin + cmath.rect(label, self.angle / 2), "θ", ANGLE)

    def input(self, begin: complex, end: complex, text: str, label: complex) -> None:
        """A velocity's arrow, with its name at `label` (in the body's axes) from its tip."""
        self.drawing.arrow(self.at(begin), self.at(end), INPUT, 2.2)
        self.drawing.text(self.at(end + label), text, INPUT)

    def turning(
        self, radius: float = 0.75, begin: float = 100.0, end: float = 150.0, text: str = "ω"
    ) -> None:
        """The turning rate's arc about the origin, between two angles (degrees) from the body's x axis."""
        a, b = (self.angle + math.radians(degrees) for degrees in (begin, end))
        self.drawing.arc(self.origin, radius, a, b, INPUT)
        self.drawing.text(self.origin + cmath.rect(radius + 0.17, (a + b) / 2), text, INPUT)

    def point(self, label: complex, text: str = "x, y") -> None:
        """The reference point, with its name at `label` (in the world's axes) from it."""
        self.drawing.dot(self.origin, fill="#fff")
        self.drawing.text(self.origin + label, text)
