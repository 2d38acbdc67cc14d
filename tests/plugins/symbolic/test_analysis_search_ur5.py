"""Singular configurations of UR5, found and nearest, against conditions from Pinocchio's placements."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy import pi, sin
from numpy.typing import NDArray
from scipy.optimize import minimize
from spatial_arms import load_ur5

from nmm.analysis import analyse
from nmm.control.functions.tasks import Pose
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic.search.family import SingularFamily
from nmm.plugins.symbolic.search.many_starts import SingularitySearch, find_singularities
from nmm.plugins.symbolic.search.nearest import nearest_singularity

Array = NDArray[np.float64]

TOOL = Pose("ee_link")
PAN, LIFT, ELBOW, WRIST_1, WRIST_2, WRIST_3 = (
    f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
)


@pytest.fixture(scope="module")
def fixed_ur5() -> Robot:
    return load(load_ur5().source, platform="fixed")


def by_pinned(search: SingularitySearch) -> dict[frozenset[str], SingularFamily]:
    return {frozenset(family.pinned): family for family in search.families}


class Shoulder:
    """What makes UR5 singular: s3, s5, and the wrist over the axis of joint 1, by Pinocchio's placements."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.data = robot, robot.model.createData()
        self.joints = [robot.model.getJointId(name) for name in (PAN, LIFT, WRIST_3)]

    def __call__(self, q: Array) -> float:
        """Distance of the wrist, along the arm's plane, from the axis of joint 1, m."""
        pin.forwardKinematics(self.robot.model, self.data, q)
        pan, lift, wrist = (self.data.oMi[joint] for joint in self.joints)
        sideways = lift.rotation[:, 1]  # joint 2's axis, level
        return float(np.cross([0.0, 0.0, 1.0], sideways) @ (wrist.translation - pan.translation))

    def of_elbow(self, q: Array) -> float:
        return float(sin(q[self.robot.coordinate(ELBOW)]))

    def of_wrist(self, q: Array) -> float:
        return float(sin(q[self.robot.coordinate(WRIST_2)]))


def determinant(robot: Robot, q: Array) -> float:
    J = pin.computeFrameJacobian(
        robot.model, robot.model.createData(), q, robot.frame_id("ee_link"), pin.LOCAL_WORLD_ALIGNED
    )
    return float(np.linalg.det(J))


def check_ur5(search: SingularitySearch, shoulder: Callable[[Array], float]) -> None:
    kinds = by_pinned(search)
    assert set(kinds) == {frozenset({ELBOW}), frozenset({WRIST_2}), frozenset()}
    everything = set(search.families[0].names)
    for name in (ELBOW, WRIST_2):
        family = kinds[frozenset({name})]
        assert sorted(family.pinned[name]) == pytest.approx([0.0, pi], abs=1e-6)
        assert set(family.free) == everything - {name}
        assert (family.codimension, family.rank) == (1, 5)
    over = kinds[frozenset()]
    assert over.related == (LIFT, ELBOW, WRIST_1)
    assert set(over.free) == everything - {LIFT, ELBOW, WRIST_1}
    assert not over.relations
    assert len(over.examples) > 1
    for q in over.examples:
        assert shoulder(q[-6:]) == pytest.approx(0.0, abs=1e-7)


def test_ur5(fixed_ur5: Robot, rng: np.random.Generator) -> None:
    shoulder = Shoulder(fixed_ur5)
    ratios = []
    for _ in range(20):
        q = rng.uniform(-3, 3, 6)
        ratios.append(determinant(fixed_ur5, q) / (shoulder(q) * shoulder.of_elbow(q) * shoulder.of_wrist(q)))
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)  # so these three, and nothing else
    search = find_singularities((fixed_ur5, TOOL))
    check_ur5(search, shoulder)
    assert search.converged == search.starts == 200
    for family in search.families:  # no example lies where another family is met: nothing would bring it back
        report = analyse((fixed_ur5, TOOL), family.examples[0], minors=False)
        assert report.rank == 5
        assert report.by_input.effective


def test_what_the_platform_removes_of_ur5(ur5: Robot, fixed_ur5: Robot, rng: np.random.Generator) -> None:
    """The base turns about the axis of joint 1 and drives along x: what is lost has to be across its way."""
    check_ur5(find_singularities((ur5, TOOL), starts=60, part="arm"), Shoulder(fixed_ur5))
    search = find_singularities((ur5, TOOL), starts=100)
    kinds = by_pinned(search)
    assert set(kinds) == {
        frozenset({ELBOW}), frozenset({PAN}), frozenset({PAN, WRIST_2}), frozenset({WRIST_2}),
    }  # fmt: skip
    assert all(family.codimension == 2 for family in search.families)
    for family in search.families:
        for values in family.pinned.values():
            assert sorted(values) == pytest.approx([0.0, pi], abs=1e-6)
    assert kinds[frozenset({PAN})].related == (LIFT, ELBOW, WRIST_1)
    assert kinds[frozenset({ELBOW})].related == (PAN, LIFT, WRIST_1, WRIST_2)
    (upright,) = kinds[frozenset({WRIST_2})].relations
    assert (upright.coefficients, upright.text[-7:]) == ({LIFT: 1, ELBOW: 1, WRIST_1: 1}, "0 or ±π")
    # What the wrist loses, and how much of it driving gives back: s1 s234, times what never vanishes.
    for _ in range(50):
        q = rng.uniform(-3, 3, 6)
        q[4] = 0.0
        J = pin.computeFrameJacobian(
            fixed_ur5.model, fixed_ur5.model.createData(), q, fixed_ur5.frame_id("ee_link"),
            pin.LOCAL_WORLD_ALIGNED,
        )  # fmt: skip
        lost = np.linalg.svd(J)[0][:, -1]
        assert abs(lost[0]) > 0.05 * abs(sin(q[0]) * sin(q[1] + q[2] + q[3]))


@pytest.mark.thorough
def test_the_nearest_of_ur5_is_that_of_brute_force(fixed_ur5: Robot, rng: np.random.Generator) -> None:
    shoulder, bounds = Shoulder(fixed_ur5), list(fixed_ur5.q_limits)
    over = 0
    for _ in range(5):
        q = rng.uniform(-2.5, 2.5, 6)
        expected = []
        for condition in (shoulder, shoulder.of_elbow, shoulder.of_wrist):
            for start in [q, *(q + rng.uniform(-1, 1, (4, 6)))]:
                found = minimize(
                    lambda p, q=q: np.sum((p - q) ** 2), start, method="SLSQP", bounds=bounds,
                    constraints={"type": "eq", "fun": condition}, options={"ftol": 1e-14, "maxiter": 200},
                )  # fmt: skip
                if abs(condition(found.x)) < 1e-8:
                    expected.append((np.sqrt(found.fun), condition is shoulder))
        point = nearest_singularity((fixed_ur5, TOOL), q, starts=40)
        assert point is not None
        assert point.distance == pytest.approx(min(expected)[0], abs=1e-6)
        assert point.distance == pytest.approx(np.linalg.norm(point.q - q))
        assert point.ratio < 1e-8
        over += min(expected)[1]
    assert over  # the curved one was among them
