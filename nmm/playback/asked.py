"""What a scenario asks for, before anything has run: the desired path, the target, the obstacles."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.collisions.recorded import places
from nmm.functions.program import Program
from nmm.functions.tasks.task import Task
from nmm.robots.bodies import Body
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot
from nmm.runs.shown_frame import shown
from nmm.scenario import Scenario

#: Instants at which the desired path is asked for.
INSTANTS = 400
#: A path that is no longer, m, is a point.
STANDS = 1e-6


def asked_for(scenario: Scenario, robot: Robot) -> Motion:
    """The robot at the scenario's start, in one sample, with what it is to follow and to keep off.

    A path that depends on where the robot is, or on when tasks come and go, is left out.
    """
    q = robot.following.placed(robot.q(scenario.parts.q0))
    tasks = tuple(scenario.controller().task)
    frame, now = shown(tasks, robot), np.zeros(1)
    path = frame.path(robot, q[np.newaxis])
    desired, target = None, frame.mark(path)
    if path is not None and frame.rows and not any(one.when for one in tasks):
        times = np.linspace(0.0, float(scenario.parts.duration), INSTANTS)
        r_d = _references(tasks, robot, q, times)
        known = np.isfinite(r_d[:, list(frame.rows.values())]).all(axis=1)
        points = frame.desired(np.repeat(path, INSTANTS, axis=0), r_d)[known]
        if len(points) and np.ptp(points, axis=0).max() > STANDS:
            desired = points
        elif len(points) and target is None:
            target = points[0]
    return Motion(
        robot,
        now,
        q[np.newaxis],
        np.zeros((1, robot.n_u)),
        desired=desired,
        target=target,
        bodies=tuple(
            Body(one.name, one.shape.geometry(), places(one, now)) for one in scenario.obstacles(robot)
        ),
    )


def _references(tasks: tuple[Task, ...], robot: Robot, q: Array, times: Array) -> Array:
    """The targets (N, s) of the tasks' rows at times, s; not numbers where they depend on q."""
    program = Program(robot, [task.reference for task in tasks])
    program.lay_out()
    found = []
    for t in times:
        rows = program.evaluate(float(t), q)
        found.append(np.concatenate([np.where(one.value_q.any(axis=1), np.nan, one.value) for one in rows]))
    return np.array(found)
