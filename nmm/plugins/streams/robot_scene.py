"""From a robot's samples to pictures of it: every frame, its path, what is near."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import few
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import NO_SURROUNDINGS, Body, Carried, Surroundings
from nmm.plugins.robot.ros.description import description
from nmm.plugins.robot.ros.making import body_twist, joint_names, readings, rolled_readings, root_link
from nmm.plugins.robot.ros.placed import PlacedFrames
from nmm.plugins.streams.bodies import shown_surface, surface
from nmm.plugins.streams.pictures import DrawnBody, Near, Pose, RobotPicture, Still, Surface, Triangles
from nmm.views.playback.placements import position_and_quaternion
from nmm.views.playback.rolling import RolledRobot

#: What is sensed again and again is sent at most so often, s: a surface of it takes long to make.
ANEW = 1.0


class Sample(NamedTuple):
    """What a run or a loop has of an instant; points in m, world axes.

    seen (n,) : where odometry has the robot, where that is not q
    wheels (D,) : angles; None to roll them from the sample before
    """

    t: float
    stamp: int
    q: Array
    u: Array
    error: Array
    seen: Array | None = None
    reached: Array | None = None
    wanted: Array | None = None
    near: Near | None = None
    wheels: Array | None = None


class RobotScene:
    """A robot and what stands around it.

    Parameters
    ----------
    robot : the robot
    title : of the recording
    errors : names and units of the task's rows
    start : the clock's time at the begin, ns since 1970
    believed : whether samples have odometry beside the truth
    desired (M, 3), marks (K, 3) : m in the world, where they are known before
    address : of a mesh, by its file (`description`)
    begin : time of the first sample, s
    obstacles, surroundings : what is drawn beside the robot
    q0 (n,) : where the robot is at first, with what it carries; at rest unless given

    Attributes
    ----------
    still : what does not change
    """

    def __init__(
        self,
        robot: Robot,
        title: str,
        errors: Sequence[tuple[str, str]],
        start: int,
        *,
        believed: bool = False,
        desired: Array | None = None,
        marks: Array | None = None,
        address: Callable[[str], str] | None = None,
        begin: float = 0.0,
        obstacles: Sequence[Obstacle] = (),
        surroundings: Surroundings = NO_SURROUNDINGS,
        q0: Array | None = None,
    ) -> None:
        self.robot = robot
        self._frames = frames = PlacedFrames(robot, root_link(robot), believed=believed)
        self._rolled: RolledRobot | None = None
        text, left_out = description(robot, frames.links, address)
        notes = [f"shapes that a URDF has no words for are not drawn: {few(left_out)}"] if left_out else []
        self._obstacles: list[_Shown] = []
        self._carried: list[_Held] = []
        self._taken: set[str] = set()
        bodies: list[DrawnBody] = []
        unbounded: list[str] = []
        for obstacle in obstacles:
            if (drawn := surface(obstacle.shape.drawn())) is None:
                unbounded.append(obstacle.name)
                continue
            place = obstacle.placement(begin)
            self._obstacles.append(_Shown(len(bodies), obstacle, obstacle.shape, place))
            bodies.append(self._body(obstacle.name, drawn, place))
        here = Configuration(robot, robot.rest if q0 is None else q0)
        beside: list[Body | Carried] = [*surroundings.scenery, *surroundings.carried]
        for body in beside:
            if (drawn := surface(body.geometry)) is not None:
                if isinstance(body, Body):
                    place = body.places[0]
                else:
                    place = held(here, body)
                    self._carried.append(_Held(len(bodies), body, place))
                bodies.append(self._body(body.name, drawn, place))
        if unbounded:
            notes.append(f"shapes without an end are not drawn: {few(unbounded)}")
        self._joints = RolledRobot(robot, robot.rest).rolling.joints
        places = robot.n - len(joint_names(robot))
        self.still = Still(
            title=title,
            description=text,
            world=frames.world,
            odom=frames.odom,
            base=frames.base,
            fixed=frames.still,
            coordinates=[
                *zip(joint_names(robot), robot.q_units[places:], strict=True),
                *((name, "rad") for name in self._joints),
            ],
            inputs=[*zip(robot.u_names, robot.u_units, strict=True)],
            errors=[*errors],
            wheeled=bool(robot.platform.n_p),
            believed=believed,
            desired=self._points(desired),
            marks=self._points(marks),
            bodies=bodies,
            notes=notes,
            start=start,
        )

    def _points(self, points: Array | None) -> Array:
        """World points (N, 3) in the world's frame of the tree."""
        rows = np.zeros((0, 3)) if points is None else np.asarray(points, dtype=np.float64).reshape(-1, 3)
        return np.array([self._frames.ground.act(row) for row in rows]).reshape(-1, 3)

    def _point(self, point: Array | None) -> Array | None:
        return None if point is None or not np.isfinite(point).all() else self._points(point)[0]

    def _in_world(self, place: Array) -> Pose:
        return position_and_quaternion(self._frames.ground.homogeneous @ place)

    def _body(self, name: str, surface: Triangles, place: Array) -> DrawnBody:
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return DrawnBody(name, surface, self._in_world(place))

    def picture(self, sample: Sample) -> RobotPicture:
        """The sample as a tool is given it; samples come in the order of their times."""
        robot, q = self.robot, sample.q
        seen = q if sample.seen is None else sample.seen
        wheels, q_dot = self._wheels(seen, sample.wheels), robot.S(seen) @ sample.u
        turned = {name: (float(angle), 0.0) for name, angle in zip(self._joints, wheels, strict=True)}
        turned = rolled_readings(robot, turned, seen, q_dot)
        stand = position_and_quaternion(self._frames.stand(seen))
        moved, changed = self._moved(sample.t, q)
        near = sample.near
        if near is not None and near.points is not None:
            finite = bool(np.isfinite(near.points).all())
            near = near._replace(points=self._points(near.points) if finite else None)
        return RobotPicture(
            t=sample.t,
            stamp=sample.stamp,
            transforms=self._frames.at(q, seen, wheels),
            stand=stand,
            seen=stand if self.still.believed else None,
            twist=body_twist(robot, seen, q_dot) if robot.platform.n_p else None,
            q=np.array([*readings(robot, q), *(angle for angle, _ in turned.values())]),
            u=sample.u,
            error=sample.error,
            reached=self._point(sample.reached),
            wanted=self._point(sample.wanted),
            near=near if near is not None and np.isfinite(near.distance) else None,
            moved=moved,
            changed=changed,
        )

    def _wheels(self, seen: Array, wheels: Array | None) -> Array:
        if wheels is not None:
            return wheels
        if self._rolled is None:
            self._rolled = RolledRobot(self.robot, seen)
        else:
            self._rolled.roll(seen[np.newaxis])
        return self._rolled.now[1]

    def _moved(self, t: float, q: Array) -> tuple[dict[int, Pose], dict[int, Surface]]:
        """Bodies that are elsewhere, or others, since the last picture."""
        moved, changed = dict[int, Pose](), dict[int, Surface]()
        for shown in self._obstacles:
            if shown.obstacle.shape is not shown.shape and abs(t - shown.since) >= ANEW:  # sensed anew
                shown.shape, shown.since = shown.obstacle.shape, t
                changed[shown.number] = shown_surface(shown.obstacle, shown.shape)
            place = shown.obstacle.placement(t)
            if not np.array_equal(place, shown.place):
                shown.place = place
                moved[shown.number] = self._in_world(place)
        if self._carried:
            here = Configuration(self.robot, q)
            for load in self._carried:
                place = held(here, load.body)
                if not np.array_equal(place, load.place):
                    load.place = place
                    moved[load.number] = self._in_world(place)
        return moved, changed


def held(here: Configuration, body: Carried) -> Array:
    """Where a load is, (4, 4), m, world axes."""
    place: Array = here.placement(body.frame).homogeneous @ body.place
    return place


@dataclass
class _Held:
    """A load, its number among the bodies, and its place (4, 4) as it was drawn last."""

    number: int
    body: Carried
    place: Array


@dataclass
class _Shown:
    """An obstacle, its number among the bodies, its shape and place (4, 4) as they were drawn last, and since
    when it is that shape, s."""

    number: int
    obstacle: Obstacle
    shape: Any
    place: Array
    since: float = -math.inf
