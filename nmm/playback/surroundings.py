"""What a robot keeps off that moves in a page: obstacles that stand, and where those are that move."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.recorded import places
from nmm.playback.drawing import Command, Drawing
from nmm.playback.extent import robot_boxes
from nmm.playback.obstacles import SceneObstacles
from nmm.robots.bodies import Body
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot


class Surroundings:
    """Obstacles about a robot.

    Parameters
    ----------
    obstacles : what a controller keeps the robot off
    robot, q, wheels : the robot, where it begins (n,), and its wheels' angles (W,)
    """

    def __init__(self, obstacles: tuple[Obstacle, ...], robot: Robot, q: Array, wheels: Array) -> None:
        self._obstacles = obstacles
        now = np.zeros(1)
        bodies = tuple(Body(one.name, one.shape.geometry(), places(one, now)) for one in obstacles)
        still = Motion(robot, now, q[np.newaxis], np.zeros((1, robot.n_u)), bodies=bodies)
        boxes = robot_boxes(robot, q[np.newaxis], wheels[np.newaxis])[np.newaxis]
        self._scene = SceneObstacles([still], boxes, 1.0)

    def draw(self, drawing: Drawing, size: float) -> None:
        """Append the commands that draw them at t = 0; size : half the diagonal of what is shown, m."""
        self._scene.draw(drawing, size, 0.0)
        self._scene.tell(drawing)

    def moved(self, t: float) -> Command:
        """The command that puts those that move where they are at t, s."""
        transforms = [
            [f"/nmm/obstacle {i}", np.array(one.placement(t)).T.ravel().tolist()]
            for i, one in enumerate(self._obstacles)
            if one.moves
        ]
        return {"type": "places", "transforms": transforms}
