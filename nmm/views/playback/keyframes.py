"""The instants of a motion that a page holds."""

from dataclasses import dataclass

import numpy as np

from nmm.base.arrays import Array, interpolated
from nmm.model.robots.motion import Motion
from nmm.views.playback.placements import base_position
from nmm.views.playback.rolling import wheel_angles

#: No part may turn further than this between two frames, rad: half a turn would be played backwards.
LARGEST_TURN = 1.0
#: A page holds at most this many frames of a motion (before `LARGEST_TURN` adds some).
MOST_FRAMES = 6000
#: Frames inserted between two samples at most: a motion that needs more is too fast to be seen.
MOST_BETWEEN = 32
#: Copies of a robot along its way, and which share of one's room on the floor may be another's.
MOST_GHOSTS, SHARED = 4, 0.2


@dataclass(frozen=True, eq=False)
class Keyframes:
    """K instants of a motion: t (K,) s, q (K, n), wheels (K, D) rad (see `rolling_joints`)."""

    t: Array
    q: Array
    wheels: Array

    def __len__(self) -> int:
        return len(self.t)


def keyframes(motion: Motion, fps: float = 60.0, wheels: Array | None = None) -> Keyframes:
    """Thin a motion with wheel angles (N, D) to about `fps` samples a second, with both ends; where parts
    turn by more than `LARGEST_TURN` in between, frames linear in the coordinates are added."""
    wheels = wheel_angles(motion) if wheels is None else wheels
    frames = np.column_stack([motion.t, motion.q, wheels])[samples_kept(motion.t, fps)]
    turning = [False, *(unit == "rad" for unit in motion.robot.q_units), *[True] * wheels.shape[1]]
    steps = np.abs(np.diff(frames[:, turning], axis=0)).max(axis=1, initial=0.0)
    between = np.clip(np.ceil(steps / LARGEST_TURN), 1, MOST_BETWEEN).astype(int)
    if np.any(between > 1):
        grid = [np.arange(k) / k + i for i, k in enumerate(between)]
        at = np.concatenate([*grid, [len(frames) - 1.0]])
        frames = interpolated(at, np.arange(len(frames), dtype=np.float64), frames)
    first = 1 + motion.robot.n
    return Keyframes(frames[:, 0], frames[:, 1:first], frames[:, first:])


def samples_kept(t: Array, fps: float) -> Array:
    """Indices of samples at t (N,), s, about `fps` a second, with both ends."""
    count = min(int(np.ceil((t[-1] - t[0]) * fps)) + 1, MOST_FRAMES)
    return np.unique(np.concatenate([nearest(t, np.linspace(t[0], t[-1], count)), [0, len(t) - 1]]))


def ghost_samples(motion: Motion, count: int) -> list[int]:
    if count <= 0 or len(motion.t) < 2:
        return []
    steps = np.linalg.norm(np.diff(base_position(motion.robot, motion.q), axis=0), axis=1)
    if motion.driven is not None:
        steps = steps + np.linalg.norm(np.diff(motion.driven, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    if way[-1] <= 0.0:
        return [len(motion.t) - 1]
    return sorted({int(i) for i in nearest(way, np.linspace(0.0, way[-1], count))})


def ghost_times(start: float, end: float, times: Array, boxes: Array) -> list[float]:
    """Three or four round times, s, from start to end at which a robot stands clear of where it stands at the
    others, as far as there are any: boxes (K, 2, 3) around it at times (K,)."""
    best: list[float] = []
    for step in _round_steps(end - start):
        chosen: list[float] = []
        around: list[Array] = []
        for k in range(int(np.ceil(start / step - 1e-9)), int(np.floor(end / step + 1e-9)) + 1):
            box = interpolated(np.array([k * step]), times, boxes.reshape(len(boxes), 6))[0].reshape(2, 3)
            if all(_shared(box, other) <= SHARED for other in around):
                chosen.append(k * step)
                around.append(box)
        while len(chosen) > MOST_GHOSTS:
            chosen = chosen[::2]
        best = max(best, chosen, key=len)
        if len(best) >= MOST_GHOSTS - 1:
            break
    return best if len(best) > 1 else []


def _round_steps(duration: float) -> list[float]:
    """1, 2 and 5 times powers of ten, from the duration down to a fortieth of it."""
    if duration <= 0.0:
        return []
    power = int(np.floor(np.log10(duration)))
    steps = [digit * 10.0**exponent for exponent in range(power, power - 3, -1) for digit in (5, 2, 1)]
    return [step for step in steps if duration / 40.0 <= step <= duration]


def _shared(box: Array, other: Array) -> float:
    """Which share of the smaller of two boxes (2, 3) the other one covers, from above."""
    sides = np.minimum(box[1], other[1])[:2] - np.maximum(box[0], other[0])[:2]
    areas = [float(np.prod(np.ptp(corners, axis=0)[:2])) for corners in (box, other)]
    return float(np.prod(np.maximum(sides, 0.0))) / max(min(areas), 1e-12)


def nearest(values: Array, wanted: Array) -> Array:
    last = len(values) - 1
    right = np.searchsorted(values, wanted).clip(min(1, last), last)
    left = np.maximum(right - 1, 0)
    return np.where(wanted - values[left] <= values[right] - wanted, left, right)
