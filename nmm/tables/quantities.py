"""Which numbers of runs stand in a table: those of their summaries, with units."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.errors import InputError
from nmm.latex import escaped
from nmm.tables.table import Quantity, Table, Value

if TYPE_CHECKING:
    from nmm.analysis.redundancy.laps import Repeatability
    from nmm.runs.trajectory import Trajectory

Summary = dict[str, Any]
#: What a run that was not limited says nothing of.
_LIMITED = ("scale_min", "scaled_share")
#: What a run says of which nothing happened.
_NOTHING: dict[str, Value] = {"partition_switches": 0, "scaled_share": 0.0, "lateral_slip_max": 0.0}


def comparison_table(trajectories: Sequence[Trajectory]) -> Table:
    """The numbers of runs side by side, as their summaries have them.

    Only what they differ in or what is asked for: outcomes where one did not complete, the objective where
    there is one, limits where some were kept. The time of a control step, which `nmm compare` measures, is
    not a number of a run.

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
    if not trajectories:
        raise InputError("comparison_table: expected at least one run")
    summaries = [trajectory.summary() for trajectory in trajectories]
    quantities = [
        quantity
        for key, name, latex, unit in _rows(trajectories)
        if _told(quantity := Quantity(key, name, latex, unit, _values(summaries, key), _NOTHING.get(key)))
    ]
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
    rows = max((len(one.distance) for one in found.laps), default=0)
    names = dict.fromkeys(name for one in found.laps for name in one.trajectory.r_units)

    def after(lap: int, numbers: Callable[[Any], Any]) -> tuple[Value, ...]:
        return tuple(float(numbers(one)[lap]) if lap < len(numbers(one)) else None for one in found.laps)

    quantities = []
    for k in range(rows):
        for key, name, unit, numbers in (
            ("distance", "posture drift", "m, rad", lambda one: one.distance),
            ("displacement", "platform displacement", "m", lambda one: one.displacement),
            ("errors", "task error", ", ".join(names), lambda one: one.errors[1:]),
        ):
            told = f"{name}, lap {k + 1}"
            quantities.append(Quantity(f"{key}.{k + 1}", told, told, unit, after(k, numbers)))
    last = "last drift over that before"
    factors = Quantity("factor", last, last, "", tuple(one.factor for one in found.laps))
    if any(factor is not None for factor in factors.values):
        quantities.append(factors)
    return Table(tuple(one.name.upper() for one in found.laps), tuple(quantities))


def _rows(runs: Sequence[Trajectory]) -> Iterator[tuple[str, str, str, str]]:
    """Key, name, name as LaTeX, unit."""
    error = _units(run.r_units for run in runs)
    inputs = _units(run.robot.u_units for run in runs)
    yield "outcome", "outcome", "outcome", ""
    yield "dt", "step", "step", "s"
    yield "t_end", "duration", "duration", "s"
    yield "error_rms", "‖e‖, RMS", r"$\|e\|$, RMS", error
    yield "error_max", "‖e‖, largest", r"$\|e\|$, largest", error
    yield "error_final", "‖e‖, at the end", r"$\|e\|$, at the end", error
    yield "settling_time", "‖e‖ down to 2 % after", r"$\|e\|$ down to 2\,\% after", "s"
    if any((run.scenario or {}).get("objective") or np.any(run.objective) for run in runs):
        yield "objective_initial", "H, at the start", "$H$, at the start", ""
        yield "objective_final", "H, at the end", "$H$, at the end", ""
        yield "objective_mean_second_half", "H, mean of 2nd half", "$H$, mean of 2nd half", ""
        yield "objective_integral", "∫ H dt", r"$\int H\,dt$", "s"
    yield "input_rms", "‖u‖, RMS", r"$\|u\|$, RMS", inputs
    yield "input_peak", "‖u‖, largest", r"$\|u\|$, largest", inputs
    for name, unit in {
        name: unit for run in runs for name, unit in zip(run.robot.u_names, run.robot.u_units, strict=True)
    }.items():
        yield f"u_max.{name}", f"|{name}|, largest", f"{_size(name)}, largest", unit
    yield "sigma_min", "σ_min, least", r"$\sigma_{\min}$, least", "mixed"
    if any(run.limited for run in runs):
        yield "scale_min", "λ, least", r"$\lambda$, least", ""
        yield "scaled_share", "time with λ < 1, share", r"time with $\lambda < 1$, share", ""
    yield "margin_min", "margin to limits, least (share)", "margin to limits, least (share)", ""
    yield "clearance_min", "clearance, least", "clearance, least", "m"
    if any(run.resolver == "rg" for run in runs):
        yield "partition_switches", "switches of partition", "switches of partition", ""
    yield "lateral_slip_max", "lateral slip, largest", "lateral slip, largest", "m/s"
    yield "sliding_max", "designed sliding, largest", "designed sliding, largest", "m/s"


def _values(summaries: Sequence[Summary], key: str) -> tuple[Value, ...]:
    """Of each run, None where it says nothing."""
    found: list[Value] = []
    for summary in summaries:
        outer, _, inner = key.partition(".")
        value = summary.get(outer)
        value = (value or {}).get(inner) if inner else value
        silent = (key in _LIMITED and not summary["limited"]) or (
            key == "partition_switches" and summary["resolver"] != "rg"
        )
        found.append(None if silent else value)
    return tuple(found)


def _told(quantity: Quantity) -> bool:
    """Whether a row says something: outcomes when one did not complete, wheels when they slide."""
    usual: dict[str, Value] = {"outcome": "completed", "sliding_max": 0.0}
    return any(value not in (None, usual.get(quantity.key)) for value in quantity.values)


def _units(listed: Any) -> str:
    return ", ".join(dict.fromkeys(unit for units in listed for unit in units))


def _size(name: str) -> str:
    """The size of an input in LaTeX: a joint's is its rate, a single letter and ω are symbols."""
    if joint := re.fullmatch(r"q(\d*)", name):
        return rf"$|\dot q{f'_{{{joint[1]}}}' if joint[1] else ''}|$"
    symbol = r"\omega" if name == "omega" else name
    return f"$|{symbol}|$" if symbol != name or len(name) == 1 else f"$|${escaped(name)}$|$"
