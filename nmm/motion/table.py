"""A run in a few lines, for people: what `nmm run` and `nmm compare` print and a page tells."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.base.errors import RunError
from nmm.base.findings.run import MOTORS
from nmm.base.text_format import apart
from nmm.control.step.quantities import placed

if TYPE_CHECKING:
    from nmm.control.controller import Controller
    from nmm.motion.trajectory import Trajectory

STEPS = 500


def summary_rows(
    trajectory: Trajectory, numbers: Mapping[str, Any], *, events: bool = True
) -> Iterator[tuple[str, str]]:
    """Labels and values of a run's summary for tables and pages; `events`: also of tasks' starts and ends."""
    yield "resolver", f"{trajectory.called}, {trajectory.method}, dt {trajectory.dt:g} s"
    outcome = str(trajectory.outcome)
    if len(trajectory):
        outcome += f", {trajectory.t[-1]:g} s in {len(trajectory)} samples"
    yield "outcome", outcome
    if trajectory.resolver == "plan" and trajectory.robot.platform.n_p:
        x, y, theta = np.diff(trajectory.q[:, :3], axis=0).T
        yield "way", f"{np.hypot(x, y).sum():.3g} m, with turns of {np.abs(theta).sum():.3g} rad"
    redundancy = numbers["redundancy"]
    left = max(redundancy["kinematic"], 0) or "none left"
    yield "redundancy", f"kinematic {left}, static {max(redundancy['static'], 0)}"
    if not len(trajectory):
        return
    for row, (name, unit) in enumerate(zip(trajectory.r_names, trajectory.r_units, strict=True)):
        seen = trajectory.error[:, row]
        seen = seen[~np.isnan(seen)]
        yield f"error of {name}", f"{seen[0]:.3g} → {seen[-1]:.3g} {unit}" if len(seen) else "never active"
    for event in trajectory.events if events else ():
        yield f"t = {event.t:.4g} s", f"{event.task} {event.what}{f': {event.why}' if event.why else ''}"
    yield "tracking ‖e‖", f"RMS {numbers['error_rms']:.3g}, {numbers['error_max']:.3g} at most"
    if (settles := numbers["settling_time"]) is not None:
        yield "‖e‖ down to 2 % of its start", f"after {settles:.3g} s"
    if (trajectory.scenario or {}).get("objective"):
        yield "objective H", f"{trajectory.objective[0]:.4g} → {trajectory.objective[-1]:.4g}"
        yield "mean H, second half", f"{numbers['objective_mean_second_half']:.4g}"
        yield "∫ H dt", f"{numbers['objective_integral']:.4g}"
    yield "inputs ‖u‖", f"RMS {numbers['input_rms']:.3g}, {numbers['input_peak']:.3g} at most"
    yield "peak inputs", _peaks(trajectory, numbers["u_max"])
    yield "smallest σ_min", f"{numbers['sigma_min']:.3g}"
    if (unmet := trajectory.unmet).samples:
        share = f"{unmet.samples} of {len(trajectory)} samples"
        yield "J u differs from the rate", f"in {share}, by {unmet.largest:.3g} at most"
    for quantity in placed():
        if quantity.line is not None and not np.all(trajectory[quantity.name] == quantity.fill):
            yield quantity.line[0], quantity.line[1].format_map(numbers)
    if trajectory.limited:
        share = numbers["scaled_share"]
        least = f"{numbers['scale_min']:.3g} at least; below 1 {100 * share:.3g} % of the time"
        yield "λ under limits", least if share else "1 throughout"
    if free := numbers["without_velocity_limit"]:
        groups = [name for name, inputs in trajectory.robot.groups.items() if not {*free}.isdisjoint(inputs)]
        keys = ", ".join(f"limits.velocity.{name}" for name in groups)
        yield "no velocity limit for", f"{', '.join(free)} (give {keys})"
    if numbers["margin_min"] is not None:
        margin = round(100 * numbers["margin_min"], 9) + 0.0  # neither rounding, nor -0, is a limit broken
        name = numbers.get("margin_of", "")
        what = f"input {name[2:]}" if name.startswith("u_") else name
        yield "least margin to a limit", f"{margin:.3g} % of its range{f' ({what})' if what else ''}"
    if fast := numbers.get("fast_wheels"):
        own = {wheel.joint: wheel.velocity for wheel in trajectory.robot.wheels}
        rates = [
            "{} {} rad/s (at most {})".format(name, *apart(rate, own[name], digits=3))
            for name, rate in fast.items()
        ]
        yield "wheels beyond their limits", ", ".join(rates)
    motors = [finding for finding in numbers["findings"] if finding["line"] == MOTORS]
    if over := [finding["values"] for finding in motors if finding["code"] == "effort_exceeded"]:
        efforts = [
            "{0} {2} {1} (at most {3})".format(
                finding["actuator"], finding["unit"], *apart(finding["peak"], finding["effort"], digits=3)
            )
            for finding in over
        ]
        yield "motors beyond their limits", ", ".join(efforts)
    yield from (("balance", finding["text"]) for finding in motors if finding["code"] == "tips")
    if still := numbers.get("standing_at_limits"):
        yield "at a limit throughout", f"{', '.join(still)}; not counted above"
    if numbers.get("clearance_min") is not None:
        yield (
            "least clearance",
            f"{numbers['clearance_min']:.4g} m ({numbers['clearance_min_pair']}) "
            f"at t = {numbers['clearance_min_t']:.3g} s",
        )
    if trajectory.resolver == "rg":
        yield "switches of partition", str(numbers["partition_switches"])
    yield "lateral slip", f"{numbers['lateral_slip_max']:.1g} m/s at most"
    if numbers.get("sliding_max"):
        yield "wheels slide by design", f"{numbers['sliding_max']:.3g} m/s at most"


def _peaks(trajectory: Trajectory, largest: Mapping[str, float]) -> str:
    units = dict(zip(trajectory.robot.u_names, trajectory.robot.u_units, strict=True))
    names = [
        max((name for name in units if units[name] == unit), key=largest.__getitem__)
        for unit in dict.fromkeys(units.values())
    ]
    return ", ".join(f"{name} {largest[name]:.3g} {units[name]}" for name in names)


def step_time(controller: Controller, trajectory: Trajectory) -> float:
    """Median time of a control step, s, in back-to-back calls at a run's samples; 0 if none succeeds.
    `controller` is like the run's, with its dt; its state is reset."""
    times = []
    controller.reset()
    for t, q in zip(trajectory.t[:STEPS].tolist(), trajectory.q[:STEPS], strict=True):
        begun = perf_counter()
        try:
            controller(t, q)
        except RunError:
            break
        times.append(perf_counter() - begun)
    controller.reset()
    return float(np.median(times)) if times else 0.0
