"""Numbers that a calibration holds, as they were asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping

from nmm.base.errors import InputError, expect_known
from nmm.plugins.robot.calibration.drives import LATEST, RobotDrive
from nmm.plugins.robot.calibration.kept import Hold, holding
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.parameters import CLOCK, DELAY, MOUNT, Learned

#: A number that is held, or learned, is so many times the file's: others are in another unit.
LEAST_SHARE, MOST_SHARE = 0.3, 3.0
#: Clocks are so late, s, or run apart by such a share, at most; a reference is at most so far, m, from the
#: robot's own point.
CLOCKS, ASIDE = {DELAY: (LATEST, "s"), CLOCK: (0.01, "")}, 10.0
#: A number that is about 0 in the file is off by so many times what is plausible at most.
BESIDE = 10.0


def asked_to_hold(hold: Hold, where: str) -> dict[str, float | None]:
    """`holding`, of drives: delays and clocks within what clocks may be off."""
    asked = holding(hold, where)
    for name, value in asked.items():
        kind = name.partition(".")[0]
        if value is not None and kind in CLOCKS:
            most, unit = CLOCKS[kind]
            _expect_within(value, -most, most, unit, f"{where}: hold {name}")
    return asked


def held_numbers(model: Model, asked: Mapping[str, float | None], where: str) -> dict[int, float]:
    """Values of the numbers that are held, by their place; `InputError` for names and values that cannot
    be."""
    known: dict[str, list[int]] = {}
    for i, number in enumerate(model.learned):
        known[number.name] = [i]
        if number.kind in CLOCKS and number.name != number.kind:  # of all drives
            known[number.kind] = [*known.get(number.kind, []), i]
    held: dict[int, float] = {}
    for name in sorted(asked, key=lambda name: "." in name):
        expect_known("number", name, known, f"{where}: hold")
        for i in known[name]:
            number, value = model.learned[i], asked[name]
            if value is None:
                value = 0.0 if number.kind == DELAY else number.value
            elif number.kind not in CLOCKS:
                _expect_within(value, *_range(number), f"{where}: hold {name}")
            held[i] = value
    return held


def held_delay(asked: Mapping[str, float | None], drive: RobotDrive) -> float | None:
    """The delay of a drive's clock, s, as it is held; None for one that is learned."""
    for name in (f"{DELAY}.{drive.number}", DELAY):
        if name in asked:
            return asked[name] or 0.0
    return None


def _range(number: Learned) -> tuple[float, float, str]:
    unit = "" if number.unit == "1" else number.unit
    if number.name in MOUNT:
        most = ASIDE if number.unit == "m" else 2.0 * math.pi
        return -most, most, unit
    if number.kind in ("ahead", "offset") or number.value == 0.0:
        most = BESIDE * number.plausible
        return number.value - most, number.value + most, unit
    least, most = sorted((LEAST_SHARE * number.value, MOST_SHARE * number.value))
    return least, most, unit


def _expect_within(value: float, least: float, most: float, unit: str, where: str) -> None:
    if not least <= value <= most:
        expected = f"{least:.3g} to {most:.3g} {unit}".rstrip()
        raise InputError(where=where, expected=expected, got=value)
