"""Rows of a sweep by their numbers: each a rollout of the scenario with its settings. Whatever computes many
rollouts at once takes the place of `rows_of`, and of nothing else.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Callable, Sequence
from threading import RLock
from typing import TYPE_CHECKING, Any

from nmm.errors import InputError, RunError
from nmm.progress import Progress
from nmm.scenario import Scenario
from nmm.sweeps.columns import failed, measured
from nmm.sweeps.definition import Definition

if TYPE_CHECKING:
    from nmm.runs.trajectory import Trajectory

#: So many scenarios with their robots are kept in a process, those last used.
MOST_ROBOTS = 16
#: A worker of a cluster may have several threads; a robot, and Python, have time for one.
_lock = RLock()
_robots: OrderedDict[tuple[str, str], Scenario] = OrderedDict()

Keep = Callable[[int, "Trajectory"], None]


def rows_of(
    definition: Definition, indices: Sequence[int], keep: Keep | None = None, progress: Progress | None = None
) -> list[dict[str, Any]]:
    """The rows of these numbers, in their order: cells by column (`columns.columns_of`).

    A rollout that fails is a row that says why: `outcome` "refused" is one whose settings are no input (a
    start outside limits), "error" one that raised what it should not have. A cell that is not known is None.

    Parameters
    ----------
    keep : called with each row's number and trajectory, where there is one
    progress : called with the fraction done after each row

    Raises
    ------
    KeyboardInterrupt : a rollout was interrupted; rows are whole or not there
    """
    told = definition.parameters(indices)
    rows = []
    for k, (index, changes) in enumerate(zip(indices, definition.changes(indices), strict=True)):
        with _lock:
            found = _rollout(definition, index, changes, keep)
        rows.append({"index": index, **told[k], **found})
        if progress is not None:
            progress((k + 1) / len(indices))
    return rows


def _rollout(
    definition: Definition, index: int, changes: dict[str, Any], keep: Keep | None
) -> dict[str, Any]:
    try:
        trajectory = scenario_of(definition, changes).run()
    except InputError as error:
        return failed("refused", str(error))
    except RunError as error:
        return failed("failed", str(error))
    except Exception as error:  # a fault of ours in one of 10^5 rollouts must not cost the others
        return failed("error", f"{type(error).__name__}: {error}")
    if trajectory.outcome == "interrupted":
        raise KeyboardInterrupt
    if keep is not None:
        keep(index, trajectory)
    return measured(trajectory)


def scenario_of(definition: Definition, changes: dict[str, Any]) -> Scenario:
    """The scenario with a row's settings; its robot is loaded once for each way in which it changes.

    Raises
    ------
    ScenarioError : the settings are none, or do not fit together
    """
    of_robot = {key: value for key, value in changes.items() if key.split(".")[0] == "robot"}
    rest = {key: value for key, value in changes.items() if key not in of_robot}
    key = definition.digest, json.dumps(of_robot, default=str)
    if key not in _robots:
        scenario = Scenario(definition.document).with_settings(of_robot)
        scenario.robot()
        _robots[key] = scenario
        if len(_robots) > MOST_ROBOTS:
            _robots.popitem(last=False)
    _robots.move_to_end(key)
    return _robots[key].with_settings(rest)
