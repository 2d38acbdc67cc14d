"""Square drives of MuJoCo's differential drive: what UMBmark and a calibration say by their ends."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from calibration_drives import READ, REST, TICKS, along_means, simulated
from calibration_mjcf import STEP, World
from calibration_worlds import differential

import nmm

Array = np.ndarray
#: A square's side, m; drives each way; speeds, m/s and rad/s, with their accelerations, m/s² and rad/s².
SIDE, EACH, SPEED, TURN, FASTER, SPIN = 2.0, 5, 0.5, 0.8, 1.0, 2.0
#: Of UMBmark robots: their wheels are nearly alike, which its formulas are for.
UNLIKE, TRACK_OFF = 0.004, 0.03
#: How well a robot's place and heading are measured where it begins and ends, m and rad.
PLACE, HEADING = 0.001, 0.002
LEFT, RIGHT = "left_wheel_joint", "right_wheel_joint"


def leg(way: float, speed: float, most: float) -> Array:
    """Speeds (N,) at MuJoCo's steps that add up to a way, m or rad, with ramps."""
    ramp = min(speed / most, math.sqrt(abs(way) / most))
    top = most * ramp
    whole = abs(way) / top + ramp
    t = STEP * (np.arange(max(round(whole / STEP), 2)) + 0.5)
    values = np.clip(np.minimum(t, whole - t) * most, 0.0, top)
    return math.copysign(1.0, way) * values * abs(way) / (values.sum() * STEP)


def square(sign: float) -> Array:
    """Inputs (N, 2) of a square by the file's numbers: v and omega; standing before and after."""
    parts = [np.zeros((round(REST / STEP), 2))]
    for _ in range(4):
        ahead, turn = leg(SIDE, SPEED, FASTER), leg(sign * 0.5 * math.pi, TURN, SPIN)
        parts += [np.stack([ahead, 0.0 * ahead], axis=1), np.stack([0.0 * turn, turn], axis=1)]
    return np.concatenate([*parts, np.zeros((round(0.2 / STEP), 2))])


def square_log(world: World, sign: float, rng: np.random.Generator, name: str) -> nmm.DriveLog:
    """A log of which the ends are measured."""
    seen = simulated(world, square(sign), rng)
    first = round(REST / STEP) - 1
    t, tick = STEP * np.arange(len(seen["at"]))[first::READ], 2.0 * math.pi / TICKS
    counts = {n: tick * np.floor(values[first::READ] / tick) for n, values in world.readings(seen).items()}
    heading = np.unwrap(np.arctan2(seen["ahead"][:, 1], seen["ahead"][:, 0]))
    poses = np.column_stack([along_means(seen["at"][:, :2], heading), heading])[first::READ][[0, -1]]
    poses = poses + rng.normal(size=(2, 3)) * [PLACE, PLACE, HEADING]
    return nmm.DriveLog(name, t, counts, t[[0, -1]], poses, "ends")


def squares_run(seed: int) -> dict[str, Any]:
    """The quotient of the radii, and the track for the file's mean radius, by both, with what is true."""
    rng = np.random.default_rng([seed, 77])
    world = differential(rng, UNLIKE, TRACK_OFF)
    logs = [square_log(world, sign, rng, f"{sign:g} {k}") for k in range(EACH) for sign in (1.0, -1.0)]
    begin = time.process_time()
    found = nmm.calibrate(world.robot, logs)
    spent = time.process_time() - begin
    paper = nmm.UMBmark.from_logs(world.robot, logs, by="both")
    left, right = (f"radius.{name}" for name in (LEFT, RIGHT))
    numbers = found.numbers
    quotient = numbers[right].after / numbers[left].after
    index = [found.learned.index(name) for name in (left, right)]
    slope = quotient * np.array([-1.0 / numbers[left].after, 1.0 / numbers[right].after])
    spread = float(np.sqrt(slope @ found.covariance[np.ix_(index, index)] @ slope))
    mean = 0.5 * (world.truth[left] + world.truth[right])  # ends where they began do not tell it
    truth = world.truth[right] / world.truth[left], world.truth["track"] * 0.1 / mean
    told = {
        "E_d by the ends": (truth[0], quotient, spread),
        "track by the ends": (truth[1], numbers["track"].after, numbers["track"].deviation),
        "E_d by UMBmark": (truth[0], paper.E_d, spread),
        "track by UMBmark": (truth[1], paper.true_track, numbers["track"].deviation),
    }
    held_out = found.held_out.verdict if found.held_out else "none"
    rest = {"white": found.whiteness, "verdict": held_out, "spent": spent, "noise": found.noise._asdict()}
    return {"platform": "squares", "seed": seed, "numbers": told, **rest}
