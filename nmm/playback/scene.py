"""The scene: robots that move, their paths and ghosts, the target, the ground, and where to look from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.looks import looks, looks_of_labels
from nmm.playback.channels import channels
from nmm.playback.curves import draw_curves
from nmm.playback.drawing import Command, Drawing, DrawnRobot, Rgb
from nmm.playback.encoding import packed
from nmm.playback.extent import corners, robot_boxes
from nmm.playback.facts import draw_facts
from nmm.playback.framing import TAG, boxes_around, held, middle, reached, tag_places, view_points, wall
from nmm.playback.keyframes import MOST_FRAMES, Keyframes, ghost_samples, keyframes, samples_kept
from nmm.playback.obstacles import SceneObstacles, draw_nearest
from nmm.playback.placements import base_position
from nmm.playback.rolling import wheel_angles
from nmm.playback.shapes import Y_TO_Z, cylinder, sphere
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot
from nmm.runs.ellipsoid_options import Wanted, options_of
from nmm.runs.trajectory import Trajectory

if TYPE_CHECKING:
    from nmm.playback.ellipsoids import SceneEllipsoids

DESIRED: Rgb = (0.16, 0.18, 0.22)
TARGET: Rgb = (0.83, 0.10, 0.22)

#: Instants at which the room that the robots take is measured.
INSTANTS = 80


#: What a page shows: a run with its curves, or a motion, whose curves are its inputs and coordinates.
Shown = Motion | Trajectory


def playback_scene(
    runs: Sequence[Shown],
    *,
    title: str,
    ghosts: int | None = None,
    fps: float = 60.0,
    autoplay: bool = False,
    ellipsoids: Wanted = False,
) -> list[Command]:
    """Commands for runs that are played: robots, paths, ghosts, animation, and their curves.

    Parameters
    ----------
    runs : at least one
    title : heading of the page
    ghosts : transparent copies of each robot along its way; 6 when not given, 3 of each of several
    fps : frames for each second of motion
    autoplay : whether the page begins to play by itself
    ellipsoids : whether manipulability ellipsoids are drawn, or how (`EllipsoidOptions`)

    Raises
    ------
    InputError : no motion, or one without samples; ellipsoids of a frame or with sizes that a robot does
        not have
    """
    if not runs:
        raise InputError("motions: expected at least one motion, got none")
    motions = [run.motion() if isinstance(run, Trajectory) else run for run in runs]
    worn = looks_of_labels([motion.label for motion in motions])
    wheels = [wheel_angles(motion) for motion in motions]
    frames = [keyframes(motion, fps, angles) for motion, angles in zip(motions, wheels, strict=True)]
    start = min(float(motion.t[0]) for motion in motions)
    end = max(float(motion.t[-1]) for motion in motions)
    times = np.linspace(start, end, INSTANTS)
    boxes = boxes_around(motions, frames, times)
    shown = _ellipsoids(motions, frames, ellipsoids)
    if shown is not None:
        boxes = shown.around(boxes, times)
    obstacles = SceneObstacles(motions, boxes, fps)
    view = np.vstack([view_points(boxes, motions), obstacles.points()])
    size = max(0.5 * float(np.linalg.norm(np.ptp(view, axis=0))), 1e-3)
    several = len(motions) > 1
    if ghosts is None:
        ghosts = 3 if several else 6
    drawing = Drawing()
    drawing.add(
        "stage",
        title=title,
        live=False,
        autoplay=autoplay,
        plots=any(isinstance(run, Trajectory) for run in runs),
        start=start,
        duration=end - start,
        view=packed(view, np.float64),
        tags=packed(tag_places(motions, boxes, times) if several else np.zeros((0, 3)), np.float64),
        follow=held(boxes, middle(motions, frames, times)),
        wall=wall(motions),
        size=size,
    )
    animations = obstacles.draw(drawing, size, start)
    for i, (motion, frame, look) in enumerate(zip(motions, frames, worn, strict=True)):
        color = look.rgb
        path = f"/nmm/motion {i}"
        robot = DrawnRobot(drawing, motion.robot, f"{path}/robot", tint=color if several else None, rank=i)
        robot.place(frame.q[0], frame.wheels[0])
        animations += robot.animations(frame, start)
        height = TAG * float(boxes[i, 0, 1, 2])
        samples = ghost_samples(motion, ghosts)
        if samples:
            whose = f"{look.name} " if several else ""
            texts = [f"{whose}{motion.t[k]:.3g} s" for k in samples]
            robot.ghosts(f"{path}/ghosts", motion.q[samples], wheels[i][samples], texts)
        drawing.add(
            "motion",
            path=path,
            root=robot.root,
            # The page calls the line that it draws the end-effector's, unless it is told otherwise.
            label=look.name or ("" if motion.driven is not None else motion.robot.name),
            color=list(color),
            tag=look.name if several else "",
            height=height,
        )
        drawn = samples_kept(motion.t, fps)
        for name, points, thick in (
            ("path", motion.driven, 1.0),
            ("platform", _on_the_floor(motion, size), 0.6),
        ):
            if points is not None:
                drawing.add(
                    "path",
                    path=f"{path}/{name}",
                    color=list(color),
                    points=packed(points[drawn], np.float32),
                    times=packed(motion.t[drawn] - start, np.float64),
                    thick=thick,
                )
        draw_nearest(drawing, motion, path, color if several else None, start, fps)
        if shown is not None:
            animations += shown.draw(drawing, i, path, color, start)
    obstacles.tell(drawing)
    _desired(drawing, motions)
    _targets(drawing, motions, size)
    if shown is not None:
        shown.tell(drawing, [f"/nmm/motion {i}" for i in range(len(motions))], worn[0].rgb)
    told = [channels(run) for run in runs]
    draw_curves(drawing, told, worn, start)
    draw_facts(drawing, runs, told, worn, start)
    drawing.add("set_animation", animations=animations, options={"play": False, "repetitions": 1})
    drawing.add("ready")
    return drawing.commands


def live_scene(
    robot: Robot,
    q: Array,
    wheels: Array,
    *,
    title: str,
    room: float = 2.0,
    seen: Array | None = None,
) -> tuple[list[Command], DrawnRobot]:
    """Commands for a robot that somebody moves from outside, and the robot, to place it.

    Parameters
    ----------
    q, wheels : (n,) where it stands at first, and (D,) its wheels' angles, rad
    room : ground to show around it, m
    seen : (K, 3) points that are to be seen besides, m
    """
    box = robot_boxes(robot, q[np.newaxis], wheels[np.newaxis])[0]
    around = box + np.array([[-room, -room, 0.0], [room, room, 0.0]])
    if seen is not None and len(seen):
        low, high = np.minimum(around[0], seen.min(axis=0)), np.maximum(around[1], seen.max(axis=0))
        around = np.array([low, high])
    drawing = Drawing()
    drawing.add(
        "stage",
        title=title,
        live=True,
        autoplay=False,
        start=0.0,
        duration=0.0,
        view=packed(corners(around), np.float64),
        follow=held(reached(robot, q, wheels)[np.newaxis], base_position(robot, q)[np.newaxis]),
        size=0.5 * float(np.linalg.norm(np.ptp(around, axis=0))),
    )
    drawn = DrawnRobot(drawing, robot, "/nmm/motion 0/robot")
    drawn.place(q, wheels)
    drawing.add(
        "motion",
        path="/nmm/motion 0",
        root=drawn.root,
        label=robot.name,
        color=list(looks([""])[0].rgb),
        tag="",
        height=TAG * float(box[1, 2]),
    )
    drawing.add("ready")
    return drawing.commands, drawn


def points_beside(motion: Motion, boxes: Array) -> Array:
    """Points (K, 3) m that show what stands beside a robot: its desired path, target and bodies near it."""
    given = [np.atleast_2d(one) for one in (motion.desired, motion.target) if one is not None]
    return np.vstack([*given, SceneObstacles([motion], boxes[np.newaxis], 1.0).points()])


def draw_beside(drawing: Drawing, motion: Motion, boxes: Array) -> None:
    """Append the commands that draw it, as it is at the motion's first sample; boxes (1, 2, 3) as above."""
    points = np.vstack([points_beside(motion, boxes), boxes.reshape(-1, 3)])
    size = 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    obstacles = SceneObstacles([motion], boxes[np.newaxis], 1.0)
    obstacles.draw(drawing, size, 0.0)
    obstacles.tell(drawing)
    _desired(drawing, [motion])
    _targets(drawing, [motion], size)


def _ellipsoids(
    motions: Sequence[Motion], frames: Sequence[Keyframes], wanted: Wanted
) -> SceneEllipsoids | None:
    """The ellipsoids asked for."""
    if wanted is False:
        return None
    # Not before: with it comes the whole of the analysis.
    from nmm.playback.ellipsoids import SceneEllipsoids

    options = options_of(wanted)
    return None if options is None else SceneEllipsoids(motions, frames, options)


def _desired(drawing: Drawing, motions: Sequence[Motion]) -> None:
    """Each desired path once: motions that are compared usually share it."""
    seen: list[Array] = []
    for motion in motions:
        path = motion.desired
        if path is None or any(path.shape == other.shape and np.allclose(path, other) for other in seen):
            continue
        kept = np.unique(np.linspace(0, len(path) - 1, MOST_FRAMES).astype(int))
        drawing.add(
            "path",
            path=f"/nmm/desired {len(seen)}",
            color=list(DESIRED),
            points=packed(path[kept], np.float32),
            times=None,
            thick=1.0,
        )
        seen.append(path)


def _targets(drawing: Drawing, motions: Sequence[Motion], size: float) -> None:
    """A ball on a pole at each target."""
    given = [np.atleast_2d(motion.target) for motion in motions if motion.target is not None]
    targets = {tuple(target) for several in given for target in several.tolist()}
    radius = min(max(0.015 * size, 0.02), 0.2)
    for i, (x, y, z) in enumerate(sorted(targets)):
        path = f"/nmm/target {i}"
        place = np.eye(4)
        place[:3, 3] = x, y, z
        drawing.transform(path, place)
        drawing.object(f"{path}/ball", sphere(radius), TARGET)
        if z > radius:
            pole, foot = Y_TO_Z.copy(), Y_TO_Z.copy()
            pole[2, 3], foot[2, 3] = -0.5 * z, -z + 0.1 * radius
            drawing.object(f"{path}/pole", cylinder(0.22 * radius, z), (0.45, 0.47, 0.52))
            drawing.object(f"{path}/foot", cylinder(1.6 * radius, 0.2 * radius), (0.45, 0.47, 0.52))
            drawing.transform(f"{path}/pole", pole)
            drawing.transform(f"{path}/foot", foot)
    if targets:
        drawing.add("target", color=list(TARGET))


def _on_the_floor(motion: Motion, size: float) -> Array | None:
    """Where the platform has been (N, 3), just above the floor; None for one that stays."""
    at = base_position(motion.robot, motion.q)
    if float(np.ptp(at, axis=0).max(initial=0.0)) < 1e-6:
        return None
    return np.column_stack([at, np.full(len(at), 2e-3 * size)])
