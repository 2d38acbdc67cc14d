"""What is doubtful in a calibration, as findings."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from nmm.base.findings import Finding
from nmm.plugins.robot.calibration.clocks import shows_no_clock
from nmm.plugins.robot.calibration.fit import Fit
from nmm.plugins.robot.calibration.innovations import BEGINS, LEFT_OUT
from nmm.plugins.robot.calibration.judged import CHANCE, HeldOut
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.parameters import CLOCK

#: A number that is so many times as far from the file's as is plausible.
FAR = 2.0
#: Wheels that are all off by a smaller share are not asked whether it is a clock.
UNLIKE = 0.02
#: A clock that runs apart by less over the drive, s, is none that does.
APART = 0.005


def of_numbers(model: Model, fitted: Fit) -> list[Finding]:
    far = [
        Finding(
            "far_from_file",
            {"name": number.name, "value": float(value), "before": number.value, "unit": number.unit},
        )
        for number, value, scale in zip(model.learned, fitted.values, model.scales, strict=True)
        if number.of_robot and abs(value - number.value) > FAR * scale
    ]
    scales = [model.learned[i].name for i in fitted.free if model.learned[i].kind == "scale"]
    if scales:
        far.append(Finding("of_the_log", {"names": scales}))
    far += _size_or_clock(model, fitted)
    return far + [
        Finding(
            "not_shown",
            {
                "name": model.learned[i].name,
                "value": float(fitted.values[i]),
                "unit": model.learned[i].unit,
                "others": [model.learned[j].name for j in others],
                "motion": model.learned[i].shown_by,
            },
        )
        for i, others in fitted.unseen.items()
        if model.learned[i].kind != CLOCK
    ]


def _size_or_clock(model: Model, fitted: Fit) -> list[Finding]:
    """Where all wheels are as much larger, or smaller, as a clock could do that the drives do not show."""
    wheels = [i for i, number in enumerate(model.learned) if number.kind in ("radius", "scale")]
    clocks = [i for i, number in enumerate(model.learned) if number.kind == CLOCK]
    if not wheels or not {*wheels} <= {*fitted.free} or not clocks or not {*clocks} <= {*fitted.unseen}:
        return []
    shares = fitted.values[wheels] / model.first[wheels]
    by = float(shares.mean()) - 1.0
    deviations = fitted.deviations[[fitted.free.index(i) for i in wheels]] / model.first[wheels]
    if not abs(by) > max(UNLIKE, 4.0 * float(deviations.max()), 2.0 * float(np.ptp(shares))):
        return []
    clock = -by / (1.0 + by)
    if not all(drive.ends or shows_no_clock(model.counters, drive, clock) for drive in model.drives):
        return []
    values = {"by": 100.0 * abs(by), "larger": by > 0.0, "clock": 100.0 * abs(clock)}
    return [Finding("size_or_clock", values)]


def of_drives(model: Model, held: Collection[int]) -> list[Finding]:
    lengths = [i for i, number in enumerate(model.learned) if number.unit == "m"]
    findings = [Finding("scale_held")] if model.closed and not any(i in held for i in lengths) else []
    for drive in model.drives:
        if drive.gaps:
            findings.append(Finding("counters_silent", {"log": drive.name, "count": drive.gaps}))
        if drive.twist:
            values = {"log": drive.name, "by": drive.twist}
            findings.append(Finding("reference_twisted", values, {"t": float(drive.at[0])}))
        if drive.every > 1:
            values = {"log": drive.name, "every": drive.every, "count": len(drive.at)}
            findings.append(Finding("looks_thinned", values))
        lost = np.flatnonzero(drive.taken == LEFT_OUT)
        if len(lost):
            values = {"log": drive.name, "count": len(lost), "all": len(drive.at)}
            findings.append(Finding("looks_left_out", values, {"t": float(drive.at[lost[0]])}))
        jumps = np.flatnonzero(drive.taken == BEGINS)[1:]
        if len(jumps) > drive.gaps:
            values = {"log": drive.name, "count": len(jumps) - drive.gaps}
            findings.append(Finding("reference_jumped", values, {"t": float(drive.at[jumps[0]])}))
    return findings


def of_rest(model: Model, fitted: Fit, predicted: HeldOut | None, white: float) -> list[Finding]:
    findings = []
    if white < CHANCE:
        findings.append(Finding("not_white", {"p": white}))
    if predicted is None:
        findings.append(Finding("no_held_out"))
    elif predicted.verdict != "better":
        values = predicted._asdict() | {"verdict": predicted.verdict}
        findings.append(Finding("not_better", values))
    for drive in model.with_looks:
        clock = model.index(f"{CLOCK}.{drive.number}" if drive.number else CLOCK)
        if clock in fitted.free:
            rate = float(fitted.values[clock])
            apart = abs(rate) * float(drive.at[-1] - drive.at[0])
            if abs(rate) > 4.0 * fitted.deviations[fitted.free.index(clock)] and apart > APART:
                values = {
                    "log": drive.name,
                    "rate": abs(rate) * 6e4,
                    "faster": rate > 0.0,
                    "apart": 1e3 * apart,
                }
                findings.append(Finding("clocks_apart", values))
    return findings
