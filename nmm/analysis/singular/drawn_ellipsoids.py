"""Which ellipsoids of a robot are drawn, of which frame, and how large: for figures and playback alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.analysis.singular.ellipsoids import Ellipsoids, carried_frame, ellipsoids_along, frame_of
from nmm.analysis.singular.parts import WHOLE
from nmm.arrays import Array
from nmm.robots.robot import Robot
from nmm.runs.ellipsoid_options import EllipsoidOptions

ARM = "arm"
NAMES = {WHOLE: "whole robot", ARM: "arm alone"}

#: The largest radius as drawn, beside the robot's extent, at most.
SHARE = 1.0 / 3.0


def drawn_frame(options: EllipsoidOptions, robot: Robot, frame: str | None) -> str:
    """The frame asked for, or a motion's own if the arm carries it, or the arm's tip."""
    return carried_frame(robot, frame) if options.frame is None else frame_of(robot, options.frame)


def drawn_ellipsoids(options: EllipsoidOptions, robot: Robot, frame: str, q: Array) -> dict[str, Ellipsoids]:
    """Those of the whole robot at q (N, n) and, where a platform moves it too, of the arm alone."""
    both = robot.platform.p > 0 and robot.n_u > robot.platform.p
    parts = (WHOLE, ARM) if both else (WHOLE,)
    return {part: ellipsoids_along(robot, frame, q, part, options.sizes) for part in parts}


def drawn_scale(
    options: EllipsoidOptions, extent: float, ellipsoids: Sequence[Mapping[str, Ellipsoids]]
) -> float:
    """Metres drawn for each m/s, for robots of that extent, m."""
    largest = largest_radius(ellipsoids)
    if options.scale is not None or not largest > 0.0:
        return 1.0 if options.scale is None else float(options.scale)
    return _nice(SHARE * extent / largest)


def largest_radius(ellipsoids: Sequence[Mapping[str, Ellipsoids]]) -> float:
    """The largest radius of all, m/s; 0 where nothing moves."""
    radii = [one.radii[np.isfinite(one.radii)] for parts in ellipsoids for one in parts.values()]
    return max((float(known.max(initial=0.0)) for known in radii), default=0.0)


def scale_text(scale: float) -> str:
    """The scale in words."""
    return f"1 m/s is drawn as {scale:.3g} m"


def _nice(value: float) -> float:
    """The largest of 1, 2, 3, 4, 5 times a power of ten that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(
        power * max(step for step in (1.0, 2.0, 3.0, 4.0, 5.0) if step * power <= value * (1.0 + 1e-9))
    )
