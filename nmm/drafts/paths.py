"""What a hand can be asked to follow from where it starts: gentle paths, the most likely to work first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.robots.robot import Robot

#: Radii of circles, lengths of lines, and of those on a fixed base, as shares of the arm's reach.
_RADII, _LENGTHS, _FIXED = (1.5, 3.0, 6.0), (1.5, 0.5), (0.2, 0.1, 0.04)
#: Of the hand: m/s with a metre of reach, at most; and slower.
_SPEEDS = (0.25, 0.1, 0.04)
#: A run is as long as the path at that speed, within these, s.
_LEAST, _MOST = 10.0, 30.0


@dataclass(frozen=True, eq=False)
class HandsPath:
    """A reference as the file has it, how long it takes (s), and a line on it."""

    reference: dict[str, Any]
    duration: float
    why: str


def paths(robot: Robot, axes: str, place: Array) -> Iterator[HandsPath]:
    """Circles where the hand moves on the ground with a platform that drives, lines else.

    Parameters
    ----------
    axes : along which the hand is led, some of x, y, z
    place : of the hand at the start, along these axes, m
    """
    drives = robot.platform.n_p > 0
    size = float(np.clip(robot.reach, 0.1, 2.0))
    for speed in _SPEEDS:
        if drives and "x" in axes and "y" in axes:
            yield from (_circle(place, share * max(size, 0.3), speed) for share in _RADII)
        for share in _LENGTHS if drives else _FIXED:
            for axis in range(len(axes)):
                for sign in (1.0, -1.0):
                    yield _line(axes, place, axis, sign * share * size, speed * size)


def _circle(place: Array, radius: float, speed: float) -> HandsPath:
    radius, rate = _rounded(radius), _rounded(speed / radius)
    center = [place[0], place[1] + radius, *place[2:]]
    reference = {
        "kind": "circle",
        "center": _places(center),
        "radius": radius,
        "rate": rate,
        "phase": "-pi/2",
    }
    duration = float(np.clip(round(2 * math.pi / rate), _LEAST, _MOST))
    return HandsPath(
        reference, duration, "it begins where the hand is, straight ahead, and bends to the left"
    )


def _line(axes: str, place: Array, axis: int, length: float, speed: float) -> HandsPath:
    end = place.copy()
    end[axis] += length
    duration = float(np.clip(round(2 * abs(length) / speed), _LEAST, _MOST))
    reference = {
        "kind": "line",
        "start": _places(place),
        "end": _places(end),
        "duration": duration,
        "profile": "smooth",
    }
    return HandsPath(reference, duration, f"it begins where the hand is, and goes along {axes[axis]}")


def _rounded(value: float) -> float:
    """To two digits."""
    return float(f"{value:.2g}")


def _places(point: Sequence[float] | Array) -> list[float]:
    """To a tenth of a millimetre, m, without -0."""
    return [round(float(value), 4) + 0.0 for value in point]
