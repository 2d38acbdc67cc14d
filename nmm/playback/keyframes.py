"""Which instants of a motion the page holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array, interpolated
from nmm.playback.placements import base_position
from nmm.playback.rolling import wheel_angles
from nmm.robots.motion import Motion

#: No part may turn further than this between two frames, rad: half a turn would be played backwards.
LARGEST_TURN = 1.0
#: A page holds at most so many frames a motion (before it looks at `LARGEST_TURN`).
MOST_FRAMES = 6000
#: Frames put between two samples at most: a motion that needs more shows nothing that one could see.
MOST_BETWEEN = 32


@dataclass(frozen=True, eq=False)
class Keyframes:
    """K instants of a motion: t (K,) s, q (K, n), wheels (K, D) rad (see `rolling_joints`)."""

    t: Array
    q: Array
    wheels: Array

    def __len__(self) -> int:
        return len(self.t)


def keyframes(motion: Motion, fps: float = 60.0, wheels: Array | None = None) -> Keyframes:
    """Thin a motion to about `fps` frames a second of its time; its wheels' angles (N, D), if they are known.

    Frames are samples of the motion, the first and the last among them; only where parts turn by more
    than `LARGEST_TURN` between two samples are frames put in between, linear in the coordinates.
    """
    t, wheels = motion.t, wheel_angles(motion) if wheels is None else wheels
    kept = samples_kept(t, fps)
    everything = np.column_stack([motion.q, wheels])[kept]
    times = t[kept]
    turning = [unit == "rad" for unit in motion.robot.q_units] + [True] * wheels.shape[1]
    steps = np.abs(np.diff(everything[:, turning], axis=0)).max(axis=1, initial=0.0)
    between = np.clip(np.ceil(steps / LARGEST_TURN), 1, MOST_BETWEEN).astype(int)
    if np.any(between > 1):
        grid = [np.arange(k) / k + i for i, k in enumerate(between)]
        at = np.concatenate([*grid, [len(times) - 1.0]])
        index = np.arange(len(times), dtype=np.float64)
        everything = interpolated(at, index, everything)
        times = np.interp(at, index, times)
    n = motion.robot.n
    return Keyframes(times, everything[:, :n], everything[:, n:])


def samples_kept(t: Array, fps: float) -> Array:
    """Which of the samples at t (N,), s, are frames: about `fps` a second, both ends among them."""
    count = min(int(np.ceil((t[-1] - t[0]) * fps)) + 1, MOST_FRAMES)
    return np.unique(np.concatenate([_nearest(t, np.linspace(t[0], t[-1], count)), [0, len(t) - 1]]))


def ghost_samples(motion: Motion, count: int) -> list[int]:
    """Samples at which ghosts stand: evenly along the way that platform and end-effector travel."""
    if count <= 0 or len(motion.t) < 2:
        return []
    steps = np.linalg.norm(np.diff(base_position(motion.robot, motion.q), axis=0), axis=1)
    if motion.driven is not None:
        steps = steps + np.linalg.norm(np.diff(motion.driven, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    if way[-1] <= 0.0:
        return [len(motion.t) - 1]
    return sorted({int(i) for i in _nearest(way, np.linspace(0.0, way[-1], count))})


def _nearest(values: Array, wanted: Array) -> Array:
    """Indices of the ascending `values` that lie nearest to `wanted`."""
    right = np.clip(np.searchsorted(values, wanted), 1, max(len(values) - 1, 1))
    right = np.minimum(right, len(values) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(wanted - values[left] <= values[right] - wanted, left, right)
