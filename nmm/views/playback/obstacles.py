"""Obstacles in the page, and a line between the two nearest points."""

from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.motion import Motion, Nearest
from nmm.model.robots.surroundings import Body
from nmm.views.playback.drawing import Command, Drawing, Rgb, animation, encode, packed, page_times
from nmm.views.playback.extent import shape_corners
from nmm.views.playback.keyframes import samples_kept
from nmm.views.playback.placements import position_and_quaternion
from nmm.views.playback.shapes import PageShape, shapes, triangles

OBSTACLE: Rgb = (0.62, 0.55, 0.38)
SCENERY: Rgb = (0.66, 0.70, 0.74)
NEAR: Rgb = (0.12, 0.14, 0.18)
TOO_NEAR: Rgb = (0.83, 0.10, 0.22)
#: How much of what is behind a half-space's face it covers.
SHEET = 0.28
#: The nearest points are shown when they are closer than the distance to keep plus this, m.
REACH = 0.3
#: A distance counts as kept where it is short by no more than this, m.
ROUNDING = 1e-6


class SceneObstacles:
    """Obstacles of motions, each drawn once where motions share it; robot boxes (motions, K, 2, 3) m."""

    def __init__(self, motions: Sequence[Motion], boxes: Array, fps: float) -> None:
        self._fps = fps
        self._room = np.array([boxes[..., 0, :].min(axis=(0, 1)), boxes[..., 1, :].max(axis=(0, 1))])
        self.drawn: list[tuple[Body, Motion]] = []
        self._scenery: list[bool] = []
        # The longest run first: those that ended early share its obstacles.
        for motion in sorted(motions, key=lambda motion: -len(motion.t)):
            beside = motion.surroundings.scenery
            for body, stands in [
                *((body, False) for body in motion.bodies),
                *((body, True) for body in beside),
            ]:
                if not any(_same(body, motion, *other) for other in self.drawn):
                    self.drawn.append((body, motion))
                    self._scenery.append(stands)

    def points(self) -> Array:
        """Corners (K, 3), m, for the camera: of what is near the robots' room, without half-spaces."""
        middle, half = self._room.mean(axis=0), 0.5 * np.ptp(self._room, axis=0)
        # As much again on each side as the room is wide, so that a wall's end is seen where it is near.
        around = half + max(0.5 * float(np.linalg.norm(half)), 0.5)
        corners = [np.zeros((0, 3))]
        for body, motion in self.drawn:
            if (box := shape_corners(body.geometry)) is None:
                continue
            every = max(1, len(body.places) // 100)
            places = body.places[samples_kept(motion.t, self._fps)] if len(body.places) > 1 else body.places
            for place in places[::every]:
                at = box @ place[:3, :3].T + place[:3, 3]
                if np.all(at.min(axis=0) < middle + around) and np.all(at.max(axis=0) > middle - around):
                    corners.append(np.clip(at, middle - around, middle + around))
        return np.vstack(corners)

    def draw(self, drawing: Drawing, size: float, start: float) -> list[Command]:
        """Draw them; returns their animations. `size` is half the diagonal of what is shown, m."""
        animations: list[Command] = []
        for i, (body, motion) in enumerate(self.drawn):
            path, color = f"/nmm/obstacle {i}", SCENERY if self._scenery[i] else OBSTACLE
            drawing.transform(path, body.places[0])
            if isinstance(body.geometry, coal.Halfspace):
                sheet, top = self._sheet(body, size)
                drawing.object(f"{path}/sheet", sheet, color, opacity=SHEET, sheet=True)
            else:
                for k, shape in enumerate(_drawn(body)):
                    drawing.object(f"{path}/{k}", shape.geometry, color)
                    drawing.transform(f"{path}/{k}", shape.matrix)
                top = _top(body)
            drawing.add("obstacle", path=path, name=body.name, color=list(color), top=top.tolist())
            if len(body.places) > 1:
                samples = samples_kept(motion.t, self._fps)
                times, distinct = page_times(motion.t[samples] - start)
                positions, quaternions = position_and_quaternion(body.places[samples][distinct])
                animations += animation(path, times, {"position": positions, "quaternion": quaternions})
        return animations

    def tell(self, drawing: Drawing) -> None:
        for text, stands, color in (("obstacle", False, OBSTACLE), ("scenery", True, SCENERY)):
            paths = [f"/nmm/obstacle {i}" for i, fixed in enumerate(self._scenery) if fixed is stands]
            if paths:
                text += "s" * (len(paths) > 1 and not stands)
                drawing.add("obstacles", text=text, paths=paths, color=list(color))

    def _sheet(self, body: Body, size: float) -> tuple[dict[str, Any], Array]:
        """A square of a half-space's face, in its axes, about the robots' room, and its label's place."""
        place = body.places[0]
        normal, offset = np.array(body.geometry.n), float(body.geometry.d)
        middle = place[:3, :3].T @ (self._room.mean(axis=0) - place[:3, 3])
        middle -= (normal @ middle - offset) * normal
        across = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
        across /= np.linalg.norm(across)
        along = np.cross(normal, across)
        ends = [middle + size * (a * across + b * along) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return triangles(np.array(ends), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)), ends[2]


def draw_nearest(
    drawing: Drawing, motion: Motion, path: str, color: Rgb | None, start: float, fps: float
) -> None:
    """The line between a motion's nearest points, in the motion's colour where there are several."""
    nearest: Nearest | None = motion.nearest
    if nearest is None or not np.isfinite(nearest.distance).any():
        return
    samples = samples_kept(motion.t, fps)
    shown = (nearest.pairs[samples] >= 0) & (nearest.distance[samples] < nearest.asked + REACH)
    ends = np.nan_to_num(nearest.points[samples])  # none inside of a map
    if not shown.any():
        return
    drawing.add(
        "nearest",
        path=f"{path}/nearest",
        of=motion.label if color is not None else "",
        color=list(NEAR if color is None else color),
        alarm=list(TOO_NEAR),
        times=packed(motion.t[samples] - start, np.float64),
        points=packed(np.where(shown[:, np.newaxis], ends, 0.0), np.float64),
        distance=packed(np.where(shown, nearest.distance[samples], 1e9), np.float64),
        pairs=np.where(shown, nearest.pairs[samples], -1).tolist(),
        names=list(nearest.names),
        told=_told(motion, nearest),
        asked=nearest.asked - ROUNDING,
    )


def _told(motion: Motion, nearest: Nearest) -> list[bool]:
    """Which pairs' distances are written into the scene: with obstacles those to them, not a robot's own."""
    obstacles = {body.name for body in motion.bodies}
    return [not obstacles or any(name in obstacles for name in pair.split(" and ")) for pair in nearest.names]


def _same(body: Body, motion: Motion, other: Body, others: Motion) -> bool:
    moves, moved = len(body.places) > 1, len(other.places) > 1
    if body.name != other.name or moves != moved or _identity(body) != _identity(other):
        return False
    common = min(len(motion.t), len(others.t))
    same_times = not moves or np.allclose(motion.t[:common], others.t[:common])
    return bool(same_times and np.allclose(body.places[:common], other.places[:common]))


def _drawn(body: Body) -> list[PageShape]:
    return shapes(pin.GeometryObject(body.name, 0, pin.SE3(), body.geometry))


def _identity(body: Body) -> str:
    if isinstance(body.geometry, coal.Halfspace):
        return f"{body.geometry.n} {body.geometry.d}"
    return " ".join(encode(shape.geometry) for shape in _drawn(body))


def _top(body: Body) -> Array:
    """The place of its label: above the middle of a shape, in its axes, (3,) m."""
    box, place = shape_corners(body.geometry), body.places[0]
    if box is None:
        return np.zeros(3)
    at = box @ place[:3, :3].T
    above = at.mean(axis=0)
    above[2] = at[:, 2].max()
    return np.asarray(place[:3, :3].T @ above)
