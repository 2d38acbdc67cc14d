"""Limits of coordinates and inputs: a start outside is refused, a motion that goes outside is said."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import refused, the
from numpy.typing import ArrayLike, NDArray
from urdf_parts import joint, link, robot, write

import nmm
from nmm.model.platforms import Unicycle
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]
START = {"q1": 0.3, "q2": 0.6}


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Two upright joints within ±1 rad and ±2 rad/s on a platform of at most 0.4 m/s."""
    body = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="2"/>'
    parts = [link("base"), link("a"), link("b"), link("tip")]
    parts += [
        joint(name, parent, child, kind, body, '<origin xyz="0.5 0 0"/>')
        for name, parent, child, kind in (
            ("q1", "base", "a", "revolute"),
            ("q2", "a", "b", "revolute"),
            ("end", "b", "tip", "fixed"),
        )
    ]
    path = write(tmp_path_factory.mktemp("limited") / "limited.urdf", robot(*parts))
    return nmm.load(path, platform=Unicycle(limits={"v": 0.4}))


def run(robot: Robot, velocity: ArrayLike, duration: float, start: dict[str, float]) -> nmm.Trajectory:
    """The tip goes off along a straight line at a constant velocity."""
    tip = nmm.Configuration(robot, robot.q(start)).placement("tip").translation[:2]
    line = nmm.Line(tip, tip + duration * np.asarray(velocity), duration, "constant")
    controller = nmm.Controller(robot, nmm.Task(nmm.Position("tip", "xy"), line), nmm.ProjectedGradient())
    return nmm.simulate(controller, start, duration, 0.01)


def test_what_the_limits_are(limited: Robot) -> None:
    unlimited = [-np.inf, np.inf]
    np.testing.assert_array_equal(limited.q_limits, [unlimited] * 3 + [[-1, 1]] * 2)
    np.testing.assert_array_equal(limited.u_limits, [0.4, np.inf, 2, 2])


def test_a_platforms_own_limits_tighten_the_files(limited: Robot) -> None:
    class Steered(Unicycle):
        coordinates = ("x", "y", "theta", "q1")
        inputs = ("v", "omega", "rate")

        @property
        def coordinate_limits(self) -> Array:
            return np.array([[-np.inf, np.inf]] * 3 + [[-3.0, 0.5]])

    steered = dataclasses.replace(limited, platform=Steered())
    np.testing.assert_array_equal(steered.q_limits[3], [-1.0, 0.5])


def test_a_start_outside_names_every_coordinate(limited: Robot) -> None:
    with pytest.raises(nmm.InputError) as caught:
        run(limited, [0.1, 0.0], 1.0, {"q1": 1.5, "q2": -3.0})
    assert "outside its limits: q1 = 1.5 rad (from -1 to 1), q2 = -3 rad (from -1 to 1)" in str(caught.value)
    limited.check_limits(limited.q({"q1": 1.0, "q2": -1.0}))  # the limits themselves are inside


def test_a_motion_inside_its_limits_is_not_warned_about(limited: Robot) -> None:
    assert run(limited, [0.2, 0.0], 1.0, START).warnings == ()


def test_a_motion_that_goes_outside_says_where_and_how_far(limited: Robot) -> None:
    fast = run(limited, [1.2, 0.0], 1.0, START)
    assert fast.complete
    (beyond,) = fast.findings
    reached = np.abs(fast.u[:, 0]).max()
    assert reached > 0.4
    assert beyond.code == "inputs_beyond_limits"
    assert beyond.values["inputs"] == [{"name": "v", "largest": reached, "unit": "m/s", "limit": 0.4}]

    aside = run(limited, [-0.5, -0.1], 6.0, START)
    outside = {
        name: np.flatnonzero(np.abs(q) > 1 + 2e-6)
        for name, q in zip(["q1", "q2"], aside.q.T[3:], strict=True)
    }
    found = the(aside, "coordinates_beyond_limits").values["coordinates"]
    assert {one["name"]: one["t"] for one in found} == {
        name: aside.t[first[0]] for name, first in outside.items() if first.size
    }
    assert found


def test_limits_of_a_platform_measured_in_the_file() -> None:
    car = nmm.load("car_base", limits={"v": 0.5})
    assert car.u_limits[0] == 0.5
    assert nmm.load("car_base", platform="front_drive_car", limits={"v": 0.5}).u_limits[0] == 0.5
    with pytest.raises(nmm.RobotError, match=r"limits of platform car: unknown input 'w'.*steering_rate"):
        nmm.load("car_base", limits={"w": 1.0})
    mounted = nmm.mount(car, "small_arm")
    assert mounted.u_limits[0] == 0.5


@pytest.mark.parametrize(
    ("limits", "fields"),
    [
        ({"w": 1.0}, {"where": "limits of platform unicycle", "got": "w"}),
        ({"v": 0.0}, {"where": "limit of v", "got": 0.0}),
        ({"v": "fast"}, {"where": "limit of v", "got": "fast"}),
    ],
)
def test_wrong_limits_of_inputs(limits: dict[str, float], fields: dict[str, Any]) -> None:
    with refused(**fields):
        Unicycle(limits=limits)


def test_limits_in_a_scenario(tmp_path: Path) -> None:
    steered = nmm.Scenario.load("car_steered_by_the_null_space", {"robot.platform.limits": {"v": 0.3}})
    assert steered.robot().u_limits[0] == 0.3
    (v, *_) = the(steered.override("duration", 2).run(), "inputs_beyond_limits").values["inputs"]
    assert v["name"] == "v"
    assert 0.6 <= v["largest"] < 0.7


def test_a_scenario_names_the_key(tmp_path: Path, limited: Robot) -> None:
    text = f"""
robot: {{source: {limited.source}}}
q0: {{q1: 2}}
duration: 1
task: {{kind: position, frame: tip, axes: xy, reference: [1, 1]}}
resolver: {{kind: pg}}
"""
    path = write(tmp_path / "outside.yaml", text)
    with refused("outside.yaml:3: q0: r", kind=nmm.ScenarioError, got={"q1": 2.0}) as caught:
        nmm.Scenario.load(path).controller()
    assert "q1 = 2 rad (from -1 to 1)" in caught.value.what
