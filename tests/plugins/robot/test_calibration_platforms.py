"""Numbers come back of every kind of platform whose wheels are counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from helpers.ackermann_car import car as ackermann
from helpers.simulated_drives import drive, every_way, steered, tractor, two_wheels
from helpers.urdf_parts import joint, link
from helpers.urdf_parts import robot as urdf

import nmm

Array = np.ndarray
MOUNT = {"reference.x": 0.2, "reference.y": 0.05, "reference.yaw": 0.1, "delay": 0.03, "clock": 0.0}
ACKERMANN, TRICYCLE = "ackermann", "tricycle"
#: Where the reference is has to be held where the platform's own centre is learned: they are not told apart.
HELD = {"skid_steer": {"reference.x": 0.2, "reference.y": 0.05}}


def tricycle() -> str:
    """A base on two wheels, and one ahead that steers and rolls."""
    limits = '<limit effort="1" velocity="15"/>'
    parts = [link("base")]
    for side, y in (("left", 0.25), ("right", -0.25)):
        own = f'<axis xyz="0 1 0"/>{limits}'
        parts += [joint(f"{side}_wheel_joint", "base", side, "continuous", own, f'<origin xyz="0 {y} 0.1"/>')]
        parts += [link(side)]
    turns = '<axis xyz="0 0 1"/><limit effort="1" lower="-1" upper="1" velocity="3"/>'
    parts += [joint("steering", "base", "fork", "revolute", turns, '<origin xyz="0.8 0 0.1"/>'), link("fork")]
    rolls = f'<axis xyz="0 1 0"/>{limits}'
    parts += [joint("front_wheel_joint", "fork", "front", "continuous", rolls, ""), link("front")]
    return urdf(*parts, attributes='name="tricycle"')


#: By base and platform, the numbers that it truly has, and its inputs.
PLATFORMS: dict[tuple[str, str | None], tuple[dict[str, float], Callable[[Array], Array]]] = {
    ("omni_base", "skid_steer"): (
        {"left": 0.45, "right": -0.41, "ahead": 0.04, "radius.rear_left_wheel_joint": 0.098}, two_wheels
    ),
    ("omni_base", "mecanum"): (
        {"half_length_plus_width": 0.46, "radius.rear_right_wheel_joint": 0.103}, every_way
    ),
    (ACKERMANN, None): (
        {"wheelbase": 0.73, "track": 0.52, "offset.steer": 0.02, "ratio.steer": 0.97}, steered
    ),
    ("car_base", "front_drive_car"): ({"wheelbase": 0.66, "offset.steering": -0.03}, steered),
    (TRICYCLE, "wheeled"): (
        {"wheelbase": 0.84, "track": 0.52, "offset.steering": 0.03, "ratio.steering": 1.03}, steered
    ),
    ("differential_base", "wheeled"): ({"track": 0.53, "radius.left_wheel_joint": 0.102}, tractor),
    ("trailer_base", "wheeled"): ({"track": 0.46, "hitch.hitch1": 0.27, "length.hitch1": 0.66}, tractor),
}  # fmt: skip


@pytest.mark.parametrize(("base", "platform"), PLATFORMS)
def test_numbers_of_a_platform_come_back(base: str, platform: str | None, tmp_path: Path) -> None:
    """Off by no more than their deviations say (4.5 of them), which are small, and nearer than the file."""
    truth, inputs = PLATFORMS[base, platform]
    if base in (ACKERMANN, TRICYCLE):
        file = tmp_path / f"{base}.urdf"
        file.write_text(ackermann() if base == ACKERMANN else tricycle(), "utf-8")
        base = str(file)
    robot = nmm.load(base, platform=platform)
    log = drive(robot, truth, inputs=inputs, seconds=60.0, looks=5.0)
    found = nmm.calibrate(robot, log, hold=HELD.get(platform or "", {}))
    known = {name: number.value for name, number in nmm.robot_numbers(robot).items()} | MOUNT | truth
    off = {
        name: (found.numbers[name].after - known[name]) / found.numbers[name].deviation
        for name in found.learned
    }
    assert {*truth} <= {*found.learned}
    assert max(map(abs, off.values())) < 4.5, off
    for name, true in truth.items():
        number = found.numbers[name]
        assert abs(number.after - true) < 0.5 * abs(number.before - true), name
        assert number.deviation < 0.03, name
    assert found.held_out is not None
    assert found.held_out.verdict in ("better", "no difference")
    assert found.held_out.share < 0.1
