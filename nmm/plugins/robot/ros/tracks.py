"""What messages of one kind say, over time: whose clock counts, what is in between, where it jumps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from nmm.base.arrays import Array, Flags, Integers, interpolated
from nmm.base.findings import Finding

#: Stamps that are the same for longer, in ns of recording, stand still.
STANDS = 500_000_000
#: Stamps farther from the time of recording, ns, are another clock's.
ANOTHER = 1_000_000_000
#: A step of what moves is a jump where its neighbours do not foretell it within m (rad), and m/s² (rad/s²)
#: times the interval squared; tyres hold no more than 1 g.
MOVES = np.array([[0.05, 10.0], [0.1, 40.0]])
#: Of a frame that corrects another one: m (rad), and per second.
CORRECTS = np.array([[0.05, 0.1], [0.05, 0.1]])
#: Rates are compared with what moved in so long, s, if it is more than so much, rad or m.
WINDOW, LITTLE = 0.5, 0.02


@dataclass
class Track:
    """Rows, all of one shape, at the stamps of their messages, ns, and at the times of recording."""

    stamps: list[int] = field(default_factory=list)
    recorded: list[int] = field(default_factory=list)
    rows: list[Array] = field(default_factory=list)
    by_recording: bool = False  #: whether these are its times

    def add(self, stamp: int, recorded: int, row: Array) -> None:
        self.stamps.append(stamp)
        self.recorded.append(recorded)
        self.rows.append(row)

    def __len__(self) -> int:
        return len(self.stamps)

    def sorted(self) -> tuple[Integers, Array]:
        """Times (N,), ns, that increase, and rows (N, ...); of equal times the last."""
        stamps = np.array(self.recorded if self.by_recording else self.stamps, dtype=np.int64)
        order = np.argsort(stamps, kind="stable")
        times = stamps[order]
        last = np.diff(times, append=times[-1:] + 1) > 0
        return times[last], np.array(self.rows)[order[last]]

    def between(self, times: Integers) -> Array:
        """Rows (N, k) at times, ns, linear in between."""
        stamps, rows = self.sorted()
        start = stamps[0]
        return interpolated((times - start) / 1e9, (stamps - start) / 1e9, rows)

    def without(self, some: Flags) -> None:
        """Leave those messages out."""
        rest = np.flatnonzero(~some).tolist()
        self.stamps, self.recorded = ([part[k] for k in rest] for part in (self.stamps, self.recorded))
        self.rows = [self.rows[k] for k in rest]


def settle(tracks: Iterable[tuple[str, Track]]) -> list[Finding]:
    """Time tracks (each with its topic's name) by recording where their stamps are 0 or stand still, and then
    also the others whose stamps are another clock's."""
    filled = [(name, track) for name, track in tracks if len(track)]
    why: dict[tuple[str, str], None] = {}
    for name, track in filled:
        if reason := _flaw(track):
            track.by_recording, why[reason, name] = True, None
    findings = [Finding("stamps_of_recording", {"topic": name, "why": reason}) for reason, name in why]
    others = [(name, track) for name, track in filled if not track.by_recording]
    if why:
        for name, track in others:
            apart = np.median(np.subtract(track.recorded, track.stamps, dtype=np.float64))
            if abs(apart) > ANOTHER:
                track.by_recording = True
                findings.append(Finding("stamps_of_recording", {"topic": name, "why": "another clock"}))
    lost: dict[str, int] = {}
    for name, track in filled:
        stamps = np.array(track.stamps)
        rest = stamps[stamps > 0]
        if not track.by_recording and 0 < len(rest) < len(stamps) and rest.min() > np.ptp(rest) + ANOTHER:
            lost[name] = max(lost.get(name, 0), len(stamps) - len(rest))
            track.without(stamps <= 0)
    findings += [Finding("stamps_missing", {"topic": name, "count": count}) for name, count in lost.items()]
    return [*{str(finding): finding for finding in findings}.values()]


def _flaw(track: Track) -> str:
    """What is wrong with its stamps: "zero", "standing", or ""."""
    order = np.argsort(track.recorded, kind="stable")
    stamps, recorded = np.array(track.stamps)[order], np.array(track.recorded)[order]
    if np.sum((stamps <= 0) & (recorded > 0)) > 0.5 * len(stamps):
        return "zero"
    starts = np.flatnonzero(np.diff(stamps, prepend=stamps[0] - 1))
    ends = np.append(starts[1:], len(stamps)) - 1
    many = (ends - starts >= 2) & (recorded[ends] - recorded[starts] > STANDS)
    all_same = len(starts) == 1 and recorded[-1] > recorded[0]
    return "standing" if many.any() or all_same else ""


def poses_at(times: Integers, stamps: Integers, poses: Array, jumps: Flags) -> Array:
    """Poses (N, 4, 4) at times, ns, interpolated between poses (M, 4, 4) at increasing stamps, ns: along a
    straight line and about one axis; across jumps (M - 1,) the earlier pose is held."""
    if len(stamps) == 1:
        return np.repeat(poses, len(times), axis=0)
    k = np.clip(np.searchsorted(stamps, times, side="right") - 1, 0, len(stamps) - 2)
    share = np.clip((times - stamps[k]) / (stamps[k + 1] - stamps[k]), 0.0, 1.0)
    share = np.where(jumps[k], np.floor(share), share)
    placed = poses[k]
    placed[:, :3, 3] += share[:, np.newaxis] * (poses[k + 1, :3, 3] - poses[k, :3, 3])
    first = Rotation.from_matrix(poses[k, :3, :3])
    turned = (first.inv() * Rotation.from_matrix(poses[k + 1, :3, :3])).as_rotvec()
    moved = (share > 0.0) & np.any(turned, axis=1)
    if moved.any():
        on = first[moved] * Rotation.from_rotvec(share[moved, np.newaxis] * turned[moved])
        placed[moved, :3, :3] = on.as_matrix()
    return placed


def steps_of(times: Integers, poses: Array) -> tuple[Array, Array]:
    """The intervals (M - 1,), s, between poses (M, 4, 4), and their steps (M - 1, 3): x, y, m, and about z,
    rad."""
    yaw = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    turned = np.remainder(np.diff(yaw) + np.pi, 2 * np.pi) - np.pi
    return np.diff(times) / 1e9, np.column_stack([np.diff(poses[:, :2, 3], axis=0), turned])


def jumps_of(times: Integers, poses: Array, corrects: bool) -> Flags:
    """After which of poses (M, 4, 4) a jump comes, (M - 1,); `corrects`: what only corrects moves seldom."""
    lasts, steps = steps_of(times, poses)
    if corrects:
        off = np.column_stack([np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])])
        return np.asarray(
            ((off > CORRECTS[:, 0]) & (off > CORRECTS[:, 1] * lasts[:, np.newaxis])).any(axis=1)
        )
    if len(lasts) < 2:
        return np.zeros(len(lasts), dtype=bool)
    rates = steps / lasts[:, np.newaxis]
    beside = [steps[1:] - rates[:-1] * lasts[1:, np.newaxis], steps[:-1] - rates[1:] * lasts[:-1, np.newaxis]]
    off = np.full((len(lasts), 2), np.inf)
    for where, unlike in ((slice(1, None), beside[0]), (slice(None, -1), beside[1])):
        size = np.column_stack([np.hypot(unlike[:, 0], unlike[:, 1]), np.abs(unlike[:, 2])])
        off[where] = np.minimum(off[where], size)
    return np.asarray((off > MOVES[:, 0] + MOVES[:, 1] * lasts[:, np.newaxis] ** 2).any(axis=1))


def foretold(times: Integers, poses: Array, twists: Array) -> Flags:
    """Which steps (M - 1,) between poses (M, 4, 4) the twists (M, 3) there are large enough for."""
    lasts, steps = steps_of(times, poses)
    far = np.column_stack([np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])])
    speeds = np.column_stack([np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])])
    within = np.maximum(speeds[1:], speeds[:-1]) * lasts[:, np.newaxis]
    return np.asarray(((2.0 * within >= far) | (far <= MOVES[:, 0])).all(axis=1))


def contradict(times: Integers, values: Array, rates: Array) -> bool:
    """Whether rates (N, k) are not those of values (N, k) at the same times, ns: over windows of half a
    second they differ by more than half of what moved."""
    if len(times) < 3:
        return False
    seconds = (times - times[0]) / 1e9
    mean = 0.5 * (rates[1:] + rates[:-1]) * np.diff(seconds)[:, np.newaxis]
    moved = np.vstack([np.zeros(values.shape[1]), np.cumsum(mean, axis=0)])
    ends = np.unique(np.searchsorted(seconds, np.arange(0.0, seconds[-1], WINDOW)))
    ends = np.unique([*ends, len(seconds) - 1])
    off, way = np.diff((moved - values)[ends], axis=0), np.diff(values[ends], axis=0)
    return bool(np.abs(off).max() > LITTLE and np.linalg.norm(off) > 0.5 * np.linalg.norm(way))


def by_differences(seconds: Array, rows: Array, breaks: Flags) -> Array:
    """Rates (N, k) of rows (N, k), per second, by differences that do not reach over the breaks (N - 1,); of
    a row alone 0."""
    rates = np.zeros(rows.shape)
    for part in np.split(np.arange(len(seconds)), np.flatnonzero(breaks) + 1):
        if len(part) > 1:
            rates[part] = np.gradient(rows[part], seconds[part], axis=0)
    return rates
