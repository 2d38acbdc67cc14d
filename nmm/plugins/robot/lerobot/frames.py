"""A run as frames: its coordinates, its inputs and where its task wants it, at a data set's rate."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array, interpolated
from nmm.base.errors import InputError, expect
from nmm.model.robots.robot import Robot
from nmm.motion.trajectory import Trajectory
from nmm.plugins.robot.lerobot.layout import ACTION, PLACE, RATE, STATE, TARGET, Feature

#: How far, in frames, the last sample may be before a frame's time, by rounding.
ROUNDING = 1e-6
#: How much longer a run's step may be than a frame, as stamps are not exact.
SLACK = 1.01
#: Frames that may be between two samples, as some come late; what is longer is a gap.
LATE = 10
#: The methods whose inputs are held from sample to sample.
HELD = ("zoh", "zoh_midpoint")


def features_of(run: Trajectory) -> dict[str, Feature]:
    """What a frame of the run's robot has: q, u, and where the task wants its frame, if it says so at every
    sample."""
    robot = run.robot
    features = {
        STATE: Feature("float32", _ending(robot.q_names, PLACE), robot.q_units),
        ACTION: Feature("float32", _ending(robot.u_names, RATE), robot.u_units),
    }
    if has_target(run):
        features[TARGET] = Feature("float32", ("target.x", "target.y", "target.z"), ("m", "m", "m"))
    return features


def has_target(run: Trajectory) -> bool:
    return run.desired is not None and len(run.desired) == len(run) and bool(np.isfinite(run.desired).all())


def _ending(names: tuple[str, ...], end: str) -> tuple[str, ...]:
    return tuple(f"{name}{end}" for name in names)


def frames_of(run: Trajectory, fps: int, features: dict[str, Feature]) -> dict[str, Array]:
    """The features (K, k) at k / fps after the run's first sample. q is linear between samples; inputs are
    too, or those of the sample before where they are held.

    Raises
    ------
    InputError : a run of less than two frames, with fewer samples than frames or a gap; numbers that are not
        finite
    """
    expect(len(run) > 1, "", "at least two samples", len(run))
    seconds = run.t - run.t[0]
    steps = np.diff(seconds)
    step = float(np.median(steps))
    if step * fps > SLACK:
        expected = f"at most {int(1.0 / step + ROUNDING)}: it has a sample every {step:.4g} s"
        raise InputError(where="fps", expected=expected, got=fps)
    k = int(np.argmax(steps))
    if steps[k] * fps > LATE + ROUNDING:
        what = f"no sample from t = {run.t[k]:.4g} to {run.t[k + 1]:.4g} s"
        raise InputError(what, expected=f"one every {LATE} frames at least")
    count = int(np.floor(seconds[-1] * fps + ROUNDING)) + 1
    if count < 2:
        raise InputError(f"lasts {seconds[-1]:.3g} s", expected=f"at least two frames, {1 / fps:.3g} s")
    times = np.arange(count) / fps
    quantities = {STATE: run.q, ACTION: run.u, TARGET: run.desired}
    frames = {}
    for name, feature in features.items():
        rows = quantities[name]
        assert rows is not None
        _expect_finite(rows, feature, seconds)
        if name == ACTION and run.method in HELD and run.order == 1:
            at = np.searchsorted(seconds, times + ROUNDING / fps, side="right") - 1
            frames[name] = rows[at]
        else:
            frames[name] = interpolated(times, seconds, rows)
    return frames


def _expect_finite(rows: Array, feature: Feature, seconds: Array) -> None:
    most = np.finfo(feature.dtype).max
    with np.errstate(invalid="ignore"):
        wrong = np.argwhere(~(np.abs(rows) <= most))
    if len(wrong):
        k, i = wrong[0].tolist()
        name = (feature.names or ())[i]
        where = f"{name} at t = {seconds[k]:.4g} s"
        raise InputError(where=where, expected="a finite number of 32 bits", got=float(rows[k, i]))


def check_same(run: Trajectory, first: Trajectory, features: dict[str, Feature]) -> None:
    """`InputError` where a run has another robot than the first, or no target where that has one."""
    robot, other = first.robot, run.robot
    if other.fingerprint != robot.fingerprint:
        raise InputError("runs of several robots", expected=_said(robot), got=_said(other))
    own = features_of(run)
    if own.keys() != features.keys():
        expected = "a target at every sample, as the first run has" if TARGET in features else "no target"
        raise InputError(expected=f"{expected}: runs with one go into a data set of their own")
    assert own == features


def _said(robot: Robot) -> str:
    names = ", ".join(robot.u_names)
    return f"{robot.name} ({robot.n} coordinates; inputs {names})"
