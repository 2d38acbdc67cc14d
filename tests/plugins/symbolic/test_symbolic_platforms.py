"""Formulas on every platform, of every task, and of robots with every kind of joint, against the numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from platform_grid import EXAMPLES, random_qp
from symbolic_checks import check_numbers, made
from thinned import thinned
from urdf_parts import LIMIT, inertial, joint, link, write
from urdf_parts import robot as urdf

import nmm
from nmm.base.errors import InputError
from nmm.control.functions.references import Bearing, Circle, PoseReference
from nmm.control.functions.tasks import (
    CallableFunction,
    CenterOfMass,
    Distance,
    Heading,
    LinearCoordinates,
    Orientation,
    Pointing,
    Pose,
    Position,
    Posture,
    Task,
)
from nmm.model.platforms import Platform
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic import symbolic
from nmm.plugins.symbolic.derivation import traced_G
from nmm.plugins.symbolic.expansion import Ring
from nmm.plugins.symbolic.frames import SymbolicFrames
from nmm.plugins.symbolic.geometry import Geometry
from nmm.plugins.symbolic.quotient import Quotient, quotient

LEVEL = '<axis xyz="0 1 0"/>'
#: Inputs of its own choice make it divide by square roots.
WITHOUT = "wheeled, two steered"
TRACED = {name: platform for name, platform in EXAMPLES.items() if name != WITHOUT}
#: Those that are another with other numbers, or another's class described by its wheels.
SIMILAR = {
    *("differential", "differential_of_a_truck", "skid_steer", "car_without_limit", "mecanum_wide"),
    *("front_drive_car_without_limit", "tractor_on_axle", "tractor_three", "wheeled, axle"),
    *("wheeled, trailers", "wheeled, hitch with nothing", "wheeled, omni", "wheeled, mecanum"),
    "wheeled, axles and a driven caster",
}


def robot_on(platform: Platform, folder: Path) -> Robot:
    """Two joints and a tool on the last body of a platform, which has its own joints one on another."""
    parts, last = [link("base", inertial(3.0, "0.05 0 0.1"))], "base"
    for name in platform.coordinates[3:]:
        origin = '<origin xyz="-0.2 0 0.1"/>'
        parts += [joint(name, last, f"{name}_link", origin=origin), link(f"{name}_link", inertial(1.0))]
        last = f"{name}_link"
    parts += [
        joint("pan", last, "column", origin='<origin xyz="0.3 0 0.2"/>'),
        link("column", inertial(1.0, "0.1 0 0")),
        joint(
            "lift", "column", "arm", body=f'<axis xyz="0 1 0"/>{LIMIT}', origin='<origin xyz="0.1 0 0.4"/>'
        ),
        link("arm", inertial(0.5, "0 0 0.2")),
        joint("tip", "arm", "ee", "fixed", "", '<origin xyz="0 0 0.5"/>'),
        link("ee"),
    ]
    return nmm.load(write(folder / "robot.urdf", urdf(*parts)), platform=platform)


def configurations(robot: Robot, rng: np.random.Generator, count: int = 3) -> list[Any]:
    arm = robot.n - robot.platform.n_p
    return [
        np.concatenate([random_qp(robot.platform, rng, 2.0), rng.uniform(-2, 2, arm)]) for _ in range(count)
    ]


@pytest.mark.parametrize("name", thinned(TRACED, lambda name: name not in SIMILAR))
def test_every_platform(name: str, rng: np.random.Generator, tmp_path: Path) -> None:
    robot = robot_on(TRACED[name], tmp_path)
    tasks: list[Any] = [[Position("ee", "z"), Heading("arm")]]
    if robot.n_u > 2:
        tasks.append(Orientation("arm"))
    own = robot.platform.coordinates[3:]
    # The places of what hangs behind many joints are too long for formulas.
    tasks += [Position(f"{own[1]}_link", "x")] if len(own) > 2 else [Position("ee", "xy")]
    tasks += [CenterOfMass("xy")] if len(own) < 2 else []
    for task in tasks:
        check_numbers(robot, task, symbolic(robot, task), configurations(robot, rng))


@pytest.mark.parametrize("name", TRACED)
def test_derivatives_of_G_are_those_of_its_formula(name: str, tmp_path: Path) -> None:
    """What the kernel writes as G_q, against G differentiated as a formula: a second way to each of them."""
    robot = robot_on(TRACED[name], tmp_path)
    frames = SymbolicFrames(robot, Geometry(Ring(10**6), {}, taken=robot.q_names))
    G, G_q = traced_G(robot.platform, frames)
    for (i, j, k), derivative in np.ndenumerate(G_q):
        ring = frames.geometry.ring
        entry, variable = quotient(G[i, j], ring), ring.names.index(robot.q_names[k])
        over, under = entry.over, entry.under
        slope = over.derivative(variable) * under - over * under.derivative(variable)
        assert quotient(derivative, ring) == Quotient(slope) / Quotient(under * under)


def test_a_platform_whose_formula_no_one_could_read_is_refused(tmp_path: Path) -> None:
    robot = robot_on(EXAMPLES[WITHOUT], tmp_path)
    with pytest.raises(InputError, match=r"platform 'wheeled': its numbers have too many digits.*\(the num"):
        symbolic(robot, Position("ee", "xy"))


TASKS: dict[str, tuple[str, Any]] = {
    "linear": ("2r", LinearCoordinates({"theta": 1, "q1": 0.5, "q2": -2}, "x")),
    "posture": ("2r", Posture()),
    "seen from a link": ("2r", Position("ee", "xy", relative_to="link1")),
    "follows a joint": ("2r", Task(Heading("link1"), LinearCoordinates("q2"))),
    "bearing of the mass": ("2r", Task(Heading("link1"), Bearing(CenterOfMass(), [6.0, 2.0]))),
    "heading about x": ("3r", [Heading("ee", (0.6, -0.3, 0.7), "x"), Position("ee", "zx")]),
    "distance": ("3r", Distance("ee", [1.0, 2.0, 3.0])),
    "distance of frames": ("3r", Distance("ee", "base_footprint")),
    "two distances": ("2r", [Distance("ee", [1.0, 2.0, 0.0]), Distance("link2", [0.0, 1.0, 0.5])]),
    "level distance": ("2r", Distance("link2", "base_footprint")),
    "mass": ("3r", CenterOfMass("zxy")),
    "distance from the mass": ("2r", Distance("ee", CenterOfMass())),
    "orientation": ("3r", Orientation("ee")),
    "orientation seen from a link": ("3r", Orientation("link1", "ee")),
    "orientations": ("2r", [Orientation("ee"), Position("ee", "x")]),
    "pointing": ("2r", Pointing("ee", [6.0, 2.0, 1.0], "x")),
    "pointing backwards": ("2r", Pointing("ee", [6.0, 2.0, 1.0], [0.0, -1.0, 0.0])),
    "pointing at a frame": ("3r", Pointing("link1", "ee", "x")),
    "bearing of coordinates": ("2r", Task(Heading("ee"), Bearing(LinearCoordinates("x", "y"), [6.0, 2.0]))),
    "pointing at the mass": ("2r", Pointing("ee", CenterOfMass(), "z")),
}


#: What the same formulas write as another task does.
SLOW = {"pointing backwards", "two distances", "distance of frames", "pointing at a frame"}


@pytest.mark.parametrize("name", thinned(TASKS, lambda name: name not in SLOW))
def test_every_task(name: str, rng: np.random.Generator) -> None:
    kind, task = TASKS[name]
    robot = made(f"unicycle_{kind}", "position" if kind == "2r" else "spatial position")[0]
    check_numbers(robot, task, symbolic(robot, task), rng.uniform(-3, 3, (3, robot.n)))


def test_what_has_no_formula_is_named() -> None:
    robot = made("unicycle_2r")[0]
    cases: list[tuple[Any, str]] = [
        (
            CallableFunction(lambda c: c.q[:1], ["a"]),
            "no formula for CallableFunction: it is a Python function of the user's",
        ),
        (
            Task(Orientation("ee"), [0.0, 0.0, 0.0]),
            "Orientation is a logarithm.*without a target",
        ),
        ([Task(Pose("ee"), PoseReference([0, 0, 0], [0, 0, 0]))], "at most 4 rows"),
        (
            Distance("ee", Circle([2, -1, 0.5], 0.7, -1.3, 0.4)),
            "no formula for Distance: it depends on the time and on the configuration",
        ),
        (
            Pointing("ee", [6.0, 2.0, 1.0], [1.0, 1.0, 0.0]),
            "no formula for Pointing: its axis is not x, y or z",
        ),
    ]
    for task, message in cases:
        with pytest.raises(InputError, match=message):
            symbolic(robot, task)
