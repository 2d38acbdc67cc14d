"""A robot that turns by sliding, from its file to its summary: four plain wheels that do not steer."""

from __future__ import annotations

import numpy as np
import pytest
from findings import holds
from numpy.typing import NDArray

import nmm
from nmm.cli.runs import describe
from nmm.model.platforms import Platform, SkidSteer
from nmm.model.robots.loading.ground import slip_warnings
from nmm.views.playback import Motion, wheel_angles, wheel_rates

Array = NDArray[np.float64]

GRASS = SkidSteer(0.1, 0.5, 0.5, left=0.45, right=-0.4, ahead=-0.05)


def base(platform: Platform | str) -> nmm.Robot:
    """Four wheels of radius 0.1 m, 0.5 m apart each way (their rollers are a drawing)."""
    return nmm.load("omni_base", platform=platform)


def test_it_is_measured_in_a_file() -> None:
    platform = base("skid_steer").platform
    assert isinstance(platform, SkidSteer)
    np.testing.assert_allclose(
        [platform.radius, platform.length, platform.width, platform.left, platform.right, platform.ahead],
        [0.1, 0.5, 0.5, 0.25, -0.25, 0.0],
        rtol=0, atol=1e-12,
    )  # fmt: skip


def test_a_unicycle_on_such_wheels_is_told_of_it() -> None:
    (said,) = slip_warnings(base("unicycle"))
    assert holds(said, "wheels_slide", platform="unicycle", several_axles=True)


@pytest.mark.parametrize("platform", ["skid_steer", GRASS])
def test_its_wheels_turn_as_their_sides_do(platform: Platform | str, rng: np.random.Generator) -> None:
    """In playback, too, however much they slide on the way."""
    robot = base(platform)
    left = np.array([wheel.center[1] > 0.0 for wheel in robot.wheels])
    u = rng.normal(size=2)
    sides = np.where(left, u[0], u[1])
    np.testing.assert_allclose(wheel_rates(robot, rng.normal(size=3), u), sides, rtol=0, atol=1e-12)
    t = np.linspace(0.0, 1.0, 2)
    # At constant inputs a body's way is an arc, along which wheels are turned exactly.
    twist = robot.platform.G(np.zeros(3)) @ u
    turned = twist[2] * t
    c, s = np.sin(turned) / twist[2], (1.0 - np.cos(turned)) / twist[2]
    q = np.column_stack([twist[0] * c - twist[1] * s, twist[0] * s + twist[1] * c, turned])
    angles = wheel_angles(Motion(robot, t, q, np.array([u, u])))
    np.testing.assert_allclose(angles[-1], sides, rtol=0, atol=1e-12)


def test_limits_of_its_wheels_are_those_of_its_sides() -> None:
    robot = nmm.mount(base(GRASS), "small_arm", at="arm_mount")
    task = nmm.Task(nmm.LinearCoordinates(robot.q_names[-1]), nmm.Constant([0.3]))
    limits = nmm.Limits(position=False, wheels=5.0)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
    controller(0.0, robot.q())
    rows = controller.solver.step_memory.problem.limit_rows
    left = [wheel.center[1] > 0.0 for wheel in robot.wheels]
    expected = np.zeros((4, robot.n_u))
    expected[np.arange(4), np.where(left, 0, 1)] = 1.0
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-12)


def test_what_slides_by_design_is_told_as_that() -> None:
    robot = nmm.mount(base(GRASS), "small_arm", at="arm_mount")
    assert slip_warnings(robot) == []
    x, y, _ = nmm.Configuration(robot, robot.q()).placement("ee").translation
    circle = nmm.Circle([x, y + 0.5], radius=0.5, rate=0.5, phase=-np.pi / 2)
    task = nmm.Task(nmm.Position("ee", "xy"), circle)
    run = nmm.simulate(nmm.Controller(robot, task, nmm.ProjectedGradient()), robot.q(), 2.0, 0.01)
    numbers = run.summary()
    turns = np.abs(run.q_dot[:, 2])
    # The corner that is farthest from its centre of rotation: 0.2 m aside (left), 0.25 + 0.05 m ahead.
    assert numbers["sliding_max"] == pytest.approx(turns.max() * np.hypot(0.2, 0.3), rel=1e-9)
    assert numbers["lateral_slip_max"] <= 1e-12
    table = dict(describe(run, numbers))
    assert table["wheels slide by design"] == f"{numbers['sliding_max']:.3g} m/s at most"


def test_other_platforms_do_not_slide() -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run()
    assert run.summary()["sliding_max"] == 0.0
    assert "wheels slide by design" not in dict(describe(run, run.summary()))
