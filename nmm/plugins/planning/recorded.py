"""A motion as a run, which plays, saves and compares."""

from __future__ import annotations

from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.control.functions.tasks.task import Task
from nmm.control.limits.limits import LimitsOn
from nmm.model.collisions.scene import Scene
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.reach import first_tip
from nmm.model.robots.robot import Robot
from nmm.motion.clearance import swept
from nmm.motion.margins import margin, shares, standing
from nmm.motion.seen import SeenPoints
from nmm.motion.shown_frame import shown_frame
from nmm.motion.trajectory import Trajectory
from nmm.motion.verdict import AS_ASKED, Verdict
from nmm.plugins.planning.targets import TaskError


def recorded(
    robot: Robot,
    t: Array,
    q: Array,
    u: Array,
    dt: float,
    task: Task,
    limits: LimitsOn,
    scene: Scene | None,
    method: str,
    verdict: Verdict = AS_ASKED,
    H: Array | None = None,
) -> Trajectory:
    """The run that was at q (N, n) with u (N, n_u) at t (N,), s, every dt; H (N,) : of an objective."""
    S = np.array([robot.S(row) for row in q])
    rows, drawn, seen = task.rows(robot), shown_frame([task], robot), SeenPoints([task], None, robot)
    evaluated = map(np.array, zip(*map(TaskError(robot, task).evaluate, q, t.tolist()), strict=True))
    r, r_d, error, error_q = evaluated
    names, within = shares(limits, robot, q, u, np.zeros((len(t), 0)))
    distances: dict[str, Any] = {}
    if scene is not None:
        pairs = tuple(" and ".join(pair) for pair in scene.names)
        distances = {"clearance_names": pairs, "clearance_asked": scene.distance}
        distances |= swept(scene, t, q, u, [scene.places(0.0)] * len(t)).kept
    frame = drawn.frame or first_tip(robot)
    path = None if frame is None else FramePath(robot, frame).positions(q)
    return Trajectory(
        robot=robot,
        t=t,
        q=q,
        u=u,
        q_dot=np.einsum("kij,kj->ki", S, u),
        r=r,
        r_d=r_d,
        error=error,
        objective=np.zeros(len(t)) if H is None else H,
        sigma_min=np.linalg.svd(error_q @ S, compute_uv=False)[:, -1],
        partition=np.full(error.shape, -1),
        residual=np.zeros(len(t)),
        scale=np.ones((len(t), 1)),
        step_size=np.ones(len(t)),
        crossed=np.zeros(len(t), dtype=np.int64),
        margin=margin(within[:, ~standing(robot, names, within)]),
        shares=within,
        limit_names=names,
        limited=True,
        r_names=tuple(row.name for row in rows),
        r_units=tuple(row.unit for row in rows),
        resolver=method,
        method=method,
        dt=dt,
        verdict=verdict,
        frame=frame,
        path=path,
        desired=None if path is None or not drawn.rows else drawn.desired(path, r_d),
        target=drawn.mark(path),
        seen=seen.at(t, q),
        cameras=seen.cameras,
        **distances,
    )
