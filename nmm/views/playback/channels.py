"""A run's curves for the page: channels over time with units and limits, thinned to what a page holds. Its
numbers and events are shown beside them."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.findings.run import line
from nmm.base.resolver_style import DASHES, RunStyle, pretty, rate
from nmm.control.step.quantities import Curve, RecordedQuantity, placed
from nmm.model.robots.motion import Motion
from nmm.model.robots.robot import Robot
from nmm.motion.components import Axes, components
from nmm.motion.diagnosis.jumps import chattering
from nmm.motion.diagnosis.limits import AT_LIMIT
from nmm.motion.diagnosis.motors import motor_findings, motor_torques
from nmm.motion.diagnosis.summary import settling_time, summarise
from nmm.motion.table import summary_rows
from nmm.motion.trajectory import Trajectory
from nmm.views.playback.drawing import Drawing, packed
from nmm.views.playback.keyframes import MOST_FRAMES, samples_kept

#: A page draws at most so many samples for each second of motion, Hz, besides those that it must not miss.
FPS = 60.0
#: A sample is kept where the curve without it would be off by more than this share of the curve's range.
SEEN = 0.004
#: What moves less than this does so by rounding.
ROUNDING = 1e-9
#: Lengths of dash and gap, px, of the house style's dashes.
LENGTHS: Mapping[str, list[int]] = dict(zip(DASHES, ([], [7, 4], [9, 3, 2, 3], [2, 3]), strict=True))
#: Below this share of its range a shared quantity did not move enough to say what its limits are.
STILL = 1e-6


#: The panels that tell of a plan: what is spare, and what it asks of the robot.
OF_PLANS = ("clearance", "margin", "inputs")
#: The panel of what is not recorded, but follows from the motion.
TORQUES = Curve("torques", "Torques", 13)


@dataclass(frozen=True, eq=False)
class Channel:
    """One quantity over time in a panel of the page: values (K,), NaN where there is none; unit "" for none.
    `name` is its column in trajectory.csv, but for torques, and in the page's `nmm.state()`, `text` its
    label. Limits (lower, upper) are infinite where there is none; `log` asks for a logarithmic axis."""

    name: str
    text: str
    unit: str
    panel: str
    values: Array
    limits: tuple[float, float] = (-np.inf, np.inf)
    log: bool = False


@dataclass(frozen=True, eq=False)
class Channels:
    """A run's channels at the K of its `samples` that a page holds, t (K,) s; `partitions` names RG's
    partitions by their numbers in the channel "partition"; `plan`: whether it is a plan, for which no task is
    followed."""

    t: Array
    samples: int
    channels: tuple[Channel, ...]
    partitions: tuple[str, ...] = ()
    plan: bool = False


def channels(run: Trajectory | Motion) -> Channels:
    plotted = list(_of_motion(run))
    events: list[Integers] = []
    partitions: tuple[str, ...] = ()
    if isinstance(run, Trajectory):
        plotted = [*_of_task(run), *plotted, *_of_motors(run)]
        if np.any(run.partition >= 0):
            number, partitions, switches = _partition(run)
            plotted.append(Channel("partition", "partition", "", "partition", number))
            events += [switches, switches - 1]
        times = [event.t for event in run.events]
        events.append(np.searchsorted(run.t, times).clip(0, len(run.t) - 1))
    values = [np.where(np.isfinite(channel.values), channel.values, np.nan) for channel in plotted]
    samples = _kept(run.t, values, events)
    thinned = (replace(channel, values=x[samples]) for channel, x in zip(plotted, values, strict=True))
    plan = isinstance(run, Trajectory) and run.resolver == "plan"
    return Channels(run.t[samples], len(run.t), tuple(thinned), partitions, plan)


def live_channels(
    axes: Axes, hidden: Container[str], *, partitioned: bool = False
) -> tuple[list[RecordedQuantity], tuple[Channel, ...]]:
    """The quantities that pages plot of a live robot, all but the hidden ones, and their channels, without
    values; if `partitioned`, a channel for RG's partition follows those of the quantities."""
    none, robot = np.zeros(0), axes.robot
    shown = [
        (quantity, curve)
        for quantity, curve in curves()
        if quantity.name not in hidden and (quantity.noted or quantity.of)
    ]
    plotted = [
        Channel(column, text, unit, curve.panel, none, log=curve.log == "always")
        for quantity, curve in shown
        for column, text, unit in axes.labels(quantity)
    ]
    if partitioned:
        plotted.append(Channel("partition", "partition", "", "partition", none))
    still = Motion(robot, np.zeros(1), robot.rest[np.newaxis], np.zeros((1, robot.n_u)))
    plotted += [replace(channel, values=none) for channel in _of_motion(still)]
    return [quantity for quantity, _ in shown], tuple(plotted)


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


def _of_motors(run: Trajectory) -> Iterator[Channel]:
    """Torques of the motors whose limits are known."""
    if (motors := motor_torques(run)) is None:
        return
    units = motors.dynamics.actuators.units
    for name, unit, effort, values in zip(motors.names, units, motors.efforts, motors.torques.T, strict=True):
        if np.isfinite(effort):
            ends = (-float(effort), float(effort))
            yield Channel(f"torque {name}", pretty(name), unit, TORQUES.panel, values, ends)


def _of_task(run: Trajectory) -> Iterator[Channel]:
    for quantity, curve in curves():
        if not _drawn(run, quantity, curve):
            continue
        lower = getattr(run, curve.lower) if isinstance(curve.lower, str) else curve.lower
        for column, text, unit, values in components(run, quantity):
            x = np.where(np.abs(values) < curve.exact, 0.0, values)
            log = curve.log == "always" or (curve.log == "positive" and not np.any(x < 0.0))
            yield Channel(column, text, unit, curve.panel, x, (lower, np.inf), log)


def curves() -> list[tuple[RecordedQuantity, Curve]]:
    pairs = [
        (quantity, quantity.curve) for quantity in placed() if quantity.name not in ("q", "u", "partition")
    ]
    return [(quantity, curve) for quantity, curve in pairs if curve is not None]


def _drawn(run: Trajectory, quantity: RecordedQuantity, curve: Curve) -> bool:
    if curve.if_true:
        return bool(getattr(run, curve.if_true))
    values = run[quantity.name]
    return (
        values is not None
        and len(values) == len(run)
        and (np.isnan(quantity.fill) or bool(np.any(values != quantity.fill)))
    )


def _limits_kept(run: Trajectory) -> dict[str, tuple[float, float]]:
    """The limits by name, from their shares s of a range: x = lower + s (upper - lower). Only where a share
    follows x throughout, unlike that of a limit on one side alone (`runs.margins`)."""
    robot = run.robot
    values = {f"u_{name}": run.u[:, i] for i, name in enumerate(robot.u_names)}
    values |= {name: run.q[:, i] for i, name in enumerate(robot.q_names)}
    limits: dict[str, tuple[float, float]] = {}
    limited = zip(run.limit_names, run.shares.T, strict=True) if len(run.shares) == len(run) else ()
    for name, share in limited:
        if name not in values or not np.ptp(share) > STILL:
            continue
        x, low, high = values[name], int(np.argmin(share)), int(np.argmax(share))
        width = float(x[high] - x[low]) / float(share[high] - share[low])
        lower = float(x[low]) - float(share[low]) * width
        # A share has no more digits than that.
        if width > 0.0 and np.allclose(lower + share * width, x, rtol=0.0, atol=1e-7 * width):
            limits[name] = round(lower, 9), round(lower + width, 9)
    return limits


def _partition(run: Trajectory) -> tuple[Array, tuple[str, ...], Integers]:
    """Numbers (N,) of the basic columns' sets in use, the sets' names, and the samples where they change."""
    columns = np.sort(run.partition, axis=1)
    switches = np.flatnonzero(np.any(np.diff(columns, axis=0) != 0, axis=1)) + 1
    begins = np.concatenate([[0], switches])
    sets, number = np.unique(columns[begins], axis=0, return_inverse=True)
    texts = tuple(partition_text(run.robot, basic) for basic in sets)
    lasts = np.diff(np.append(begins, len(columns)))
    return np.repeat(number.reshape(-1).astype(np.float64), lasts), texts, switches


def partition_text(robot: Robot, columns: Iterable[int]) -> str:
    return ", ".join(input_text(robot, k) for k in columns if k >= 0) or "none: damped"


def input_text(robot: Robot, column: int) -> str:
    """An input's label: v, or a joint's rate by the joint's name."""
    name = robot.u_names[column]
    return pretty(name) if column < robot.platform.p else rate(name)


def _kept(t: Array, curves: Sequence[Array], events: Sequence[Integers]) -> Integers:
    """The samples that a page holds, ascending: about `FPS` a second, both ends, events, each curve's
    extremes and ends of gaps; between those, the worst one where a curve would be visibly off."""
    samples = samples_kept(t, FPS).astype(np.int64)
    if len(samples) == len(t):
        return samples
    must = [samples, *events]
    worst = np.zeros(len(samples) - 1)
    where = np.zeros(len(samples) - 1, dtype=np.int64)
    for values in curves:
        known = np.isfinite(values)
        if not known.any():
            continue
        edges = np.flatnonzero(known[1:] != known[:-1])  # where the curve begins or ends to be known
        must += [np.array([np.nanargmin(values), np.nanargmax(values)]), edges, edges + 1]
        size = max(float(np.nanmax(values) - np.nanmin(values)), ROUNDING)
        off = np.nan_to_num(np.abs(values - np.interp(t, t[samples], values[samples])) / size)
        most = np.maximum.reduceat(off, samples[:-1])
        better = most > worst
        for k in np.flatnonzero(better & (most > SEEN)):
            where[k] = samples[k] + int(np.argmax(off[samples[k] : samples[k + 1]]))
        worst = np.where(better, most, worst)
    missed = np.flatnonzero(worst > SEEN)
    missed = missed[np.argsort(-worst[missed])][:MOST_FRAMES]
    return np.unique(np.concatenate([*must, where[missed]]).astype(np.int64))


def draw_curves(drawing: Drawing, runs: Sequence[Channels], looks: Sequence[RunStyle], start: float) -> None:
    """Append the command "curves": each run's channels in its look; `start` is the page's first time, s."""
    lanes: dict[str, dict[str, Any]] = {}
    data = []
    for run, look in zip(runs, looks, strict=True):
        columns = {}
        for channel in run.channels:
            known = lanes.get(channel.name)
            same = known is None or (known["unit"], known["panel"]) == (channel.unit, channel.panel)
            # With its unit, if another robot's channel of that name has a different one.
            key = channel.name if same else f"{channel.name} [{channel.unit}]"
            lane = {
                "key": key,
                "panel": channel.panel,
                "text": channel.text,
                "unit": channel.unit,
                "log": channel.log,
            }
            lanes.setdefault(key, lane)
            ends = [float(end) if np.isfinite(end) else None for end in channel.limits]
            columns[key] = {"values": packed(channel.values, np.float32), "limits": ends}
        dash = LENGTHS[look.dashes] if len(runs) > 1 else []
        own = {"samples": run.samples, "partitions": list(run.partitions), "columns": columns}
        worn = {"name": look.name, "color": look.color, "dash": dash}
        data.append({"t": packed(run.t - start, np.float64), **own, **worn})
    used = {lane["panel"] for lane in lanes.values()}
    plans = all(run.plan for run in runs)

    def place(curve: Curve) -> tuple[int, int]:
        first = plans and curve.panel in OF_PLANS
        return OF_PLANS.index(curve.panel) if first else len(OF_PLANS), curve.place

    panels = [
        {
            "id": curve.panel,
            "title": curve.title,
            "open": curve.panel in OF_PLANS if plans else _opens(curve, runs),
        }
        for curve in sorted(filter(None, [*(quantity.curve for quantity in placed()), TORQUES]), key=place)
        if curve.panel in used
    ]
    drawing.add("curves", panels=panels, lanes=list(lanes.values()), runs=data)


def _opens(curve: Curve, runs: Sequence[Channels]) -> bool:
    if curve.panel == "partition":
        return any(len(run.partitions) > 1 for run in runs)
    series = [channel.values for run in runs for channel in run.channels if channel.panel == curve.panel]
    return any(x[np.isfinite(x)].min(initial=1.0) < curve.opens_below for x in series)


MOST = 100
#: A margin above this share of its range ends a contact with the limit.
LEFT = 0.01


def draw_facts(
    drawing: Drawing,
    runs: Sequence[Motion | Trajectory],
    plotted: Sequence[Channels],
    looks: Sequence[RunStyle],
    start: float,
) -> None:
    """Append the command "facts", unless all runs are mere motions; `start` is the page's first time, s."""
    data = []
    for run, channels, look in zip(runs, plotted, looks, strict=True):
        facts: list[tuple[str, str]] = []
        happened: list[tuple[float, str]] = []
        if isinstance(run, Trajectory):
            numbers = summarise(run, motors=False)
            facts += summary_rows(run, numbers, events=False)  # they have their own list
            facts += [("message", run.message)] * bool(run.message)
            facts += [("warning", warning) for warning in numbers["warnings"]]
            facts += [("motors", str(finding)) for finding in motor_findings(run)]
            happened = sorted(events(run, channels))
        shown = [[t - start, text] for t, text in happened[:MOST]]
        more = max(len(happened) - MOST, 0)
        data.append({"name": look.name, "facts": facts, "events": shown, "more": more})
    if any(of_run["facts"] for of_run in data):
        drawing.add("facts", runs=data)


def events(run: Trajectory, channels: Channels) -> Iterator[tuple[float, str]]:
    """Times, s, and texts: tasks that come and go, limits reached, partitions changed, singularities passed,
    chattering, settling, and the outcome, unless the run just completed."""
    for event in run.events:
        yield event.t, f"{event.task} {event.what}{f': {event.why}' if event.why else ''}"
    if len(run.shares) == len(run):
        inputs = {f"u_{u_name}": input_text(run.robot, i) for i, u_name in enumerate(run.robot.u_names)}
        for name, share in zip(run.limit_names, run.shares.T, strict=True):
            for words, margin in (("lower", share), ("upper", 1.0 - share)):
                for k in _reached(margin):
                    yield float(run.t[k]), f"{inputs.get(name, pretty(name))} reaches its {words} limit"
    number = next((channel.values for channel in channels.channels if channel.name == "partition"), None)
    if number is not None:
        for last in np.flatnonzero(np.diff(number)):
            before, after = (channels.partitions[int(number[i])] for i in (last, last + 1))
            yield float(channels.t[last + 1]), f"partition {before} → {after}"
    for t in run.t[np.flatnonzero(run.crossed)].tolist():
        yield t, "J_e was singular on the way from the sample before"
    if (jumps := chattering(run.t, run.u, run.robot.u_names)) is not None:
        yield jumps.where["t"], str(jumps)
    for finding in motor_findings(run):
        yield finding.where["t"], str(finding)
    if (settles := settling_time(run)) is not None:
        yield float(run.t[0]) + settles, "‖e‖ down to 2 % of its start"
    if len(run) and (run.verdict.reasons or not run.complete):
        first = line(run.verdict.reasons[:1])  # the table has all
        yield float(run.t[-1]), f"{run.outcome}{f': {first}' if first else ''}"


def _reached(margin: Array) -> Iterator[int]:
    """The samples at which a margin (N,) falls to zero after having been above `LEFT`."""
    near = margin <= AT_LIMIT
    since = 0
    for k in np.flatnonzero(near & ~np.concatenate([[False], near[:-1]])):
        if k == 0 or since == 0 or margin[since:k].max() > LEFT:
            yield int(k)
        since = int(k)
