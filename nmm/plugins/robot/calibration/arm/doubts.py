"""What is doubtful in a calibration of an arm, as findings."""

from __future__ import annotations

import numpy as np

from nmm.base.findings import Finding
from nmm.base.text_format import listed
from nmm.plugins.robot.calibration.arm.fit import ArmFit
from nmm.plugins.robot.calibration.arm.judged import ArmHeldOut, moved_base
from nmm.plugins.robot.calibration.arm.misfits import misfits
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.view import some_of
from nmm.plugins.robot.calibration.judged import CHANCE

#: A number so many times as far from the file's as is plausible is told.
FAR = 3.0
#: A joint that moved less, rad or m, hardly did.
LITTLE = 0.2


def doubts(
    model: ArmModel, fitted: ArmFit, predicted: ArmHeldOut | None, white: float
) -> tuple[Finding, ...]:
    """All of them."""
    names = [number.name for number in model.learned]
    stated = model.stated(fitted.values)
    result = []
    if fitted.signs:
        result.append(Finding("joints_count_back", {"names": fitted.signs}))
    for i, number in enumerate(model.learned):
        robots = number.role not in ("mount", "frame")
        if robots and abs(stated[i] - number.value) > FAR * number.plausible:
            values = {"name": number.name, "value": float(stated[i]), "unit": number.unit}
            result.append(Finding("arm_far_from_file", values | {"before": number.value}))
    unseen: dict[str, list[str]] = {}
    still = _still(model)
    for i in fitted.unseen:
        unseen.setdefault(still or model.learned[i].shown_by, []).append(names[i])
    result += [Finding("not_seen", {"names": some, "motion": motion}) for motion, some in unseen.items()]
    result += _left_out(model)
    if moved := moved_base(model, fitted):
        view, k = moved
        result.append(Finding("base_seems_moved", {"log": view.log.name, "sample": k}))
    if white < CHANCE:
        result.append(Finding("arm_not_white", {"p": white}))
    own = [i for i in fitted.free if model.learned[i].role != "mount"]
    if predicted is None and own:
        result.append(Finding("arm_no_held_out"))
    elif predicted is not None and not (predicted.closer and predicted.p < 0.05):
        values = {name: x for name, x in predicted._asdict().items() if name not in ("closer",)}
        result.append(Finding("arm_not_better", values | {"verdict": predicted.verdict}))
    result += misfits(model, fitted, predicted)
    return tuple(result)


def _still(model: ArmModel) -> str:
    """The motion that joints lack which hardly moved; "" where all did."""
    went: dict[str, float] = {}
    for view in model.views:
        for name, way in zip(
            view.chain.names(view.chain.coordinates), np.ptp(view.readings, axis=0), strict=True
        ):
            went[name] = max(went.get(name, 0.0), float(way))
    few = [name for name, way in went.items() if way < LITTLE]
    return f"move {listed(few)} by more" if few else ""


def _left_out(model: ArmModel) -> list[Finding]:
    result = []
    for view in model.views:
        visible, taken = view.log.visible, view.taken
        whole = some_of(visible) & ~some_of(taken)
        if whole.any():
            values = {"log": view.log.name, "count": int(whole.sum()), "all": int(some_of(visible).sum())}
            result.append(Finding("samples_left_out", values | {"sample": int(np.argmax(whole))}))
        lost = visible & ~taken
        if lost.ndim == 2 and (corners := lost & ~whole[:, np.newaxis]).any():
            values = {"log": view.log.name, "count": int(corners.sum()), "all": int(visible.sum())}
            result.append(Finding("corners_left_out", values | {"sample": int(np.argmax(some_of(corners)))}))
    return result
