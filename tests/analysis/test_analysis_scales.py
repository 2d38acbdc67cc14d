"""Ranks have a scale: a task of one row can be singular, and metres compare with radians."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from robot_grid import ARMS

import nmm
from nmm.analysis import analyse, analyse_along, find_singularities, redundancy
from nmm.control.resolvers import Status
from nmm.model.robots.robot import Robot

STRETCHED_UP = [0.7, -pi / 2, 0.0, -pi / 2, 0.0, 0.0]


@pytest.fixture(scope="module")
def ur5() -> Robot:
    return nmm.load(ARMS["UR5"].source, platform="fixed")


def test_a_row_of_one_can_be_lost(ur5: Robot) -> None:
    """The UR5 points straight up: no joint lifts its tool."""
    height = nmm.Position("tool0", "z")
    report = analyse((ur5, height), STRETCHED_UP)
    assert report.rank == 0
    assert report.singular
    assert all(one.rank == 0 for one in report.parts.values())
    assert redundancy((ur5, height), STRETCHED_UP).rank_J == 0
    bent = np.add(STRETCHED_UP, [0, 0, 1.0, 0, 0, 0])
    assert analyse((ur5, height), bent).rank == 1
    path = np.linspace(bent, STRETCHED_UP, 11)
    np.testing.assert_array_equal(analyse_along((ur5, height), np.arange(11.0), path).rank, [1] * 10 + [0])
    for resolver in (
        nmm.ProjectedGradient(),
        nmm.ReducedGradient(),
        nmm.ReducedGradient(partitions=[["shoulder_lift_joint"], ["elbow_joint"]]),
    ):
        controller = nmm.Controller(ur5, nmm.Task(height, [0.5]), resolver)
        assert controller.evaluate(0.0, STRETCHED_UP).status is Status.SINGULAR_J
        with pytest.raises(nmm.SingularError, match="no input gives: motion of tool0 along z"):
            controller(0.0, STRETCHED_UP)
        assert controller.evaluate(0.0, bent).status is Status.SOLVED


def test_a_singular_row_is_found(ur5: Robot) -> None:
    found = find_singularities((ur5, nmm.Position("tool0", "z")), starts=40)
    assert found.families
    for family in found.families:
        assert abs(analyse((ur5, nmm.Position("tool0", "z")), family.examples[0]).sigma_min) < 1e-6


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_a_functions_own_scale(unit: float) -> None:
    """The same function in other units, with its scale in these units, is judged the same."""
    robot = nmm.load("unicycle_2r")
    for tilt, rank in ((0.0, 1), (1e-11, 1), (0.3, 2)):
        J = unit * np.array([[0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0, tilt]])
        function = nmm.CallableFunction(
            lambda c, J=J: J @ c.q, ["a", "b"], jacobian=lambda c, J=J: J, scales=[unit, unit]
        )
        assert analyse((robot, function), np.zeros(5)).rank == rank
        step = nmm.Controller(robot, nmm.Task(function, unit * np.ones(2)), nmm.ProjectedGradient()).evaluate(
            0.0, np.zeros(5)
        )
        assert step.status is (Status.SOLVED if rank == 2 else Status.SINGULAR_J)
