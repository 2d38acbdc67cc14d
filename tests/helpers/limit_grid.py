"""Every kind of limit with an example, for the tests that go through all of them.

A new kind is tested by a new entry in `ENTRIES`; `test_limit_classes.py` notices when one is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from places import UR5

import nmm
from nmm.base.kernels.records import Frames
from nmm.control.limits.limit import LimitRows, LimitSample, LimitStage

Array = NDArray[np.float64]


@cache
def robot_of(name: str) -> nmm.Robot:
    """A bundled robot, or "base+arm"."""
    base, _, arm = name.partition("+")
    robot = nmm.load(base)
    return nmm.mount(robot, nmm.load({"ur5": UR5}.get(arm, arm)), prefix=f"{arm}_") if arm else robot


@dataclass(frozen=True)
class Entry:
    kind: str
    limit: nmm.Limit
    robots: tuple[str, ...]


ENTRIES = (
    Entry("hand_speed", nmm.HandSpeed("ee", 0.25), ("unicycle_2r", "unicycle_3r")),
    Entry("hand_speed", nmm.HandSpeed("ur5_ee_link", 0.25), ("car_base+ur5",)),
    Entry(
        "tip_over",
        nmm.TipOver(0.03),
        ("differential_base+ur5", "car_base+ur5", "omni_base+ur5", "differential_base+small_arm"),
    ),
)
CASES = [(entry.limit, robot) for entry in ENTRIES for robot in entry.robots]
NAMES = [f"{entry.kind}-{robot}" for entry in ENTRIES for robot in entry.robots]


def moving(robot: nmm.Robot, rng: np.random.Generator, fast: float = 0.3) -> tuple[Array, Array]:
    """A configuration (n,) and inputs (m,)."""
    q = robot.following.placed(rng.uniform(-0.3, 0.3, robot.n))
    return q, rng.normal(size=robot.n_u) * fast


def sample_at(robot: nmm.Robot, q: Array, u: Array, dt: float) -> LimitSample:
    """What a limit's kernels see at q (n,) and inputs u (m,)."""
    n_p = robot.platform.n_p
    G, G_q = (np.ascontiguousarray(one[0]) for one in robot.platform.velocity_maps(q[np.newaxis, :n_p]))
    own = np.array(robot.arm_coordinates), robot.following.table.ravel().astype(float)
    return LimitSample(0.0, dt, dt, q.copy(), G, G_q, u.copy(), robot.S(q) @ u, *own)


def frames_at(robot: nmm.Robot, q: Array, stage: LimitStage) -> Frames:
    here = nmm.Configuration(robot, q)
    placements = np.array([here.placement(name).homogeneous[:3] for name in stage.frames])
    jacobians = np.array([here.jacobian(name) for name in stage.frames])
    return Frames(np.arange(len(stage.frames)), placements, jacobians, np.zeros((0, 6, robot.n, robot.n)))


def unlimited(robot: nmm.Robot, stage: LimitStage) -> LimitRows:
    return LimitRows(
        np.zeros((stage.rows, robot.n_u)), np.full(stage.rows, -np.inf), np.full(stage.rows, np.inf)
    )


def rows_at(robot: nmm.Robot, limit: nmm.Limit, q: Array, u: Array, dt: float) -> LimitRows:
    """Its rows at q (n,) after inputs u (m,)."""
    stage = limit.stage(robot)
    rows = unlimited(robot, stage)
    stage.kernel(sample_at(robot, q, u, dt), frames_at(robot, q, stage), stage.numbers, rows)
    return rows


def values_at(robot: nmm.Robot, limit: nmm.Limit, q: Array, u: Array, u_dot: Array, dt: float) -> Array:
    """Its quantities at q (n,), inputs u (m,) and their change u_dot (m,), per s."""
    stage, values = limit.stage(robot), np.full(len(limit.rows(robot)), np.nan)
    stage.values(sample_at(robot, q, u, dt), frames_at(robot, q, stage), stage.numbers, u_dot, values)
    return values
