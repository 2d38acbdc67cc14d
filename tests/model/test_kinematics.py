"""Compiled kinematics against Pinocchio's, and what controllers answer with either."""

import pickle

import numpy as np
import pytest
from findings import refused
from robot_grid import BASES, DATA, built
from thinned import thinned

import nmm
from nmm.base.bundled import bundled_robots, bundled_scenarios
from nmm.base.kernels.kinematics import place_frames
from nmm.model.collisions.pairs import random_configurations
from nmm.model.robots.configuration import kinematics_updater
from nmm.model.robots.joint_table import frame_table
from nmm.model.robots.robot import CENTER_OF_MASS

#: One of each family: trees, closed hands, sliding joints, unaligned axes.
STRANGERS = [
    "baxter_description/urdf/baxter.urdf",
    "xarm_description/urdf/xarm7.urdf",
    "panda_description/urdf/panda.urdf",
    "pr2_description/urdf/pr2.urdf",
    "talos_data/robots/talos_reduced.urdf",
    "tiago_description/robots/tiago.urdf",
    "ur_description/urdf/ur10_robot.urdf",
    "z1_description/urdf/z1.urdf",
]


def agree(robot: nmm.Robot) -> None:
    """Every frame and the centre of mass, with their Jacobians and Hessians, at a few configurations."""
    names = (*robot.frames, CENTER_OF_MASS)
    k, n = len(names), robot.n
    ours, theirs = ([np.zeros((k, 3, 4)), np.zeros((k, 6, n)), np.zeros((k, 6, n, n))] for _ in range(2))
    joints = robot.joints
    frames = frame_table(
        robot.model, robot.joint_axes, [*(robot.frame_id(name) for name in robot.frames), None]
    )
    update = kinematics_updater(robot, names, *theirs)
    for q in random_configurations(robot, 3, seed=4):
        place_frames(joints, frames, q, *ours)
        update(0.0, q)
        for mine, pinocchios in zip(ours[:2], theirs[:2], strict=True):
            np.testing.assert_allclose(mine, pinocchios, atol=1e-13)
        np.testing.assert_allclose(ours[2][:-1], theirs[2][:-1], atol=1e-13)  # the centre of mass has none


@pytest.mark.parametrize("name", bundled_robots())
def test_bundled_robots_are_where_pinocchio_has_them(name: str) -> None:
    agree(nmm.load(name))


@pytest.mark.parametrize("base", BASES)
def test_arms_on_bases_are_where_pinocchio_has_them(base: str) -> None:
    agree(built(base, "small arm"))


@pytest.mark.parametrize("file", STRANGERS)
def test_strangers_are_where_pinocchio_has_them(file: str) -> None:
    agree(nmm.load(DATA + file, platform="fixed"))


@pytest.mark.parametrize(
    "name", thinned(bundled_scenarios(), lambda name: name in list(bundled_scenarios())[::2])
)
def test_controllers_answer_the_same(name: str) -> None:
    scenario = nmm.Scenario.load(name)
    usual = scenario.controller()
    fast = type(usual)(*_compiled(usual))
    assert fast.given.kinematics == "compiled"
    for one in (usual, fast, pickle.loads(pickle.dumps(fast))):
        one.dt = scenario.parts.dt
        q = usual.robot.q(scenario.parts.q0)
        for renewal in one.solver.program.renewals:  # the first picture, where there are any
            renewal.renew(0.0, q)
        one.found = [one(0.0, q), one(scenario.parts.dt, q)]
    scale = max(1.0, np.abs(usual.found).max())
    np.testing.assert_allclose(fast.found, usual.found, atol=1e-11 * scale)


def _compiled(controller: nmm.Controller) -> tuple:
    """What makes the same controller with compiled kinematics."""
    given = controller.given._replace(kinematics="compiled", dt=controller.dt)
    return given if type(controller) is nmm.Controller else (*given[:4], *given[5:])


def test_who_computes_is_checked() -> None:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.0])
    with refused("controller", got="numpy"):
        nmm.Controller(robot, task, nmm.ProjectedGradient(), kinematics="numpy")
