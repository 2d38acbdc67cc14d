"""Manipulability ellipsoids in the scene: translucent, at the end-effector, moving with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.analysis.singular.drawn_ellipsoids import (
    ARM,
    NAMES,
    drawn_ellipsoids,
    drawn_frame,
    drawn_scale,
    largest_radius,
    scale_text,
)
from nmm.analysis.singular.ellipsoids import Ellipsoids
from nmm.analysis.singular.parts import WHOLE
from nmm.arrays import Array, interpolated
from nmm.playback.drawing import Command, Drawing, Rgb, animation, page_times
from nmm.playback.extent import extent_of
from nmm.playback.keyframes import Keyframes
from nmm.playback.placements import position_and_quaternion
from nmm.robots.motion import Motion
from nmm.runs.ellipsoid_options import EllipsoidOptions

#: Colours of the arm's, and of the legend's entry for robots of several colours.
ARM_COLOR: Rgb = (0.93, 0.62, 0.02)
SEVERAL: Rgb = (0.36, 0.44, 0.54)
OPACITY = {WHOLE: 0.24, ARM: 0.55}
#: The least radius as drawn, beside the largest: a flat ellipsoid is seen, but its number stays 0.
THINNEST = 0.012
#: Between two frames the page may be off by this much of the largest radius, in shape and in place; frames
#: are put in between, in so many rounds at most.
CLOSE = 0.01
ROUNDS = 5


class SceneEllipsoids:
    """The ellipsoids of the motions of one scene, on one scale.

    Parameters
    ----------
    motions, frames : the motions and their keyframes

    Attributes
    ----------
    scale : m of drawing for each m/s
    thinnest : least radius as drawn, m
    t, parts : of each motion, (K,) s and ellipsoids at these instants; denser than the keyframes where the
        page would be off between them
    """

    def __init__(
        self,
        motions: Sequence[Motion],
        frames: Sequence[Keyframes],
        options: EllipsoidOptions,
    ) -> None:
        self.names = [drawn_frame(options, motion.robot, motion.frame) for motion in motions]
        robots = [motion.robot for motion in motions]
        first = [
            drawn_ellipsoids(options, *each)
            for each in zip(robots, self.names, [frame.q for frame in frames], strict=True)
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
                for part, there in exact.items():
                    bad |= between_error(parts[part], there, self.scale) > CLOSE * room
                if not bad.any():
                    break
                at = np.flatnonzero(bad) + 1
                t, q = np.insert(t, at, 0.5 * (t[1:] + t[:-1])[bad]), np.insert(q, at, middle[bad], axis=0)
                parts = drawn_ellipsoids(options, robot, name, q)
            self.t.append(t)
            self.parts.append(parts)

    def radii(self, motion: int, part: str) -> Array:
        """Radii (K, 3) as drawn, m."""
        return np.maximum(self.scale * np.nan_to_num(self.parts[motion][part].radii), self.thinnest)

    def around(self, boxes: Array, times: Array) -> Array:
        """Boxes (motions, T, 2, 3) at the times (T,), enlarged to hold the ellipsoids too."""
        enlarged = boxes.copy()
        for i, (t, parts) in enumerate(zip(self.t, self.parts, strict=True)):
            for part, found in parts.items():
                half = np.linalg.norm(found.axes * self.radii(i, part)[:, None], axis=2)
                low, high = (
                    interpolated(times, t, corner) for corner in (found.center - half, found.center + half)
                )
                enlarged[i, :, 0] = np.minimum(enlarged[i, :, 0], low)
                enlarged[i, :, 1] = np.maximum(enlarged[i, :, 1], high)
        return enlarged

    def draw(self, drawing: Drawing, motion: int, path: str, color: Rgb, start: float) -> list[Command]:
        """Draw those of one motion below `path`; returns their animations. Times count from `start`."""
        parts, group = self.parts[motion], f"{path}/ellipsoids"
        times, kept = page_times(self.t[motion] - start)
        center = parts[WHOLE].center[kept]
        place = np.eye(4)
        place[:3, 3] = center[0]
        drawing.transform(group, place)
        animations = animation(group, times, {"position": center})
        for after, part in enumerate(reversed(parts)):
            node, radii = f"{group}/{part}", self.radii(motion, part)[kept]
            turned = np.tile(np.eye(4), (len(times), 1, 1))
            turned[:, :3, :3] = parts[part].axes[kept]
            drawing.add(
                "ellipsoid",
                path=node,
                color=list(ARM_COLOR if part == ARM else color),
                opacity=OPACITY[part],
                after=after,
            )
            drawing.transform(node, turned[0] @ np.diag([*radii[0], 1.0]))
            _, quaternions = position_and_quaternion(turned)
            animations += animation(node, times, {"quaternion": quaternions, "scale": radii})
        return animations

    def tell(self, drawing: Drawing, paths: Sequence[str], color: Rgb) -> None:
        """The legend: what is what, and the scale. `color` is that of the whole robot's."""
        named = ", ".join(dict.fromkeys(self.names))
        entries = []
        for part in dict.fromkeys(part for parts in self.parts for part in parts):
            nodes = [
                f"{path}/ellipsoids/{part}"
                for path, parts in zip(paths, self.parts, strict=True)
                if part in parts
            ]
            shown = ARM_COLOR if part == ARM else color if len(paths) == 1 else SEVERAL
            entries.append(
                {"text": f"velocities of {named}: {NAMES[part]}", "color": list(shown), "paths": nodes}
            )
        drawing.add(
            "ellipsoids",
            groups=[f"{path}/ellipsoids" for path in paths],
            entries=entries,
            note=scale_text(self.scale),
        )


def between_error(at: Ellipsoids, exact: Ellipsoids, scale: float) -> Array:
    """How far the page is off halfway between frames, (K - 1,) m as drawn.

    The page takes centre and radii linearly and turns the axes evenly.

    Parameters
    ----------
    at : K ellipsoids at the frames
    exact : the K - 1 halfway
    """
    # Halfway between two rotations is the one nearest to their sum.
    U, _, Vt = np.linalg.svd(at.axes[1:] + at.axes[:-1])
    axes, radii = U @ Vt, 0.5 * (at.radii[1:] + at.radii[:-1])
    drawn = (axes * radii[:, None]) @ np.swapaxes(axes, 1, 2)
    true = (exact.axes * exact.radii[:, None]) @ np.swapaxes(exact.axes, 1, 2)
    shape = scale * np.nan_to_num(np.linalg.norm(drawn - true, axis=(1, 2)))
    place = np.linalg.norm(0.5 * (at.center[1:] + at.center[:-1]) - exact.center, axis=1)
    return np.asarray(shape + place)
