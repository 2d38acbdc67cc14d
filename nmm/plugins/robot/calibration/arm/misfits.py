"""What does not fit in a calibration of an arm although least squares are found, as findings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.model.robots.origins import ORIGIN, PARTS
from nmm.plugins.robot.calibration.arm.fit import ArmFit
from nmm.plugins.robot.calibration.arm.judged import ArmHeldOut
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.residuals import PIXEL, PLACE, TURN
from nmm.plugins.robot.calibration.arm.view import some_of

#: Noise of what sees is no more than this: of a tracker m and rad, of a camera px.
NOISY = {PLACE: (2e-3, "m"), TURN: (0.01, "rad"), PIXEL: (1.0, "px")}
#: Of what was seen, and not computed from the joints' own readings, more than this is left, m.
EXACT = 1e-6
#: Noise of one log is no more than so many times that of another log of its kind.
APART = 5.0
#: Where such a share of what was seen is left out, it is not of this arm.
MANY = 0.2
#: Lengths of arms are so far off, m, whatever their scale; one scale explains such a share of what was
#: learned, and is so many deviations from 1.
LENGTHS, EXPLAINED, SURE = 1e-3, 0.8, 3.0


def misfits(model: ArmModel, fitted: ArmFit, predicted: ArmHeldOut | None) -> list[Finding]:
    """All of them."""
    findings = [*_noisy(model, fitted), *_many_left_out(model)]
    scale = scaled(model, fitted)
    if scale is not None and scale.explained > EXPLAINED and abs(scale.more) > SURE * scale.deviation:
        longer = "longer" if scale.more > 0.0 else "shorter"
        findings.append(Finding("arm_scaled", {"percent": 100.0 * abs(scale.more), "longer": longer}))
    if predicted is not None and predicted.changed:
        values = {"samples": predicted.samples, "lost": predicted.lost, "times": predicted.times}
        findings.append(Finding("arm_changed", values))
    return findings


def _noisy(model: ArmModel, fitted: ArmFit) -> list[Finding]:
    findings = []
    names = [view.log.name for view in model.views]
    for g, (i, kind) in enumerate(model.groups):
        most, unit = NOISY[kind]
        noise = float(fitted.noise[g])
        if kind == PLACE and noise < EXACT:
            findings.append(Finding("arm_exact", {"log": names[i], "noise": noise}))
        if noise > most:
            findings.append(Finding("arm_noisy", {"log": names[i], "noise": noise, "unit": unit}))
            continue
        same = [h for h, (_, other) in enumerate(model.groups) if other == kind]
        least = min(same, key=lambda h: float(fitted.noise[h]))
        if noise > APART * fitted.noise[least]:
            values = {"log": names[i], "noise": noise, "unit": unit, "least": float(fitted.noise[least])}
            findings.append(Finding("arm_noise_apart", values | {"other": names[model.groups[least][0]]}))
    return findings


def _many_left_out(model: ArmModel) -> list[Finding]:
    findings = []
    for view in model.views:
        share = 1.0 - float(view.taken.sum()) / max(float(view.log.visible.sum()), 1.0)
        whole = 1.0 - float(some_of(view.taken).mean())
        if max(share, whole) > MANY:
            values = {"log": view.log.name, "percent": 100.0 * max(share, whole)}
            findings.append(Finding("many_left_out", values))
    return findings


class Scale(NamedTuple):
    """How much longer all lengths of an arm are than before, as a share, its deviation, and which share of
    what was learned of the joints' places it explains."""

    more: float
    deviation: float
    explained: float


def scaled(model: ArmModel, fitted: ArmFit) -> Scale | None:
    """The scale that is nearest to the joints' places that were learned; None with fewer than four."""
    places = [
        i
        for i in fitted.free
        if model.learned[i].role == "place" and model.learned[i].name.startswith(ORIGIN)
    ]
    if len(places) < 4:
        return None
    lengths = np.zeros(len(model.first))
    for view in model.views:
        for joint in view.chain.arm:
            along = view.chain.length(joint)
            for part, x in zip(PARTS[:3], along, strict=True):
                i = model.index(f"{ORIGIN}{view.chain.model.names[joint]}.{part}")
                if i >= 0:
                    lengths[i] = x + model.first[i]
    moved = np.flatnonzero(lengths)
    own, all_lengths = (model.rows(fitted.values, some) for some in (fitted.free, moved.tolist()))
    W, by_scale = own.J / fitted.noise[own.group][:, np.newaxis], all_lengths.J @ lengths[moved]
    by_scale, sizes = by_scale / fitted.noise[own.group], model.scales[fitted.free]
    # What the numbers that were learned do for a scale of all of them.
    way = sizes * np.linalg.lstsq(W * sizes, by_scale, rcond=1e-9)[0]
    some = [fitted.free.index(i) for i in places]
    way = way[some]
    change: Array = (fitted.values - model.first)[places]
    weight = np.linalg.inv(fitted.covariance[np.ix_(some, some)] + LENGTHS**2 * np.eye(len(some)))
    known = float(way @ weight @ way)
    if known <= 0.0:
        return None
    more = float(way @ weight @ change) / known
    total, left = (float(off @ weight @ off) for off in (change, change - more * way))
    spread = max(1.0, left / (len(some) - 1))
    return Scale(more, float(np.sqrt(spread / known)), 1.0 - left / max(total, 1e-300))
