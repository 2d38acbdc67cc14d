"""Rows of a sweep by their numbers: each a rollout of the scenario with its settings.

Rows whose settings are numbers share a robot, and those that begin elsewhere a controller; several threads
take them one by one, as their integration is compiled code that does not hold the GIL.
"""

from __future__ import annotations

import gc
import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, TypeVar

from nmm.errors import InputError, RunError
from nmm.progress import Progress
from nmm.scenario import Scenario
from nmm.scenario.scenario import KEYS_OF_A_RUN
from nmm.sweeps.columns import failed, measured
from nmm.sweeps.definition import Definition

if TYPE_CHECKING:
    from nmm.control.controller import Controller
    from nmm.runs.trajectory import Trajectory

#: So many scenarios with their robots are kept in a process, and controllers in a thread, those last used.
MOST_KEPT = 16
#: What is not compiled as a whole has time for one thread: Python has, and shapes are read when asked for.
_lock = threading.RLock()
_robots: OrderedDict[tuple[str, str], Scenario] = OrderedDict()
_own = threading.local()

Keep = Callable[[int, "Trajectory"], None]
Key = TypeVar("Key")
Value = TypeVar("Value")


def rows_of(
    definition: Definition,
    indices: Sequence[int],
    keep: Keep | None = None,
    progress: Progress | None = None,
    threads: int = 1,
) -> list[dict[str, Any]]:
    """The rows of these numbers, in their order: cells by column (`columns.columns_of`).

    A rollout that fails is a row that says why: `outcome` "refused" is one whose settings are no input (a
    start outside limits), "error" one that raised what it should not have. A cell that is not known is None.
    Cells do not depend on the threads.

    Parameters
    ----------
    keep : called with each row's number and trajectory, where there is one
    progress : called with the fraction done after each row
    threads : how many, at least 1. With more of them Ctrl-C ends it when the rows under way are done

    Raises
    ------
    KeyboardInterrupt : a rollout was interrupted; rows are whole or not there
    """
    told, changes = definition.parameters(indices), definition.changes(indices)
    rows: list[dict[str, Any]] = []

    def found(k: int) -> dict[str, Any]:
        return _rollout(definition, indices[k], changes[k], keep)

    def add(cells: dict[str, Any]) -> None:
        k = len(rows)
        rows.append({"index": indices[k], **told[k], **cells})
        if progress is not None:
            progress(len(rows) / len(indices))

    with _garbage_of_its_own():
        # Of several the first one compiles alone.
        first = len(indices) if threads == 1 else min(1, len(indices))
        for k in range(first):
            add(found(k))
        if first < len(indices):
            with ThreadPoolExecutor(min(threads, len(indices) - first)) as pool:
                try:
                    for cells in pool.map(found, range(first, len(indices))):
                        add(cells)
                except BaseException:
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
    return rows


@contextmanager
def _garbage_of_its_own() -> Iterator[None]:
    """Garbage is looked for among what the block makes: among all that libraries hold takes a tenth of it."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


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
    """A controller for a row's scenario, and whether its steps are compiled as a whole.

    Such a one is this thread's, and it is used again: what a run leaves in it, the next one resets.
    """
    others = {key: value for key, value in changes.items() if key.split(".")[0] not in KEYS_OF_A_RUN}
    key = definition.digest, json.dumps(others, default=str)
    if not hasattr(_own, "controllers"):
        _own.controllers = OrderedDict()
    if key in _own.controllers:
        return _kept(_own.controllers, key), True
    with _lock:
        controller = scenario.controller()
    if not wholly_compiled(controller):
        return controller, False
    return _kept(_own.controllers, key, controller), True


def wholly_compiled(controller: Controller) -> bool:
    """Whether nothing of a run has to be done in Python, from its first sample to its last."""
    from nmm.control.sequenced import SequencedController

    return not isinstance(controller, SequencedController) and controller.compilable


def scenario_of(definition: Definition, changes: dict[str, Any]) -> Scenario:
    """The scenario with a row's settings; its robot is loaded once for each way in which it changes.

    Raises
    ------
    ScenarioError : the settings are none, or do not fit together
    """
    of_robot = {key: value for key, value in changes.items() if key.split(".")[0] == "robot"}
    rest = {key: value for key, value in changes.items() if key not in of_robot}
    key = definition.digest, json.dumps(of_robot, default=str)
    if key in _robots:
        return _kept(_robots, key).with_settings(rest)
    scenario = Scenario(definition.document).with_settings(of_robot)
    scenario.robot()
    return _kept(_robots, key, scenario).with_settings(rest)


def _kept(kept: OrderedDict[Key, Value], key: Key, new: Value | None = None) -> Value:
    """What is kept under a key, or is new there; what was used the longest ago is forgotten."""
    if new is not None:
        kept[key] = new
        if len(kept) > MOST_KEPT:
            kept.popitem(last=False)
    kept.move_to_end(key)
    return kept[key]
