"""Manipulability ellipsoids in the scene: translucent, at the end-effector, moving with it."""

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.analysis.singular.ellipsoids import (
    ARM,
    NAMES,
    Ellipsoids,
    drawn_ellipsoids,
    drawn_frame,
    drawn_scale,
    largest_radius,
    scale_text,
)
from nmm.analysis.singular.parts import WHOLE
from nmm.base.arrays import Array, interpolated
from nmm.base.ellipsoid_options import EllipsoidOptions
from nmm.model.robots.motion import Motion
from nmm.views.playback.drawing import Command, Drawing, Rgb, animation, page_times
from nmm.views.playback.extent import extent_of
from nmm.views.playback.keyframes import Keyframes
from nmm.views.playback.placements import position_and_quaternion

#: Colours of the arms' ellipsoids, and of the legend's entry for robots of several colours.
ARM_COLOR: Rgb = (0.93, 0.62, 0.02)
SEVERAL: Rgb = (0.36, 0.44, 0.54)
OPACITY = {WHOLE: 0.24, ARM: 0.55}
#: The least radius as drawn, beside the largest: a flat ellipsoid is seen, but its number stays 0.
THINNEST = 0.012
#: The page may be off by this share of the largest radius between two frames, in shape and place; otherwise
#: frames are inserted, in at most this many rounds.
CLOSE = 0.01
ROUNDS = 5


class SceneEllipsoids:
    """The ellipsoids of a scene's motions, on one scale, m drawn for each m/s: for each motion, `parts` at
    `t` (K,) s, denser than its keyframes where the page would be off between those."""

    def __init__(
        self, motions: Sequence[Motion], frames: Sequence[Keyframes], options: EllipsoidOptions
    ) -> None:
        self.names = [drawn_frame(options, motion.robot, motion.frame) for motion in motions]
        robots = [motion.robot for motion in motions]
        first = [
            drawn_ellipsoids(options, robot, name, frame.q)
            for robot, name, frame in zip(robots, self.names, frames, strict=True)
        ]
        extent = max(extent_of(motion.robot, motion.q[0]) for motion in motions)
        self.scale = drawn_scale(options, extent, first)
        largest = largest_radius(first)
        self.thinnest = self.scale * largest * THINNEST if largest > 0.0 else THINNEST * extent
        room = max(self.scale * largest, self.thinnest)
        self.t: list[Array] = []
        self.parts: list[dict[str, Ellipsoids]] = []
        for robot, name, frame, parts in zip(robots, self.names, frames, first, strict=True):
            t, q = frame.t, frame.q
            for _ in range(ROUNDS):
                middle = 0.5 * (q[1:] + q[:-1])
                exact = drawn_ellipsoids(options, robot, name, middle) if len(middle) else {}
                bad = np.zeros(len(middle), dtype=bool)
                for part, ellipsoids in exact.items():
                    bad |= between_error(parts[part], ellipsoids, self.scale) > CLOSE * room
                if not bad.any():
                    break
                at = np.flatnonzero(bad) + 1
                t, q = np.insert(t, at, 0.5 * (t[1:] + t[:-1])[bad]), np.insert(q, at, middle[bad], axis=0)
                parts = drawn_ellipsoids(options, robot, name, q)
            self.t.append(t)
            self.parts.append(parts)

    def radii(self, motion: int, part: str) -> Array:
        """As drawn, (K, 3) m."""
        return np.maximum(self.scale * np.nan_to_num(self.parts[motion][part].radii), self.thinnest)

    def around(self, boxes: Array, times: Array) -> Array:
        """Boxes (motions, T, 2, 3) at the times (T,), enlarged to hold the ellipsoids."""
        enlarged = boxes.copy()
        for i, (t, parts) in enumerate(zip(self.t, self.parts, strict=True)):
            box = enlarged[i].swapaxes(0, 1)
            for part, ellipsoids in parts.items():
                half = np.linalg.norm(ellipsoids.axes * self.radii(i, part)[:, None], axis=2)
                np.minimum(box[0], interpolated(times, t, ellipsoids.center - half), out=box[0])
                np.maximum(box[1], interpolated(times, t, ellipsoids.center + half), out=box[1])
        return enlarged

    def draw(self, drawing: Drawing, motion: int, path: str, color: Rgb, start: float) -> list[Command]:
        """Draw one motion's below `path`; returns their animations. Times count from `start`."""
        parts, group = self.parts[motion], f"{path}/ellipsoids"
        times, distinct = page_times(self.t[motion] - start)
        center = parts[WHOLE].center[distinct]
        place = np.eye(4)
        place[:3, 3] = center[0]
        drawing.transform(group, place)
        animations = animation(group, times, {"position": center})
        for after, part in enumerate(reversed(parts)):
            node, radii = f"{group}/{part}", self.radii(motion, part)[distinct]
            turned = np.tile(np.eye(4), (len(times), 1, 1))
            turned[:, :3, :3] = parts[part].axes[distinct]
            shade = list(ARM_COLOR if part == ARM else color)
            drawing.add("ellipsoid", path=node, color=shade, opacity=OPACITY[part], after=after)
            drawing.transform(node, turned[0] @ np.diag([*radii[0], 1.0]))
            _, quaternions = position_and_quaternion(turned)
            animations += animation(node, times, {"quaternion": quaternions, "scale": radii})
        return animations

    def tell(self, drawing: Drawing, paths: Sequence[str], color: Rgb) -> None:
        """Append the legend and the scale; `color` is that of the whole robot's ellipsoid."""
        nodes: dict[str, list[str]] = {}
        for path, parts in zip(paths, self.parts, strict=True):
            for part in parts:
                nodes.setdefault(part, []).append(f"{path}/ellipsoids/{part}")
        groups = [f"{path}/ellipsoids" for path in paths]
        shade = color if len(paths) == 1 else SEVERAL
        draw_legend(drawing, groups, ", ".join(dict.fromkeys(self.names)), nodes, shade, self.scale)


def draw_legend(
    drawing: Drawing,
    groups: Sequence[str],
    frames: str,
    nodes: Mapping[str, Sequence[str]],
    color: Rgb,
    scale: float,
) -> None:
    shades = {part: list(ARM_COLOR if part == ARM else color) for part in nodes}
    entries = [
        {"text": f"velocities of {frames}: {NAMES[part]}", "color": shades[part], "paths": paths}
        for part, paths in nodes.items()
    ]
    drawing.add("ellipsoids", groups=list(groups), entries=entries, note=scale_text(scale))


def between_error(at: Ellipsoids, exact: Ellipsoids, scale: float) -> Array:
    """How far the page is off halfway between K frames, (K - 1,) m as drawn: it interpolates centre and radii
    linearly and turns the axes evenly."""
    # Halfway between two rotations is the one nearest to their sum.
    U, _, Vt = np.linalg.svd(at.axes[1:] + at.axes[:-1])
    axes, radii = U @ Vt, 0.5 * (at.radii[1:] + at.radii[:-1])
    drawn = (axes * radii[:, None]) @ np.swapaxes(axes, 1, 2)
    true = (exact.axes * exact.radii[:, None]) @ np.swapaxes(exact.axes, 1, 2)
    shape = scale * np.nan_to_num(np.linalg.norm(drawn - true, axis=(1, 2)))
    place = np.linalg.norm(0.5 * (at.center[1:] + at.center[:-1]) - exact.center, axis=1)
    return np.asarray(shape + place)
