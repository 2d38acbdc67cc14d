"""The scene: moving robots, their paths and ghosts, the target, the ground, and the view."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.base.arrays import Array, interpolated
from nmm.base.ellipsoid_options import Wanted, options_of
from nmm.base.errors import expect
from nmm.base.resolver_style import looks, looks_of_labels
from nmm.model.collisions.obstacle import Obstacle, obstacle_places
from nmm.model.robots.motion import Motion
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import Body
from nmm.motion.trajectory import Trajectory
from nmm.views.playback import extent
from nmm.views.playback.cameras import draw_cameras, seen_points, tell_cameras
from nmm.views.playback.channels import channels, draw_curves, draw_facts
from nmm.views.playback.drawing import Command, Drawing, Rgb, packed
from nmm.views.playback.frames import axes_length, frame_nodes
from nmm.views.playback.keyframes import (
    MOST_FRAMES,
    Keyframes,
    ghost_samples,
    ghost_times,
    keyframes,
    nearest,
    samples_kept,
)
from nmm.views.playback.meshes import OFF
from nmm.views.playback.obstacles import SceneObstacles, draw_nearest
from nmm.views.playback.placements import base_position
from nmm.views.playback.rolling import wheel_angles
from nmm.views.playback.shapes import CARRIED, Y_TO_Z, DrawnRobot, cylinder, sphere

if TYPE_CHECKING:
    from nmm.views.playback.ellipsoids import SceneEllipsoids

DESIRED: Rgb = (0.16, 0.18, 0.22)
TARGET: Rgb = (0.83, 0.10, 0.22)

#: Colour and opacity of a robot where it is believed to be.
BELIEVED: Rgb = (0.42, 0.45, 0.50)
THROUGH = 0.4
INSTANTS = 80
#: Meshes of robots that share a picture may be off by this share of their size: there are several.
OFF_OF_SEVERAL = 6e-3
#: Radius of a path, at most, as a share of the robot's extent: thinner than an arm.
THIN = 0.005


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
    """Commands for runs that are played, options as of `write_html`; `InputError` for no motion, one without
    samples, or ellipsoids of a frame or with sizes that a robot does not have."""
    expect(runs, "motions", "at least one motion", [])
    motions = [run.motion() if isinstance(run, Trajectory) else run for run in runs]
    worn = looks_of_labels([motion.label for motion in motions])
    wheels = [wheel_angles(motion) for motion in motions]
    frames = [keyframes(motion, fps, angles) for motion, angles in zip(motions, wheels, strict=True)]
    start = min(float(motion.t[0]) for motion in motions)
    end = max(float(motion.t[-1]) for motion in motions)
    times = np.linspace(start, end, INSTANTS)
    at = [[interpolated(times, frame.t, values) for values in (frame.q, frame.wheels)] for frame in frames]
    boxes = np.array(
        [
            extent.robot_boxes(motion.robot, q, turned, carried=motion.surroundings.carried)
            for motion, (q, turned) in zip(motions, at, strict=True)
        ]
    )
    shown = _ellipsoids(motions, frames, ellipsoids)
    if shown is not None:
        boxes = shown.around(boxes, times)
    obstacles = SceneObstacles(motions, boxes, fps)
    view = np.vstack([extent.view_points(boxes, motions), obstacles.points(), seen_points(motions)])
    size = max(0.5 * float(np.linalg.norm(np.ptp(view, axis=0))), 1e-3)
    several = len(motions) > 1
    off = OFF_OF_SEVERAL if several else OFF
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
        tags=packed(extent.tag_places(boxes) if several else np.zeros((0, 3)), np.float64),
        follow=extent.held(boxes, extent.middle(motions, frames, times)),
        wall=extent.wall(motions),
        size=size,
        opening=_opening(motions, start),
        thin=THIN * float(np.linalg.norm(np.ptp(boxes[:, 0], axis=1), axis=1).min()),
    )
    animations = obstacles.draw(drawing, size, start)
    for i, (motion, frame, look) in enumerate(zip(motions, frames, worn, strict=True)):
        color = look.rgb
        path = f"/nmm/motion {i}"
        robot = DrawnRobot(
            drawing, motion.robot, f"{path}/robot", tint=color if several else None, rank=i, off=off
        )
        robot.carry(drawing, motion.surroundings.carried)
        robot.place(frame.q[0], frame.wheels[0])
        animations += robot.animations(frame, start)
        tag = look.name if several else ""
        if ghosts is None:
            round_times = ghost_times(float(motion.t[0]), float(motion.t[-1]), times, boxes[i])
            samples = nearest(motion.t, np.array(round_times)).tolist() if round_times else []
        else:
            samples = ghost_samples(motion, ghosts)
        if samples:
            texts = [f"{tag}{' ' * several}{motion.t[k]:.3g} s" for k in samples]
            ghosts_of = robot.ghosts(f"{path}/ghosts", motion.q[samples], wheels[i][samples], texts)
            drawing.commands.append({**ghosts_of, "clear": ghosts is None})
        # Unlabelled, the page attributes the line to the end-effector.
        label = look.name or ("" if motion.driven is not None else motion.robot.name)
        drawing.add("motion", path=path, root=robot.root, label=label, color=list(color), tag=tag)
        nodes = list(frame_nodes(motion.robot, robot, drawing, every=False))
        drawing.add("triads", frames=nodes, length=axes_length(boxes[i][0]))
        drawn = samples_kept(motion.t, fps)
        for name, points, thick in (
            ("path", motion.driven, 1.0),
            ("platform", _on_the_floor(motion.robot, motion.q, size), 0.6),
        ):
            if points is not None:
                _line(drawing, f"{path}/{name}", color, points[drawn], motion.t[drawn] - start, thick)
        planned = None if motion.planned is None else _on_the_floor(motion.robot, motion.planned, size)
        if planned is not None:
            _line(drawing, f"{path}/plan", DESIRED, planned[drawn], thick=0.6, text="plan")
        animations += draw_cameras(drawing, motion, robot, path, start, fps, size)
        if motion.believed is not None:
            believed = replace(motion, q=motion.believed, path=None)
            animations += _believed(drawing, believed, wheels[i], path, len(motions) + i, start, fps)
        draw_nearest(drawing, motion, path, color if several else None, start, fps)
        if shown is not None:
            animations += shown.draw(drawing, i, path, color, start)
    obstacles.tell(drawing)
    _tell_carried(drawing, motions)
    tell_cameras(drawing, [camera for motion in motions for camera in motion.cameras])
    if paths := [
        f"/nmm/motion {i}/believed" for i, motion in enumerate(motions) if motion.believed is not None
    ]:
        drawing.add("believed", paths=paths, color=list(BELIEVED))
    _desired(drawing, motions)
    _targets(drawing, motions, size)
    if shown is not None:
        shown.tell(drawing, [f"/nmm/motion {i}" for i in range(len(motions))], worn[0].rgb)
    plotted = [channels(run) for run in runs]
    draw_curves(drawing, plotted, worn, start)
    draw_facts(drawing, runs, plotted, worn, start)
    drawing.add("set_animation", animations=animations, options={"play": False, "repetitions": 1})
    drawing.add("ready")
    return drawing.commands


def _opening(motions: Sequence[Motion], start: float) -> dict[str, Any]:
    """Where a page looks from at first, and the time that it shows, from `start`; the first motion's."""
    first = motions[0].surroundings
    camera = first.camera if isinstance(first.camera, str) else list(first.camera)
    return {"camera": camera, "time": 0.0 if first.opens is None else first.opens - start}


def live_scene(
    robot: Robot, q: Array, wheels: Array, *, title: str, room: float = 2.0, seen: Array | None = None
) -> tuple[list[Command], DrawnRobot]:
    """Commands for a robot at q (n,) with wheel angles (D,) that is moved from outside, and the drawn robot,
    to place it; the view holds `room`, m, of ground around it and the points `seen` (K, 3)."""
    box = extent.robot_boxes(robot, q[np.newaxis], wheels[np.newaxis])[0]
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
        view=packed(extent.corners(around), np.float64),
        follow=extent.held(extent.reached(robot, q, wheels)[np.newaxis], base_position(robot, q)[np.newaxis]),
        size=0.5 * float(np.linalg.norm(np.ptp(around, axis=0))),
        thin=THIN * float(np.linalg.norm(np.ptp(box, axis=0))),
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
    )
    drawing.add("ready")
    return drawing.commands, drawn


def still(robot: Robot, q: Array, obstacles: Iterable[Obstacle], **beside: Any) -> Motion:
    """A robot that stands at q (n,), with obstacles as at t = 0, and what else is beside it."""
    now = np.zeros(1)
    bodies = tuple(
        Body(obstacle.name, obstacle.shape.drawn(), obstacle_places(obstacle, now)) for obstacle in obstacles
    )
    return Motion(robot, now, q[np.newaxis], np.zeros((1, robot.n_u)), bodies=bodies, **beside)


def points_beside(motion: Motion, boxes: Array) -> Array:
    """Points (K, 3), m, of what is beside a robot: its desired path, target and bodies near it."""
    parts = [np.atleast_2d(points) for points in (motion.desired, motion.target) if points is not None]
    return np.vstack([*parts, SceneObstacles([motion], boxes[np.newaxis], 1.0).points()])


def draw_beside(
    drawing: Drawing, motion: Motion, boxes: Array, robot: DrawnRobot, size: float | None = None
) -> None:
    """Append the commands that draw it, as at the motion's first sample, and what the drawn robot carries;
    `boxes` (1, 2, 3) are around it, `size` is half the diagonal of what is shown, m, by default of all of
    this."""
    if size is None:
        points = np.vstack([points_beside(motion, boxes), boxes.reshape(-1, 3)])
        size = 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    obstacles = SceneObstacles([motion], boxes[np.newaxis], 1.0)
    obstacles.draw(drawing, size, 0.0)
    obstacles.tell(drawing)
    robot.carry(drawing, motion.surroundings.carried)
    _tell_carried(drawing, [motion])
    _desired(drawing, [motion])
    _targets(drawing, [motion], size)


def _ellipsoids(
    motions: Sequence[Motion], frames: Sequence[Keyframes], wanted: Wanted
) -> SceneEllipsoids | None:
    if wanted is False:
        return None
    # Imported only here: it imports the whole analysis.
    from nmm.views.playback.ellipsoids import SceneEllipsoids

    options = options_of(wanted)
    return None if options is None else SceneEllipsoids(motions, frames, options)


def _tell_carried(drawing: Drawing, motions: Sequence[Motion]) -> None:
    """Append what names the things that are carried."""
    for name in dict.fromkeys(item.name for motion in motions for item in motion.surroundings.carried):
        drawing.add("carried", name=name, color=list(CARRIED))


def _believed(
    drawing: Drawing,
    motion: Motion,
    wheels: Array,
    path: str,
    rank: int,
    start: float,
    fps: float,
) -> list[Command]:
    """A transparent copy of the robot that moves where it is believed to be; what animates it."""
    frames = keyframes(motion, fps, wheels)
    copy = DrawnRobot(
        drawing,
        motion.robot,
        f"{path}/believed",
        tint=BELIEVED,
        opacity=THROUGH,
        rank=rank,
        off=OFF_OF_SEVERAL,
    )
    copy.place(frames.q[0], frames.wheels[0])
    return copy.animations(frames, start)


def _desired(drawing: Drawing, motions: Sequence[Motion]) -> None:
    """Each desired path once: compared motions usually share it."""
    seen: list[Array] = []
    for motion in motions:
        path = motion.desired
        if path is None or any(path.shape == other.shape and np.allclose(path, other) for other in seen):
            continue
        samples = np.unique(np.linspace(0, len(path) - 1, MOST_FRAMES).astype(int))
        _line(drawing, f"/nmm/desired {len(seen)}", DESIRED, path[samples], text="desired path")
        seen.append(path)


def _line(
    drawing: Drawing,
    path: str,
    color: Rgb,
    points: Array,
    t: Array | None = None,
    thick: float = 1.0,
    text: str = "",
) -> None:
    """A path through points (K, 3), m, which grows over times (K,) if given; else it is dashed, and the
    legend calls it `text`."""
    line, times = packed(points, np.float32), None if t is None else packed(t, np.float64)
    drawing.add("path", path=path, color=list(color), points=line, times=times, thick=thick, text=text)


def _targets(drawing: Drawing, motions: Sequence[Motion], size: float) -> None:
    positions = [motion.target for motion in motions if motion.target is not None]
    targets = {tuple(target) for several in positions for target in np.atleast_2d(several).tolist()}
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


def _on_the_floor(robot: Robot, q: Array, size: float) -> Array | None:
    """The platform's path (N, 3) along q (N, n), just above the floor; None if it stays."""
    at = base_position(robot, q)
    if float(np.ptp(at, axis=0).max(initial=0.0)) < 1e-6:
        return None
    return np.column_stack([at, np.full(len(at), 2e-3 * size)])
