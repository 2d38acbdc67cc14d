"""Drives of MuJoCo's robots (`calibration_worlds`), and their logs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np
from calibration_mjcf import STEP, World

import nmm

Array = np.ndarray
#: A reading of the counters and a look of the reference are so many of MuJoCo's steps apart; before it stands
#: still, s.
READ, LOOK, REST = 5, 50, 0.5
#: Ticks of a wheel's turn, and of a turn of a steering or hitch angle.
TICKS, FINE = 4096, 65536
#: The reference's deviations, m and rad, and its delay, s.
PLACE, HEADING, DELAY = 0.005, 0.005, 0.03
#: Pushes of rough ground at a wheel's axle, N for a wheel that turns by 1 rad/s (with its rate's root); slip
#: of a tyre on its hub, rad for a rad that it turns (with its way's root).
ROUGH, SLIP = 6.0, 0.01
Inputs = Callable[[Array, np.random.Generator], Array]


def simulated(world: World, u: Array, rng: np.random.Generator, noise: bool = True) -> dict[str, Array]:
    """Sensors by name, (N, ...) at each step, of inputs (N, p) at each step of MuJoCo, and `slips` (N, w).

    Raises RuntimeError where MuJoCo warns, as of a motion that is not stable: it is no truth.
    """
    model = mujoco.MjModel.from_xml_string(world.xml)
    data, rates = mujoco.MjData(model), np.abs(world.rates(u))
    each = SLIP * np.sqrt(rates[::READ] * STEP * READ) * rng.normal(size=rates[::READ].shape) * noise
    at = np.arange(len(u)) / READ
    slips = np.stack(
        [np.interp(at, np.arange(len(each)), column) for column in np.cumsum(each, axis=0).T], axis=1
    )
    pushes = np.zeros((len(u), model.nbody, 6))
    for i, name in enumerate(world.wheels):
        sizes = ROUGH * np.sqrt(rates[:, i, np.newaxis]) * noise
        pushes[:, model.body(name).id, :2] = sizes * rng.normal(size=(len(u), 2))
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS
    begin = np.zeros(mujoco.mj_stateSize(model, whole))
    mujoco.mj_getState(model, data, begin, whole)
    spec = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_XFRC_APPLIED
    told = np.concatenate([world.controls(u, slips), pushes.reshape(len(u), -1)], axis=1)
    told = np.repeat(told, world.substeps, axis=0)
    warned: list[str] = []
    mujoco.set_mju_user_warning(warned.append)  # else MuJoCo writes into a file in the working directory
    try:
        _, seen = mujoco.rollout.rollout(
            model, data, begin[np.newaxis], told[np.newaxis], control_spec=int(spec)
        )
    finally:
        mujoco.set_mju_user_warning(None)
    if warned:
        raise RuntimeError(f"MuJoCo: {warned[0]}")
    found: dict[str, Any] = {"slips": slips}
    for i in range(model.nsensor):
        first, many = model.sensor_adr[i], model.sensor_dim[i]
        part = seen[0, :: world.substeps, first : first + many]
        found[model.sensor(i).name] = part[:, 0] if many == 1 else part
    return found


def along_means(places: Array, headings: Array, substeps: int = 1) -> Array:
    """Places (N, 2) whose steps are turned by half of a turn of MuJoCo's step, of which so many are one of
    headings (N,): MuJoCo's are along the heading where a step begins, and leave an arc by half a step of its
    way."""
    half = 0.5 * np.diff(headings) / substeps
    x, y = np.diff(places, axis=0).T
    steps = np.stack([np.cos(half) * x - np.sin(half) * y, np.sin(half) * x + np.cos(half) * y], axis=1)
    return places[0] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def drive(
    world: World, seconds: float, rng: np.random.Generator, noise: bool = True, inputs: Inputs | None = None
) -> tuple[nmm.DriveLog, dict[str, float]]:
    """A log, and the true numbers of its reference."""
    t = STEP * np.arange(round((seconds + REST) / STEP) + 1)
    begins = np.clip((t - 0.2) / 0.5, 0.0, 1.0)[:, np.newaxis]
    seen = simulated(world, (inputs or world.inputs)(t, rng) * begins, rng, noise)
    first = round(REST / STEP)
    counts = {name: values[first::READ] for name, values in world.readings(seen).items()}
    mount = np.array([rng.uniform(-0.2, 0.3), rng.uniform(-0.15, 0.15), rng.uniform(-0.3, 0.3)])
    heading = np.unwrap(np.arctan2(seen["ahead"][:, 1], seen["ahead"][:, 0]))
    c, s = np.cos(heading), np.sin(heading)
    places = along_means(seen["at"][:, :2], heading, world.substeps) + np.stack(
        [c * mount[0] - s * mount[1], s * mount[0] + c * mount[1]], axis=1
    )
    looks = np.column_stack([places, heading + mount[2]])[first::LOOK]
    if noise:
        looks = looks + rng.normal(size=looks.shape) * [PLACE, PLACE, HEADING]
        for name, values in counts.items():
            tick = 2.0 * math.pi / (TICKS if name in world.wheels else FINE)
            counts[name] = tick * (np.floor(values / tick) + 0.5)
    truth = dict(zip(("reference.x", "reference.y", "reference.yaw"), mount.tolist(), strict=True))
    log = nmm.DriveLog("drive", t[first::READ] - REST, counts, t[first::LOOK] - REST + DELAY, looks, "poses")
    return log, truth | {"delay": DELAY, "clock": 0.0}
