"""Velocity limits of a file's wheel joints: rows on the inputs, kept in runs, told and overridden."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from thinned import thinned
from urdf_parts import joint, link, robot, write

import nmm
from nmm.cli.exit_status import status_of
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import inputs_held_by
from nmm.views.playback.rolling import Rolling

Array = np.ndarray

#: Of the bundled bases' wheels, rad/s.
FILES = 30.0


def far_away(
    base: Robot, limits: nmm.Limits | None, duration: float = 1.5, dt: float = 0.01
) -> nmm.Trajectory:
    """A run of the base with an arm to a target that asks for more than its wheels give."""
    moving = nmm.mount(base, "small_arm", at="arm_mount" if "arm_mount" in base.frames else "base")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Constant([9.0, 7.0]))
    controller = nmm.Controller(moving, task, nmm.ProjectedGradient(alpha=1.0), limits=limits, dt=dt)
    start = {"q1": 0.3, "q2": 0.5}
    if "steering" in moving.q_names:
        start["steering"] = 0.3
    return nmm.simulate(controller, start, duration, dt)


def rates(run: nmm.Trajectory) -> dict[str, Array]:
    """Rates (N,) of the wheels, rad/s, as playback turns them."""
    rolling = Rolling(run.robot)
    found = np.array([rolling.rates(q, u) for q, u in zip(run.q, run.u, strict=True)])
    return dict(zip(rolling.joints, found.T, strict=True))


CASES = [
    ("differential_base", None),
    ("differential_base", "unicycle"),
    ("differential_base", "wheeled"),
    ("car_base", None),
    ("car_base", "front_drive_car"),
    ("trailer_base", None),
    ("omni_base", None),
]


@pytest.mark.parametrize(
    ("name", "platform"), thinned(CASES, lambda case: case[1] in (None, "unicycle") and case != CASES[0])
)
def test_a_run_keeps_the_wheels_limits(name: str, platform: str | None) -> None:
    base = nmm.load(name, platform=platform)
    assert {wheel.velocity for wheel in base.wheels} == {FILES}
    run = far_away(base, nmm.Limits())
    kept = [wheel.joint for wheel in base.wheels if wheel.joint in run.limit_names]
    assert len(kept) >= 2
    turned = rates(run)
    assert max(np.abs(turned[name]).max() for name in kept) == pytest.approx(FILES, abs=1e-8)
    assert run.scale.min() < 1.0
    assert run.summary()["without_velocity_limit"] == []
    for limits in (nmm.Limits(velocity=False, position=False), None):
        run = far_away(base, limits, 0.1, 0.001)
        largest = {name: np.abs(turned).max() for name, turned in rates(run).items() if name in kept}
        assert max(largest.values()) > FILES
        above = {name: rate for name, rate in largest.items() if rate > FILES}
        assert run.summary()["fast_wheels"] == pytest.approx(above, rel=1e-9)
    assert far_away(base, nmm.Limits(), 0.1).summary()["fast_wheels"] == {}


def test_a_run_without_limits_says_which_wheels_are_too_fast(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["unicycle_2r_position", "--out", str(tmp_path / "o"), "--set", "duration=0.2", "--set"]
    assert status_of(["run", *given, "task.0.gain=8"]) == 0
    (said,) = [line for line in capsys.readouterr().out.splitlines() if "wheels beyond" in line]
    assert "left_wheel_joint" in said
    assert f"rad/s (at most {FILES:g})" in said
    assert status_of(["run", *given, "task.0.gain=0.1"]) == 0
    assert "wheels beyond" not in capsys.readouterr().out


def differential(tmp_path: Path, limit: str) -> Path:
    """Two driven wheels of 0.1 m, 0.5 m apart, under a limit, and an arm mount."""
    parts = [link("base")]
    for side, y in (("left", 0.25), ("right", -0.25)):
        body = f'<axis xyz="0 1 0"/>{limit}'
        origin = f'<origin xyz="0 {y} 0.1"/>'
        parts += [
            joint(f"{side}_wheel", "base", f"{side}_tyre", "continuous", body, origin),
            link(f"{side}_tyre"),
        ]
    return write(tmp_path / "base.urdf", robot(*parts))


def test_fifteen_radians_a_second(tmp_path: Path) -> None:
    path = differential(tmp_path, '<limit effort="1" velocity="15"/>')
    run = far_away(nmm.load(path, platform="differential"), nmm.Limits())
    assert np.abs(run.u[:, :2]).max() == pytest.approx(15.0, abs=1e-9)


@pytest.mark.parametrize("limit", ["", '<limit effort="1" velocity="0"/>'])
def test_no_limit_is_none(tmp_path: Path, limit: str) -> None:
    loaded = nmm.load(differential(tmp_path, limit), platform="differential")
    assert [wheel.velocity for wheel in loaded.wheels] == [math.inf, math.inf]
    assert nmm.Limits().on(loaded).rows == ()


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        (nmm.Limits(), {"left_wheel": 15.0, "right_wheel": 15.0}),
        (nmm.Limits(wheels=20.0), {"left_wheel": 20.0, "right_wheel": 20.0}),
        (nmm.Limits(wheels={"left_wheel": 20.0}), {"left_wheel": 20.0, "right_wheel": 15.0}),
        (nmm.Limits(velocity={"omega_left": 3.0}), {"left_wheel": 15.0, "right_wheel": 15.0}),
        (nmm.Limits(velocity=False), {}),
        (nmm.Limits(velocity=False, wheels={"left_wheel": 20.0}), {"left_wheel": 20.0}),
    ],
)
def test_what_is_said_is_in_place_of_the_files(
    tmp_path: Path, limits: nmm.Limits, expected: dict[str, float]
) -> None:
    loaded = nmm.load(differential(tmp_path, '<limit effort="1" velocity="15"/>'), platform="differential")
    kept = limits.on(loaded).row_limits
    assert {row.name: row.upper for row in kept} == expected
    assert all(row.lower == -row.upper for row in kept)


@pytest.mark.parametrize(
    ("wheels", "held"),
    [
        ({"left": 0.25, "right": -0.25}, ["v", "omega"]),
        ({"left": 0.25}, []),
        ({"middle": 0.0}, ["v"]),
        ({}, []),
    ],
)
def test_which_inputs_wheels_bound(tmp_path: Path, wheels: dict[str, float], held: list[str]) -> None:
    """One wheel beside the middle bounds neither v nor omega, but their sum at it; a middle one v."""
    parts = [link("base")]
    for side, y in wheels.items():
        body, origin = '<axis xyz="0 1 0"/>', f'<origin xyz="0 {y} 0.1"/>'
        parts += [joint(f"{side}_wheel", "base", side, "continuous", body, origin), link(side)]
    loaded = nmm.load(write(tmp_path / "base.urdf", robot(*parts)))
    assert inputs_held_by(loaded, [wheel.joint for wheel in loaded.wheels]) == held
    assert inputs_held_by(loaded, []) == []


def test_info_lists_them_and_what_is_not_kept(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(["info", "differential_base"]) == 0
    lines = {
        line.split()[0]: line
        for line in capsys.readouterr().out.splitlines()
        if "0.1 m" in line or "not kept" in line
    }
    assert "30 rad/s  " in lines["left_wheel_joint"]
    assert "30 rad/s, not kept" in lines["front_caster_wheel_joint"]


def test_info_says_which_inputs_the_wheels_limit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def limits(*arguments: str) -> dict[str, str]:
        assert status_of(["info", *arguments]) == 0
        table = capsys.readouterr().out.split("limit\n", 1)[1].split("\n\n", 1)[0]
        return {line.split()[0]: line.split("platform")[-1].strip() for line in table.splitlines()}

    both = dict.fromkeys(("omega_left", "omega_right"), "by its wheels")
    assert limits("differential_base") == both
    axle = [f"{side}{end}" for end in ("_ahead", "_behind") for side in ("left", "right")]
    parts = [link("base")]
    for name, x, y in zip(axle, (0.3, 0.3, -0.3, -0.3), (0.25, -0.25) * 2, strict=True):
        body = '<axis xyz="0 1 0"/><limit velocity="5" effort="1"/>'
        origin = f'<origin xyz="{x} {y} 0.1"/>'
        parts += [joint(f"{name}_wheel", "base", name, "continuous", body, origin), link(name)]
    path = write(tmp_path / "rover.urdf", robot(*parts))
    given = (str(path), "--platform", "skid_steer")
    radii = ",".join(f"{name}_wheel=0.1" for name in axle)
    assert limits(*given, "--wheels", radii) == both
    path.write_text(path.read_text().replace('velocity="5"', 'velocity="0"'))
    assert limits(*given, "--wheels", radii) == dict.fromkeys(both, "-")


def test_a_scenario_that_keeps_limits_has_them_in_its_summary_and_figure(tmp_path: Path) -> None:
    out = tmp_path / "o"
    given = ["--limits", "--set", "duration=0.2", "--out", str(out)]
    assert status_of(["run", "unicycle_2r_position", *given]) == 0
    run = nmm.Trajectory.load(out)
    assert {"left_wheel_joint", "right_wheel_joint"} <= set(run.summary()["limit_names"])
    assert (out / "limits.png").exists()
