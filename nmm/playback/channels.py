"""A run's curves for the page: channels over time with units and limits, thinned to what a page holds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from nmm.arrays import Array, Integers
from nmm.looks import pretty, rate
from nmm.playback.keyframes import MOST_FRAMES, samples_kept
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot
from nmm.runs.trajectory import Trajectory

#: A page draws at most so many samples for each second of motion, Hz, besides those that it must not miss.
FPS = 60.0
#: A sample is kept where the curve without it would be off by more than this share of the curve's range.
SEEN = 0.004
#: What moves less than this does so by rounding.
ROUNDING = 1e-9
#: Below this share of its range a shared quantity did not move enough to say what its limits are.
STILL = 1e-6


@dataclass(frozen=True, eq=False)
class Channel:
    """One quantity over time.

    Attributes
    ----------
    name : column of trajectory.csv, and of `nmm.state()` in the page
    text : what people call it
    unit : "" for none
    panel : of the page, where it is drawn
    values (K,) : not a number where there is none
    limits : lower and upper, infinite where there is none
    log : whether it is drawn on a logarithmic scale where it is above zero
    """

    name: str
    text: str
    unit: str
    panel: str
    values: Array
    limits: tuple[float, float] = (-np.inf, np.inf)
    log: bool = False


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of one run at the K samples that a page holds.

    Attributes
    ----------
    t (K,) : s
    samples : how many the run has
    channels : each with K values
    partitions : what RG's partition is called, by its number in the channel "partition"
    """

    t: Array
    samples: int
    channels: tuple[Channel, ...]
    partitions: tuple[str, ...] = field(default=())


def channels(run: Trajectory | Motion) -> Channels:
    """What a page shows of a run; of a motion its inputs and coordinates.

    Raises
    ------
    InputError : no samples, as in `Motion`
    """
    found = list(_of_motion(run))
    events: list[Integers] = []
    partitions: tuple[str, ...] = ()
    if isinstance(run, Trajectory):
        found = [*_of_task(run), *found]
        if np.any(run.partition >= 0):
            number, partitions, switches = _partition(run)
            found.append(Channel("partition", "partition", "", "partition", number))
            events += [switches, switches - 1]
        times = [event.t for event in run.events]
        events.append(np.searchsorted(run.t, times).clip(0, len(run.t) - 1))
    found = [_finite(channel) for channel in found]
    kept = _kept(run.t, [channel.values for channel in found], events)
    thinned = tuple(_at(channel, kept) for channel in found)
    return Channels(run.t[kept], len(run.t), thinned, partitions)


def still_channels(robot: Robot) -> list[Channel]:
    """Those of a robot's inputs and coordinates, without values yet."""
    still = Motion(robot, np.zeros(1), robot.rest[np.newaxis], np.zeros((1, robot.n_u)))
    return [_replaced(channel, np.zeros(0)) for channel in _of_motion(still)]


def _of_motion(run: Trajectory | Motion) -> Iterator[Channel]:
    robot = run.robot
    named = _limits_kept(run) if isinstance(run, Trajectory) else {}
    for i, (name, unit, most) in enumerate(zip(robot.u_names, robot.u_units, robot.u_limits, strict=True)):
        key = f"u_{name}"
        ends = named.get(key, (-float(most), float(most)))
        yield Channel(key, input_text(robot, i), unit, "inputs", run.u[:, i], ends)
    for i, (name, unit) in enumerate(zip(robot.q_names, robot.q_units, strict=True)):
        own = np.where(robot.limited[i], robot.q_limits[i], [-np.inf, np.inf])
        ends = named.get(name, (float(own[0]), float(own[1])))
        yield Channel(name, pretty(name), unit, "coordinates", run.q[:, i], ends)


def _of_task(run: Trajectory) -> Iterator[Channel]:
    units = ", ".join(dict.fromkeys(run.r_units))
    yield Channel("error_norm", "‖e‖", units, "error", run.error_norm, log=True)
    for i, (name, unit) in enumerate(zip(run.r_names, run.r_units, strict=True)):
        yield Channel(f"error_{name}", f"e of {name}", unit, "components", run.error[:, i])
    if np.any(run.objective != 0.0):
        yield Channel("objective", "H", "", "H", run.objective, log=not np.any(run.objective < 0.0))
    yield Channel("sigma_min", "σ_min", "", "sigma", run.sigma_min)
    if run.limited:
        levels = run.scale.shape[1]
        for i in range(levels):
            text = "λ" if levels == 1 else f"λ of level {i + 1}"
            yield Channel(f"scale_{i}", text, "", "scale", run.scale[:, i])
    if run.shares.shape[1] and len(run.shares) == len(run.margin) == len(run):
        least = np.where(np.abs(run.margin) < ROUNDING, 0.0, run.margin)
        yield Channel("margin", "least margin", "", "margin", least, (0.0, np.inf))
    yield Channel("residual", "‖J u − rate‖", "", "residual", run.residual, log=True)
    if np.isfinite(run.clearance).any():
        yield Channel(
            "clearance", "clearance", "m", "clearance", run.clearance, (run.clearance_asked, np.inf)
        )


def _limits_kept(run: Trajectory) -> dict[str, tuple[float, float]]:
    """The limits of a run by what they limit, from the shares s of a range: x = lower + s (upper - lower).

    Only where the share follows x throughout: one of a limit that stands alone does not (`runs.margins`).
    """
    robot = run.robot
    values = {f"u_{name}": run.u[:, i] for i, name in enumerate(robot.u_names)}
    values |= {name: run.q[:, i] for i, name in enumerate(robot.q_names)}
    found: dict[str, tuple[float, float]] = {}
    if len(run.shares) != len(run):
        return found
    for name, share in zip(run.limit_names, run.shares.T, strict=True):
        if name not in values:
            continue
        x, low, high = values[name], int(np.argmin(share)), int(np.argmax(share))
        if not share[high] - share[low] > STILL:
            continue
        width = float(x[high] - x[low]) / float(share[high] - share[low])
        lower = float(x[low]) - float(share[low]) * width
        # As many digits as a share can tell.
        if width > 0.0 and np.allclose(lower + share * width, x, rtol=0.0, atol=1e-7 * width):
            found[name] = round(lower, 9), round(lower + width, 9)
    return found


def _partition(run: Trajectory) -> tuple[Array, tuple[str, ...], Integers]:
    """Which set of basic columns is in use, by number (N,), what each is called, and where another begins."""
    columns = np.sort(run.partition, axis=1)
    switches = np.flatnonzero(np.any(np.diff(columns, axis=0) != 0, axis=1)) + 1
    begins = np.concatenate([[0], switches])
    sets, number = np.unique(columns[begins], axis=0, return_inverse=True)
    texts = tuple(partition_text(run.robot, one) for one in sets)
    lasts = np.diff(np.append(begins, len(columns)))
    return np.repeat(number.reshape(-1).astype(np.float64), lasts), texts, switches


def partition_text(robot: Robot, columns: Iterable[int]) -> str:
    """What a partition is called, by the numbers of its columns; negative ones are none."""
    return ", ".join(input_text(robot, k) for k in columns if k >= 0) or "none: damped"


def input_text(robot: Robot, column: int) -> str:
    """What people call an input: v, or a joint's rate by the joint's name."""
    name = robot.u_names[column]
    return pretty(name) if column < robot.platform.p else rate(name)


def _finite(channel: Channel) -> Channel:
    """Infinite values are none."""
    return _replaced(channel, np.where(np.isfinite(channel.values), channel.values, np.nan))


def _at(channel: Channel, kept: Integers) -> Channel:
    return _replaced(channel, channel.values[kept])


def _replaced(channel: Channel, values: Array) -> Channel:
    return Channel(
        channel.name, channel.text, channel.unit, channel.panel, values, channel.limits, channel.log
    )


def _kept(t: Array, curves: Sequence[Array], events: Sequence[Integers]) -> Integers:
    """The samples that a page holds, ascending: about `FPS` a second, both ends, events, each curve's
    extremes and its gaps' ends, and of what lies between the worst, where a curve would be seen to be off."""
    kept = samples_kept(t, FPS).astype(np.int64)
    if len(kept) == len(t):
        return kept
    must = [kept, *events]
    worst = np.zeros(len(kept) - 1)
    where = np.zeros(len(kept) - 1, dtype=np.int64)
    for values in curves:
        known = np.isfinite(values)
        if not known.any():
            continue
        must += [np.array([np.nanargmin(values), np.nanargmax(values)]), *_gaps(known)]
        size = max(float(np.nanmax(values) - np.nanmin(values)), ROUNDING)
        off = np.nan_to_num(np.abs(values - np.interp(t, t[kept], values[kept])) / size)
        most = np.maximum.reduceat(off, kept[:-1])
        better = most > worst
        # The place of the worst sample is asked only where it matters.
        for k in np.flatnonzero(better & (most > SEEN)):
            where[k] = kept[k] + int(np.argmax(off[kept[k] : kept[k + 1]]))
        worst = np.where(better, most, worst)
    missed = np.flatnonzero(worst > SEEN)
    missed = missed[np.argsort(-worst[missed])][:MOST_FRAMES]
    return np.unique(np.concatenate([*must, where[missed]]).astype(np.int64))


def _gaps(known: Array) -> tuple[Integers, Integers]:
    """The samples on both sides of where a curve begins or ends to be known."""
    edges = np.flatnonzero(known[1:] != known[:-1])
    return edges, edges + 1
