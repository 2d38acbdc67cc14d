"""Rows of a sweep by number: each a rollout of the scenario with its settings, measured in columns. Rows
whose settings are numbers share a robot, and those that only start elsewhere a controller. Threads take the
rows one by one, as the integration is compiled code that does not hold the GIL."""

from __future__ import annotations

import gc
import json
import tempfile
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from nmm import __version__
from nmm.base.errors import InputError, RunError
from nmm.base.extras import needed
from nmm.base.progress import Progress
from nmm.base.trust import trusting
from nmm.control.step.quantities import placed
from nmm.motion.diagnosis.summary import RUN_NUMBERS
from nmm.plugins.sweeps.definition import Definition, Listed
from nmm.scenario import Scenario

if TYPE_CHECKING:
    from nmm.control.controller import Controller
    from nmm.motion.trajectory import Trajectory

#: ‖e‖ has settled where it stays below this share of its initial value.
SETTLED = 0.02
#: Scenarios with robots kept in a process, and controllers in a thread, those used last.
MOST_KEPT = 16
#: One thread at a time runs what is not wholly compiled: Python gains nothing by more, and shapes load late.
_lock = threading.RLock()
_robots: OrderedDict[tuple[str, str], Scenario] = OrderedDict()
_own = threading.local()
Keep = Callable[[int, "Trajectory"], None]
Key = TypeVar("Key")
Value = TypeVar("Value")


arrow = partial(needed, "pyarrow", "a sweep's table in Parquet")
parquet = partial(needed, "pyarrow.parquet", "a sweep's table in Parquet")


class Column(NamedTuple):
    """A column: its name, its type ("number", "count" or "text"), its unit, and what it is."""

    name: str
    kind: str
    unit: str
    about: str


#: Columns of measured numbers that come first, in this order.
_FIRST = (
    "t_end", "arrival", "error_initial", "error_final", "error_max", "error_max_second_half", "error_rms",
    "objective_initial", "objective_final", "objective_mean_second_half", "objective_max_second_half",
    "objective_integral", "scale_min", "scaled_share", "sigma_min", "residual_max", "unmet_share",
    "margin_min", "clearance_min", "effort", "input_rms", "input_peak", "partition_switches",
    "step_size_min", "lateral_slip_max",
)  # fmt: skip


def _measured_columns() -> Iterator[Column]:
    """Those of the summary's numbers, which may have the units of rows or inputs, and two of sweeps alone."""
    for quantity in placed():
        unit = "" if quantity.unit in ("rows", "inputs", "coordinates") else quantity.unit
        for number in quantity.numbers:
            if number.about:
                yield Column(number.key, "count" if quantity.whole else "number", unit, number.about)
    yield from (
        Column(number.key, "number", number.unit, number.about) for number in RUN_NUMBERS if number.about
    )
    settled = "with `until` when it was there; without, from when on ‖e‖ < 2 % of its start"
    yield Column("arrival", "number", "s", settled)
    yield Column("effort", "number", "", "∫ ‖u‖² dt")


_COLUMNS = {column.name: column for column in _measured_columns()}
MEASURED = (
    Column(
        "outcome", "text", "", "how the rollout ended (docs/outcomes.md); refused: what varies is invalid"
    ),
    Column("message", "text", "", "why"),
    Column("warnings", "count", "", "how many things the run warned of"),
    *(_COLUMNS[name] for name in dict.fromkeys((*_FIRST, *_COLUMNS))),
)


def columns_of(definition: Definition) -> list[Column]:
    parameters = [
        Column(axis.key, "text" if isinstance(axis, Listed) and not axis.numbers else "number", "", "varied")
        for axis in definition.vary
    ]
    peaks = [
        Column(f"u_max.{name}", "number", "", f"largest |{name}|, per second") for name in definition.inputs
    ]
    return [Column("index", "count", "", "the row's number"), *parameters, *MEASURED, *peaks]


def measured(trajectory: Trajectory) -> dict[str, Any]:
    summary = trajectory.summary(motors=False)
    cells = {column.name: summary.get(column.name) for column in MEASURED}
    cells["warnings"] = len(summary["warnings"])
    if len(trajectory):
        cells["arrival"] = _arrival(trajectory, summary)
        cells["effort"] = float(np.trapezoid(np.sum(trajectory.u**2, axis=1), trajectory.t))
    return cells | {f"u_max.{name}": value for name, value in summary.get("u_max", {}).items()}


def failed(outcome: str, message: str) -> dict[str, Any]:
    unknown = dict.fromkeys(column.name for column in MEASURED)
    return unknown | {"outcome": outcome, "message": message, "warnings": 0}


def _arrival(trajectory: Trajectory, summary: dict[str, Any]) -> float | None:
    """When the target was reached, or ‖e‖ settled, s; None if never."""
    until = (trajectory.scenario or {}).get("until")
    if until is not None:
        return summary["t_end"] if trajectory.complete else None
    above = np.flatnonzero(trajectory.error_norm > SETTLED * summary["error_initial"])
    first = int(above[-1]) + 1 if len(above) else 0
    return float(trajectory.t[first]) if first < len(trajectory) else None


def rows_of(
    definition: Definition,
    indices: Sequence[int],
    keep: Keep | None = None,
    progress: Progress | None = None,
    threads: int = 1,
    trust: bool = False,
) -> list[dict[str, Any]]:
    """The rows of these numbers, in order: cells by column (`columns_of`), None where unknown. `keep` is
    called with each row's number and trajectory, if there is one. `trust` is of xacro files of its robots.

    A failed rollout's row says why: `outcome` "refused" for invalid settings (a start outside limits),
    "error" for an unexpected exception. Cells do not depend on `threads`; with several, Ctrl-C takes effect
    when the rows under way are done.
    """
    cells_of, changes = definition.parameters(indices), definition.changes(indices)
    rows: list[dict[str, Any]] = []

    def rollout(k: int) -> dict[str, Any]:
        with trusting(trust):
            return _rollout(definition, indices[k], changes[k], keep)

    def add(cells: dict[str, Any]) -> None:
        k = len(rows)
        rows.append({"index": indices[k], **cells_of[k], **cells})
        if progress is not None:
            progress(len(rows) / len(indices))

    gc.freeze()  # looking for garbage among all that libraries hold takes a tenth of the time
    try:
        # With several threads the first row compiles alone.
        first = len(indices) if threads == 1 else min(1, len(indices))
        for k in range(first):
            add(rollout(k))
        if first < len(indices):
            with ThreadPoolExecutor(min(threads, len(indices) - first)) as pool:
                try:
                    for cells in pool.map(rollout, range(first, len(indices))):
                        add(cells)
                except BaseException:
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
    finally:
        gc.unfreeze()
    return rows


def _rollout(
    definition: Definition, index: int, changes: dict[str, Any], keep: Keep | None
) -> dict[str, Any]:
    try:
        with _lock:
            scenario = scenario_of(definition, changes)
        controller, compilable = _controller_of(scenario, definition, changes)
        with nullcontext() if compilable else _lock:
            trajectory = scenario.run(controller=controller)
    except InputError as error:
        return failed("refused", str(error))
    except RunError as error:
        return failed("failed", str(error))
    except Exception as error:  # a fault of ours in one of 10^5 rollouts must not cost the others
        return failed("error", f"{type(error).__name__}: {error}")
    if trajectory.outcome == "interrupted":
        raise KeyboardInterrupt
    if keep is not None:
        with _lock:
            keep(index, trajectory)
    return measured(trajectory)


def _controller_of(
    scenario: Scenario, definition: Definition, changes: dict[str, Any]
) -> tuple[Controller, bool]:
    """A controller for a row's scenario, and whether its steps are compiled as a whole; if so, it is this
    thread's, and used again, as each run resets what the one before left."""
    others = {key: value for key, value in changes.items() if key.split(".")[0] not in scenario.keys_of_a_run}
    key = definition.digest, json.dumps(others, default=str)
    if not hasattr(_own, "controllers"):
        _own.controllers = OrderedDict()
    if key in _own.controllers:
        return _cached(_own.controllers, key), True
    with _lock:
        controller = scenario.controller()
    if not wholly_compiled(controller):
        return controller, False
    return _cached(_own.controllers, key, controller), True


def wholly_compiled(controller: Controller) -> bool:
    """Whether a run needs no Python, from its first sample to its last."""
    return controller.schedule is None and controller.solver.compiles_steps


def scenario_of(definition: Definition, changes: dict[str, Any]) -> Scenario:
    """The scenario with a row's settings; its robot is loaded once for each way in which it changes."""
    of_robot = {key: value for key, value in changes.items() if key.split(".")[0] == "robot"}
    rest = {key: value for key, value in changes.items() if key not in of_robot}
    key = definition.digest, json.dumps(of_robot, default=str)
    if key in _robots:
        return _cached(_robots, key).with_settings(rest)
    scenario = Scenario(definition.document).with_settings(of_robot)
    scenario.robot()
    return _cached(_robots, key, scenario).with_settings(rest)


def _cached(cache: OrderedDict[Key, Value], key: Key, new: Value | None = None) -> Value:
    """The entry of a key, or the new one, which is stored; the least recently used entry is dropped."""
    if new is not None:
        cache[key] = new
        if len(cache) > MOST_KEPT:
            cache.popitem(last=False)
    cache.move_to_end(key)
    return cache[key]


class Computed(NamedTuple):
    """The rows of a chunk, and the files of the run folders kept, by row and name."""

    rows: list[dict[str, Any]]
    runs: dict[int, dict[str, bytes]]


def computed(
    chunk: int, progress: Progress | None, definition: Definition, threads: int = 1, trust: bool = False
) -> Computed:
    """Chunk number `chunk` of a sweep, whose robots' files may be trusted; `RunError` where this process has
    another version of nmm."""
    if definition.version != __version__:
        raise RunError(
            f"a worker has nmm {__version__}, and the sweep is of nmm {definition.version}: expected the same"
        )
    runs: dict[int, dict[str, bytes]] = {}

    def keep(index: int, trajectory: Trajectory) -> None:
        with tempfile.TemporaryDirectory() as folder:
            html = definition.keep == "playback"
            saved = trajectory.save(Path(folder) / "run", figures=False, html=html)
            runs[index] = {path.name: path.read_bytes() for path in saved.iterdir()}

    keeper = keep if definition.keep else None
    rows = rows_of(definition, definition.indices(chunk), keeper, progress, threads, trust)
    return Computed(rows, runs)
