"""The numbers of runs in a table: those of their summaries, with units."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.base.errors import expect
from nmm.base.latex import escaped
from nmm.control.step.quantities import named_numbers
from nmm.motion.diagnosis.summary import RUN_NUMBERS
from nmm.views.tables.table import Quantity, Table, Value

if TYPE_CHECKING:
    from nmm.analysis.null_space.laps import Repeatability
    from nmm.motion.trajectory import Trajectory

#: Those of the summary's numbers that come first, in this order.
_FIRST = (
    "t_end", "error_rms", "error_max", "error_final", "settling_time", "objective_initial", "objective_final",
    "objective_mean_second_half", "objective_integral", "input_rms", "input_peak", "u_max", "sigma_min",
    "scale_min", "scaled_share", "margin_min", "clearance_min", "partition_switches", "lateral_slip_max",
    "sliding_max",
)  # fmt: skip
#: Which runs have a number, where some have none;
_OF: dict[str, Callable[[Trajectory], bool]] = {
    **dict.fromkeys(("scale_min", "scaled_share"), lambda run: run.limited),
    "partition_switches": lambda run: run.resolver == "rg",
}
#: values of a run in which nothing of the quantity happened;
_NOTHING: dict[str, Value] = {"partition_switches": 0, "scaled_share": 0.0, "lateral_slip_max": 0.0}
#: and values that are worth no row.
_USUAL: dict[str, Value] = {"outcome": "completed", "sliding_max": 0.0}


def comparison_table(trajectories: Sequence[Trajectory]) -> Table:
    """The numbers of runs side by side, as their summaries have them.

    Rows that say nothing are left out: outcomes where all completed, the objective without one, limits where
    none were kept. The time of a control step, which `nmm compare` measures, is not a number of a run.

    Parameters
    ----------
    trajectories : the runs, a column each; `Trajectory.called` heads it

    Raises
    ------
    InputError : no runs

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 1})
    >>> table = nmm.comparison_table([scenario.with_resolver(kind).run() for kind in ("rg", "pg")])
    >>> print(table.markdown().splitlines()[0])
    |  | RG | PG |
    """
    expect(trajectories, "comparison_table", "at least one run")
    summaries = [trajectory.summary() for trajectory in trajectories]
    quantities = []
    for key, name, unit, latex in _rows(trajectories):
        outer, _, inner = key.partition(".")
        entries = [
            summary.get(outer) if not inner else summary.get(outer, {}).get(inner) for summary in summaries
        ]
        has = [_OF[key](run) if key in _OF else True for run in trajectories]
        values = tuple(value if known else None for value, known in zip(entries, has, strict=True))
        if any(value not in (None, _USUAL.get(key)) for value in values):
            quantities.append(Quantity(key, name, latex, unit, values, _NOTHING.get(key)))
    return Table(tuple(trajectory.called for trajectory in trajectories), tuple(quantities))


def laps_table(found: Repeatability) -> Table:
    """What `nmm laps` finds, a column a resolver: drift, displacement and error after each lap.

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> found = nmm.analysis.repeatability(scenario, laps=1, resolvers=["pg"])
    >>> [quantity.name for quantity in nmm.laps_table(found).quantities]
    ['posture drift, lap 1', 'platform displacement, lap 1', 'task error, lap 1']
    """
    rows = max((len(run.distance) for run in found.laps), default=0)
    names = dict.fromkeys(name for run in found.laps for name in run.trajectory.r_units)

    def after(lap: int, numbers: Callable[[Any], Any]) -> tuple[Value, ...]:
        return tuple(float(numbers(run)[lap]) if lap < len(numbers(run)) else None for run in found.laps)

    quantities = []
    for k in range(rows):
        for key, name, unit, numbers in (
            ("distance", "posture drift", "m, rad", lambda run: run.distance),
            ("displacement", "platform displacement", "m", lambda run: run.displacement),
            ("errors", "task error", ", ".join(names), lambda run: run.errors[1:]),
        ):
            text = f"{name}, lap {k + 1}"
            quantities.append(Quantity(f"{key}.{k + 1}", text, text, unit, after(k, numbers)))
    last = "last drift over that before"
    factors = Quantity("factor", last, last, "", tuple(run.factor for run in found.laps))
    if any(factor is not None for factor in factors.values):
        quantities.append(factors)
    return Table(tuple(run.name.upper() for run in found.laps), tuple(quantities))


def _rows(runs: Sequence[Trajectory]) -> Iterator[tuple[str, str, str, str]]:
    units = {"rows": _units(run.r_units for run in runs), "inputs": _units(run.robot.u_units for run in runs)}
    objective = any((run.scenario or {}).get("objective") or np.any(run.objective) for run in runs)
    inputs = {
        name: unit for run in runs for name, unit in zip(run.robot.u_names, run.robot.u_units, strict=True)
    }
    yield "outcome", "outcome", "", "outcome"
    yield "dt", "step", "s", "step"
    named = [*named_numbers(), *((number.unit, number) for number in RUN_NUMBERS if number.name)]
    by_key = {number.key: (unit, number) for unit, number in named}
    for key in dict.fromkeys((*_FIRST, *by_key)):
        unit, number = by_key[key]
        if key == "u_max":
            for u_name, own in inputs.items():
                yield f"{key}.{u_name}", number.name.format(u_name), own, number.latex.format(_size(u_name))
        elif objective or not key.startswith("objective_"):
            yield key, number.name, units.get(unit, unit), number.latex or number.name


def _units(listed: Any) -> str:
    return ", ".join(dict.fromkeys(unit for units in listed for unit in units))


def _size(name: str) -> str:
    """An input's magnitude in LaTeX: a joint's is its rate; a single letter and ω are symbols."""
    if joint := re.fullmatch(r"q(\d*)", name):
        return rf"$|\dot q{f'_{{{joint[1]}}}' if joint[1] else ''}|$"
    symbol = r"\omega" if name == "omega" else name
    return f"$|{symbol}|$" if symbol != name or len(name) == 1 else f"$|${escaped(name)}$|$"
