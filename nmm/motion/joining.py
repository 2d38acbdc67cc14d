"""A run of tasks that come and go: its legs, from event to event, joined into one trajectory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nmm.base.arrays import Integers
from nmm.control.controller import Controller
from nmm.control.sequencing.sequence import Schedule
from nmm.control.step.quantities import QUANTITIES, saved
from nmm.control.step.recorded import Recorded, room
from nmm.motion.clearance import Swept, swept
from nmm.motion.leg import Leg
from nmm.motion.residuals import NO_RESIDUALS, Residuals
from nmm.motion.seen import SeenPoints
from nmm.motion.shown_frame import shown_frame
from nmm.motion.trajectory import Trajectory


def join(
    controller: Controller, schedule: Schedule, legs: Sequence[Leg], dt: float, method: str
) -> tuple[Trajectory, Swept | None]:
    """One trajectory of all tasks' rows, NaN where a task is inactive, and its distances."""
    robot, stack, tasks = controller.robot, schedule.tasks, schedule.tasks_on
    parts = [leg.recorder.trajectory(dt, method) for leg in legs]
    first = np.cumsum([0, *map(len, tasks.each)])
    record = joined_record(controller, schedule, legs)
    count = sum(map(len, parts))
    sizes = {"N": count, "s": len(tasks.rows), "l": len(tasks.levels)}
    arrays: dict[str, Any] = {}
    for quantity in saved():
        if quantity.shape not in ("Ns", "Nl"):
            continue
        arrays[quantity.name] = getattr(record, quantity.name, None)
        if arrays[quantity.name] is None:  # computed from what is recorded
            arrays[quantity.name] = quantity.room(sizes)
            for (_, samples, columns), part in zip(_places(schedule, legs), parts, strict=True):
                positions = np.array(columns[quantity.shape[1]], dtype=np.int64)
                if positions.size:
                    arrays[quantity.name][np.ix_(samples, positions)] = part[quantity.name]
    # What is of the run as a whole is worked out anew: distances, and what is drawn.
    for quantity in saved():
        if quantity.name not in arrays and quantity.shape.startswith("N") and not quantity.optional:
            arrays[quantity.name] = np.concatenate([part[quantity.name] for part in parts])
    t, q = arrays["t"], arrays["q"]

    distances: Swept | None = None
    if controller.solver.scene is not None:
        where = [place for leg in legs for place in leg.recorder.places]
        distances = swept(controller.solver.scene, t, q, arrays["u"], where)
    drawn = shown_frame(stack, robot)
    path = drawn.path(robot, q)
    desired = path if drawn.rows else None
    if desired is not None:
        for i, task in enumerate(stack):  # along the axes and at the times that each speaks of
            alone = shown_frame([task], robot)
            if alone.frame == drawn.frame:
                desired = alone.desired(desired, arrays["r_d"][:, first[i] :])
    seen = SeenPoints(stack, controller.limits, robot)
    happened = [*schedule.events, *(event for part in parts for event in part.events)]
    more = {name: arrays.pop(name) for name in [*arrays] if name in parts[0].more}
    own: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("u_dot", "believed")
        if getattr(parts[0], name) is not None
    }
    joined = replace(
        parts[0],
        **arrays,
        more=more,
        kinematics_off=float(np.fmax.reduce([part.kinematics_off for part in parts])),
        unmet=_unmet([part.unmet for part in parts], count),
        r_names=row_names(schedule),
        r_units=tuple(row.unit for row in tasks.rows),
        resolver=controller.resolver.name,
        frame=drawn.frame,
        path=path,
        desired=desired,
        planned=None,
        **own,
        target=drawn.mark(path),
        seen=seen.at(t, q),
        cameras=seen.cameras,
        events=tuple(sorted(dict.fromkeys(happened), key=lambda event: event.t)),
        **({} if distances is None else distances.kept),
    )
    return joined, distances


def room_for(controller: Controller, count: int) -> Recorded:
    """Room for `count` samples of all tasks' rows, active or not."""
    tasks = controller.solver.tasks_on if controller.schedule is None else controller.schedule.tasks_on
    n, m, *_, limited = controller.solver.sizes
    return room(count, n, m, len(tasks.rows), len(tasks.levels), limited)


def joined_record(controller: Controller, schedule: Schedule, legs: Sequence[Leg]) -> Recorded:
    """The legs' samples as a record of all tasks' rows, NaN (-1) where a task is inactive."""
    whole = room_for(controller, sum(len(leg.recorder) for leg in legs))
    for leg, samples, columns in _places(schedule, legs):
        recorded = leg.recorder.so_far
        for name, values in whole._asdict().items():
            shape = QUANTITIES[name].shape[1:]
            sizes = zip(shape, values.shape[1:], strict=True)
            some = [np.array(columns.get(axis, range(size)), dtype=np.int64) for axis, size in sizes]
            own = tuple(slice(len(each)) for each in some)  # without a task, a leg has a row of its own
            values[np.ix_(samples, *some)] = getattr(recorded, name)[:, *own]
    return whole


def _places(schedule: Schedule, legs: Sequence[Leg]) -> Iterator[tuple[Leg, Integers, dict[str, list[int]]]]:
    """Each leg with the samples of the whole run that are its own, and the columns of its rows (s) and levels
    (l) among those of all tasks."""
    stack, begin = schedule.tasks, 0
    levels = sorted({task.priority for task in stack})
    first = np.cumsum([0, *map(len, schedule.tasks_on.each)])
    for leg in legs:
        on = np.flatnonzero(leg.active)
        samples = begin + np.arange(len(leg.recorder))
        begin += len(samples)
        places = sorted({stack.tasks[i].priority for i in on})
        yield (
            leg,
            samples,
            {
                "s": [k for i in on for k in range(first[i], first[i + 1])],
                "l": [levels.index(priority) for priority in places],
            },
        )


def row_names(schedule: Schedule) -> tuple[str, ...]:
    """Names of all rows, prefixed by the task's where two tasks share a row's name."""
    tasks = schedule.tasks_on
    names = [row.name for row in tasks.rows]
    if len(set(names)) == len(names):
        return tuple(names)
    pairs = enumerate(zip(tasks.stack, tasks.each, strict=True))
    return tuple(f"{task.name or i}: {row.name}" for i, (task, rows) in pairs for row in rows)


def _unmet(parts: Sequence[Residuals], count: int) -> Residuals:
    some = [part for part in parts if part.samples]
    if not some:
        return NO_RESIDUALS
    samples = sum(part.samples for part in some)
    return max(some, key=lambda part: part.largest)._replace(samples=samples, share=samples / count)
