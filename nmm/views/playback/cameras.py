"""Cameras in the page: what they see in the scene, and their pictures."""

from collections.abc import Iterator, Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.model.robots.motion import Camera, Motion
from nmm.model.robots.robot import Robot
from nmm.views.playback.drawing import Command, Drawing, Rgb, animation, packed, page_times
from nmm.views.playback.keyframes import samples_kept
from nmm.views.playback.shapes import DrawnRobot, sphere

SEEN: Rgb = (0.91, 0.55, 0.04)
FRUSTUM: Rgb = (0.20, 0.26, 0.34)
#: How far ahead of the lens the frustum reaches, as a share of the size of what is shown.
DEPTH = 0.13


def seen_points(motions: Sequence[Motion]) -> Array:
    """Points (K, 3), m, that cameras see, for the view to hold."""
    points = [np.zeros((0, 3))]
    for camera in (camera for motion in motions for camera in motion.cameras):
        every = camera.points[:: max(1, len(camera.points) // 100)]
        points.append(every.reshape(-1, 3))
    return np.vstack(points)


def draw_cameras(
    drawing: Drawing, motion: Motion, robot: DrawnRobot, path: str, start: float, fps: float, size: float
) -> list[Command]:
    """Draw a motion's cameras and what they see; returns the animations of points that move. `path` is the
    motion's node, `size` half the diagonal of what is shown, m."""
    animations: list[Command] = []
    samples = samples_kept(motion.t, fps)
    for i, camera in enumerate(motion.cameras):
        points = camera.points[samples]
        nodes = draw_camera(drawing, camera, robot, path, i, size)
        for node, places in zip(nodes, points.swapaxes(0, 1), strict=True):
            times, distinct = page_times(motion.t[samples] - start)
            animations += animation(node, times, {"position": places[distinct]})
        drawing.commands[-1] |= {
            "times": packed(motion.t[samples] - start, np.float64),
            "pictures": packed(camera.picture(motion.robot, motion.q)[samples], np.float32),
            "goals": packed(camera.goals[samples], np.float32),
        }
    return animations


def draw_camera(
    drawing: Drawing, camera: Camera, robot: DrawnRobot, path: str, i: int, size: float
) -> list[str]:
    """Draw the i-th camera of a robot, and its points at the first sample; returns the points' nodes. The
    last command is the camera's, without samples of its picture."""
    lens = robot.frame_node(drawing, camera.frame, f"camera {i}")
    nodes = [f"{path}/seen {i} {k}" for k in range(camera.points.shape[1])]
    radius = min(max(0.014 * size, 0.02), 0.2)
    for node, place in zip(nodes, placed(camera.points[0]), strict=True):
        drawing.transform(node, place)
        drawing.object(f"{node}/ball", sphere(radius), SEEN)
    drawing.add(
        "sight",
        of=path,
        frame=camera.frame,
        path=lens,
        points=nodes,
        color=list(SEEN),
        ink=list(FRUSTUM),
        depth=DEPTH * size,
        border=list(camera.border),
        bounded=camera.bounded,
        intrinsics=list(camera.intrinsics),
        lines=[list(ends) for ends in camera.lines],
    )
    return nodes


def tell_cameras(drawing: Drawing, cameras: Sequence[Camera]) -> None:
    """Append what tells pages that cameras are drawn, once all of them are."""
    if cameras:
        drawing.add("sights", color=list(SEEN))


def live_numbers(cameras: Sequence[Camera], robot: Robot, q: Array) -> Array:
    """What live pages get of cameras from q (N, n), for each of them where its k points are, where it sees
    them and where they are to be, (N, 3 k + 2 k + 2 k)."""
    numbers = [np.zeros((len(q), 0))]
    for camera in cameras:
        numbers += [x.reshape(len(q), -1) for x in (camera.points, camera.picture(robot, q), camera.goals)]
    return np.hstack(numbers)


def placed(points: Array) -> Iterator[Array]:
    """The placement of a node at each of the points (k, 3), m."""
    for point in points:
        place = np.eye(4)
        place[:3, 3] = point
        yield place
