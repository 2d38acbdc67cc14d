"""Objectives: laws that hold on every bundled robot, and second implementations of their values."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from derivatives import check_function
from numpy.typing import NDArray
from short_scenario import scenario

import nmm
from nmm.control.functions.objectives import WeightedSum
from nmm.control.functions.objectives.jacobian import ROWS

Array = NDArray[np.float64]

#: Bundled robots with an arm, the frame that works, and rows of which it can move all.
WITH_ARM = {"unicycle_2r": "xy", "unicycle_3r": "xyz", "small_arm": "xyz"}
BASES = ("differential_base", "car_base", "trailer_base", "omni_base")
each_arm = pytest.mark.parametrize("name", WITH_ARM)


@cache
def loaded(name: str, base: str = "") -> nmm.Robot:
    """A bundled robot, or a bundled arm on a bundled base."""
    return nmm.mount(base, name, at="arm_mount") if base else nmm.load(name)


def configuration(robot: nmm.Robot, rng: np.random.Generator) -> nmm.Configuration:
    """Within the limits, and away from them."""
    lower, upper = np.where(robot.limited, robot.q_limits, [-3.0, 3.0]).T
    share = rng.uniform(0.2, 0.8, robot.n)
    return nmm.Configuration(robot, robot.following.placed(lower + share * (upper - lower)))


def jacobian(here: nmm.Configuration, rows: str | tuple[str, ...]) -> Array:
    picked: Array = here.jacobian("ee")[[ROWS[row] for row in rows]] @ here.S
    return picked


def objectives(robot: nmm.Robot, rows: str) -> dict[str, nmm.extending.Objective]:
    joints = robot.u_names[robot.platform.p :]
    n = len(joints)
    ramp = nmm.Line([0.2], [1.3], 3.0, "smooth")
    return {
        "condition": nmm.InverseCondition("ee", (*rows, "rz")),
        "condition of the arm": nmm.InverseCondition("ee", "xy", "arm", length=0.2),
        "directional": nmm.DirectionalManipulability("ee", [1.0, 0.5, -0.3][: len(rows)], rows),
        "weighed": nmm.WeightedManipulability("ee", "xy", 0.4, {"platform": 3.0}),
        "barrier": nmm.LimitBarrier(joints, np.full(n, -7.0), np.full(n, 7.0), 0.1),
        "posture": nmm.PreferredPosture(dict.fromkeys((*joints, "theta"), 0.3)),
        "posture that moves": ramp * nmm.PreferredPosture({joints[0]: ramp, joints[1]: 0.2}),
        "energy": nmm.PotentialEnergy(),
        "alignment": nmm.Alignment(nmm.VelocityOf(nmm.Circle([1, 2], 2.0, 0.7))),
        "alignment with a point": nmm.Alignment(at="ee"),
    }


@each_arm
def test_gradients_on_every_robot_with_an_arm(name: str, rng: np.random.Generator) -> None:
    robot = loaded(name)
    for objective in objectives(robot, WITH_ARM[name]).values():
        for t in (0.6, 1.9):
            check_function(objective, robot, t, configuration(robot, rng).q)


@pytest.mark.parametrize("name", BASES)
def test_gradients_on_every_platform(name: str, rng: np.random.Generator) -> None:
    """An arm on it; of the platform's own columns, those that need ∂S/∂q too."""
    robot = loaded("small_arm", name)
    frame = next(one for one in reversed(robot.frames) if one.endswith("ee"))
    for objective in (
        nmm.InverseCondition(frame, ("x", "y", "rz"), weights={"platform": 2.0}),
        nmm.DirectionalManipulability(frame, [0.3, 1.0], "xy", "platform"),
        nmm.WeightedManipulability(frame),
        nmm.LimitBarrier(margin=0.1),
        nmm.PotentialEnergy(),
    ):
        q = configuration(robot, rng).q
        check_function(objective, robot, 0.0, q)


@each_arm
def test_directional_manipulability_lies_between_the_singular_values(
    name: str, rng: np.random.Generator
) -> None:
    robot, rows = loaded(name), WITH_ARM[name]
    for _ in range(10):
        here = configuration(robot, rng)
        U, sigma, _ = np.linalg.svd(jacobian(here, rows))
        d = rng.normal(size=len(rows))
        value = nmm.DirectionalManipulability("ee", d, rows).value(here)
        assert sigma[-1] - 1e-12 <= value <= sigma[0] + 1e-12
        # Along d, at inputs of size 1: J u = β d with the least u.
        u = np.linalg.pinv(jacobian(here, rows)) @ (value * d / np.linalg.norm(d))
        assert np.linalg.norm(u) == pytest.approx(1.0, rel=1e-10)
        for column, expected in zip(U.T, sigma, strict=True):
            for scale in (1.0, -7.0):
                found = nmm.DirectionalManipulability("ee", scale * column, rows).value(here)
                assert found == pytest.approx(expected, rel=1e-9)


@each_arm
def test_the_condition_number_is_the_frobenius_norms(name: str, rng: np.random.Generator) -> None:
    robot, rows = loaded(name), (*WITH_ARM[name], "rz")
    weights = {"platform": 3.0, robot.u_names[-1]: 0.4}
    W = np.array([*[3.0] * robot.platform.p, *[1.0] * (robot.n_u - robot.platform.p - 1), 0.4])
    for _ in range(10):
        here = configuration(robot, rng)
        J = jacobian(here, rows) / np.sqrt(W)
        J[:-1] /= 0.7
        kappa = np.linalg.norm(J) * np.linalg.norm(np.linalg.pinv(J)) / len(J)
        found = nmm.InverseCondition("ee", rows, weights=weights, length=0.7).value(here)
        assert found == pytest.approx(1.0 / kappa, rel=1e-9)
        assert 0.0 < found <= 1.0
        natural = nmm.InverseCondition("ee", rows).value(here)
        assert natural == nmm.InverseCondition("ee", rows, length=robot.reach).value(here)


@each_arm
def test_the_condition_number_does_not_know_where_the_world_lies(name: str, rng: np.random.Generator) -> None:
    """Nor does manipulability; what moves along a direction does."""
    robot, rows = loaded(name), WITH_ARM[name]
    here = configuration(robot, rng)
    q = here.q.copy()
    q[:3] += 1.7, -2.0, 0.9
    elsewhere = nmm.Configuration(robot, q)
    for alike in (
        nmm.InverseCondition("ee", rows),
        nmm.Manipulability("ee", rows),
        nmm.WeightedManipulability("ee", rows if len(rows) == 2 else "xyz"),
    ):
        assert alike.value(elsewhere) == pytest.approx(alike.value(here), rel=1e-10)
        np.testing.assert_allclose(alike.gradient(elsewhere)[:3], 0.0, atol=1e-9)
    directional = nmm.DirectionalManipulability("ee", [1.0, 0.0, 0.0][: len(rows)], rows)
    assert directional.value(elsewhere) != pytest.approx(directional.value(here), rel=1e-3)
    c, s = np.cos(0.9), np.sin(0.9)
    turned = nmm.DirectionalManipulability("ee", [c, s, 0.0][: len(rows)], rows)
    assert turned.value(elsewhere) == pytest.approx(directional.value(here), rel=1e-10)


def test_an_isotropic_arm_is_smooth_where_its_singular_values_meet(robot_2r: nmm.Robot) -> None:
    """q2 = 3π/4 with lengths 1 : √2 is isotropic: the top of the condition number, where its slope is 0."""
    first = nmm.load("unicycle_2r", arguments={"l1": 2**0.5, "l2": 1.0})
    here = nmm.Configuration(first, {"q2": 3 * np.pi / 4, "q1": 0.4})
    condition = nmm.InverseCondition("ee", "xy", "arm")
    assert condition.value(here) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(condition.gradient(here), 0.0, atol=1e-12)
    assert condition.value(nmm.Configuration(robot_2r, {"q1": 0.3})) == 0.0  # stretched
    np.testing.assert_array_equal(condition.gradient(nmm.Configuration(robot_2r, {"q1": 0.3})), np.zeros(5))


@each_arm
def test_weights_of_one_change_nothing_and_heavy_inputs_count_for_less(
    name: str, rng: np.random.Generator
) -> None:
    robot, rows = loaded(name), WITH_ARM[name]
    here = configuration(robot, rng)
    plain, arm = nmm.Manipulability("ee", rows), nmm.Manipulability("ee", rows, "arm")
    for one in ({"platform": 1.0}, {"arm": 1.0}, np.ones(robot.n_u)):
        same = nmm.Manipulability("ee", rows, weights=one)
        assert same.value(here) == plain.value(here)
        np.testing.assert_array_equal(same.gradient(here), plain.gradient(here))
    for alpha, expected in ((0.0, plain.value(here)), (1.0, arm.value(here))):
        assert nmm.WeightedManipulability("ee", rows, alpha).value(here) == expected
    W = rng.uniform(0.2, 5.0, robot.n_u)
    volume = np.prod(np.linalg.svd(jacobian(here, rows) / np.sqrt(W), compute_uv=False))
    found = nmm.Manipulability("ee", rows, weights=W).value(here)
    assert found == pytest.approx(volume, rel=1e-10)
    heavy = nmm.Manipulability("ee", rows, weights={"platform": 1e12})
    assert heavy.value(here) == pytest.approx(arm.value(here), rel=1e-6)


def test_the_barrier_rises_at_the_limits_and_pulls_back_beyond_them(robot_2r: nmm.Robot) -> None:
    def barrier(margin: float, q: float) -> tuple[float, float]:
        one = nmm.LimitBarrier(["q1"], [-1.0], [3.0], margin)
        here = nmm.Configuration(robot_2r, {"q1": q})
        return one.value(here), one.gradient(here)[3]

    assert barrier(0.01, 1.0) == (1.0, 0.0)  # the middle
    for q in (-0.9, 0.3, 2.5, 2.95):
        assert barrier(0.01, q)[0] == pytest.approx(16.0 / (4.0 * (3.0 - q) * (q + 1.0)), rel=1e-12)
    for margin in (1e-2, 1e-4, 1e-6):
        value, slope = barrier(margin, 3.0)
        assert value > 0.5 / margin
        assert slope > 1 / (32 * margin**2)
    for q in (3.5, 40.0):
        assert barrier(0.01, q)[1] > barrier(0.01, 3.0)[1] > 0.0
    for q in (-1.5, -40.0):
        assert barrier(0.01, q)[1] < barrier(0.01, -1.0)[1] < 0.0
    for edge in (-1.0 + 0.4, 3.0 - 0.4):  # twice differentiable where the parabola begins
        before, after = barrier(0.1, edge - 1e-7), barrier(0.1, edge + 1e-7)
        np.testing.assert_allclose(before, after, atol=1e-4)


def test_the_barrier_is_over_all_that_is_limited() -> None:
    robot = loaded("small_arm", "car_base")
    limited = [i for i in range(robot.n) if robot.limited[i].all()]
    assert robot.q_names.index("steering") in limited
    gradient = nmm.LimitBarrier().gradient(nmm.Configuration(robot, np.full(robot.n, 0.123)))
    assert list(np.flatnonzero(gradient)) == limited


@pytest.mark.parametrize("name", [*WITH_ARM, *BASES])
def test_the_gradient_of_potential_energy_is_the_gravity_torque(name: str, rng: np.random.Generator) -> None:
    robot = loaded(name) if name in WITH_ARM else loaded("small_arm", name)
    data = robot.model.createData()
    for _ in range(5):
        here = configuration(robot, rng)
        torque = pin.computeGeneralizedGravity(robot.model, data, here.q)
        energy = nmm.PotentialEnergy()
        np.testing.assert_allclose(energy.gradient(here), torque, atol=1e-10)
        other = configuration(robot, rng)
        raised = [pin.computePotentialEnergy(robot.model, data, one.q) for one in (here, other)]
        found = [energy.value(one) for one in (here, other)]
        assert found[1] - found[0] == pytest.approx(raised[1] - raised[0], abs=1e-9)
        tilted = nmm.PotentialEnergy([0, 0, -9.81 / 2]).value(here)
        assert tilted == pytest.approx(found[0] / 2, rel=1e-12)


def test_a_preferred_posture_counts_no_turns_of_what_turns_freely(rng: np.random.Generator) -> None:
    robot = loaded("small_arm")  # theta turns freely, its joints do not
    here = configuration(robot, rng)
    for name, wraps in (("theta", True), ("q1", False), ("x", False)):
        i = robot.coordinate(name)
        for turns in (0, 1, -3):
            for off in (0.0, 1e-3, 1.0):
                one = nmm.PreferredPosture({name: here.q[i] + off + 2 * np.pi * turns}, {name: 2.5})
                difference = off if wraps else off + 2 * np.pi * turns
                expected = 2 * 2.5 * np.sin(difference / 2) ** 2 if wraps else 2.5 * difference**2 / 2
                assert one.value(here) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    several = nmm.PreferredPosture({"q1": 0.3, "q2": -0.2}, {"q2": 3.0})
    squares = nmm.Quadratic(nmm.QuadraticTerm("q1", 0.3), nmm.QuadraticTerm("q2", -0.2, 3.0))
    assert several.value(here) == squares.value(here)


def test_alignment_is_one_minus_the_cosine_all_the_way_round(robot_2r: nmm.Robot) -> None:
    for theta in np.linspace(-9.0, 9.0, 37):
        here = nmm.Configuration(robot_2r, [1.0, 2.0, theta, 0.3, 0.4])
        for off, expected in (
            (nmm.Alignment(0.4), theta - 0.4),
            (nmm.Alignment([0.0, -3.0]), theta + np.pi / 2),
            (nmm.Alignment(at=[1.0, 7.0]), theta - np.pi / 2),
            (nmm.Alignment(at=[-4.0, 2.0, 9.0], offset=np.pi), theta),
            (nmm.Alignment(0.4, of={"theta": 1, "q1": 1}), theta + 0.3 - 0.4),
        ):
            assert off.value(here) == pytest.approx(1 - np.cos(expected), abs=1e-12)
            assert off.gradient(here)[2] == pytest.approx(np.sin(expected), abs=1e-12)
    at_its_goal = nmm.Alignment(at=[1.0, 2.0])
    assert at_its_goal.value(here) == 0.0
    np.testing.assert_array_equal(at_its_goal.gradient(here), np.zeros(5))


def test_the_velocity_of_a_reference_is_its_rate(robot_2r: nmm.Robot) -> None:
    here = nmm.Configuration(robot_2r, np.zeros(5))
    for way in (
        nmm.Circle([1, 2, 3], 0.7, -1.3, 0.4, "zx"),
        nmm.Line([0, 1], [2, 0], 2.0, "smooth"),
        nmm.Line([0, 1], [2, 0], 2.0),
        nmm.Spline([0, 1, 3], [[0, 1], [2, 3], [5, -1]], 5),
        nmm.Constant([1, 2]),
    ):
        for t in (-0.5, 0.0, 0.7, 1.3, 2.9, 8.0):
            found = nmm.evaluate(nmm.VelocityOf(way), t, here).value
            np.testing.assert_allclose(found, nmm.evaluate(way, t, here).value_t, atol=1e-12)


def test_weights_that_change_scale_value_and_gradient(robot_2r: nmm.Robot, rng: np.random.Generator) -> None:
    here = configuration(robot_2r, rng)
    w, ramp = nmm.Manipulability("ee", "xy"), nmm.Line([0.0], [2.0], 4.0)
    both = 3.0 * (ramp * w) - nmm.Quadratic(nmm.QuadraticTerm("q1"))
    rest = -nmm.Quadratic(nmm.QuadraticTerm("q1"))
    for t, share in ((0.0, 0.0), (1.0, 0.5), (4.0, 2.0), (9.0, 2.0)):
        expected = 3.0 * share * w.value(here) + rest.value(here)
        assert both.value(here, t) == pytest.approx(expected, rel=1e-12)
        gradient = 3.0 * share * w.gradient(here) + rest.gradient(here)
        np.testing.assert_allclose(both.gradient(here, t), gradient, atol=1e-12)
    assert both.rate(here, 1.0) == pytest.approx(1.5 * w.value(here), rel=1e-12)
    signal = nmm.LiveTarget(0.5, "1")
    dimmed = signal * w
    assert dimmed.value(here) == pytest.approx(0.5 * w.value(here))
    signal.set(0.0)
    assert dimmed.value(here) == 0.0


def test_a_controller_descends_h_as_it_is_at_its_time(robot_3r: nmm.Robot, rng: np.random.Generator) -> None:
    ramp, target = nmm.Line([0.0], [1.0], 2.0), nmm.Line([0.1], [1.1], 3.0)
    objective = ramp * nmm.InverseCondition("ee", "xyz", "arm") + nmm.PreferredPosture({"q1": target})
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 1, 0.3))
    controller = nmm.Controller(robot_3r, task, nmm.ProjectedGradient(), objective)
    here = configuration(robot_3r, rng)
    for t in (0.0, 0.8, 5.0):
        step = controller.evaluate(t, here.q)
        assert step.objective == pytest.approx(objective.value(here, t), rel=1e-12)
        np.testing.assert_allclose(step.h, here.S.T @ objective.gradient(here, t), atol=1e-12)


def posed(text: str) -> Callable[[Path], nmm.extending.Objective | None]:
    return lambda folder: scenario(folder, objective=text).controller().given.objective


SAID: list[tuple[str, nmm.extending.Objective]] = [
    (
        "{kind: posture, posture: {q1: pi/4, theta: {kind: line, start: 0, end: 1, duration: 5}}, "
        "weights: {q1: 3}}",
        nmm.PreferredPosture({"q1": np.pi / 4, "theta": nmm.Line([0], [1], 5)}, {"q1": 3.0}),
    ),
    ("{kind: alignment, along: pi/3}", nmm.Alignment(np.pi / 3)),
    ("{kind: alignment, along: [1, 2], offset: pi}", nmm.Alignment([1, 2], offset=np.pi)),
    ("{kind: alignment, at: ee, of: {theta: 1, q1: 1}}", nmm.Alignment(at="ee", of={"theta": 1, "q1": 1})),
    (
        "{kind: alignment, along: {kind: velocity, of: {kind: circle, center: [0, 0], radius: 1, rate: 1}}}",
        nmm.Alignment(nmm.VelocityOf(nmm.Circle([0, 0], 1, 1))),
    ),
    (
        "{kind: limit_barrier, joints: [q1], lower: [-2], upper: [2], margin: 0.05}",
        nmm.LimitBarrier(["q1"], [-2], [2], 0.05),
    ),
    (
        "{kind: weighted_manipulability, frame: ee, rows: xy, alpha: 0.2, weights: {platform: 4}}",
        -nmm.WeightedManipulability("ee", "xy", 0.2, {"platform": 4}),
    ),
    (
        "{kind: directional_manipulability, frame: ee, rows: xy, direction: [1, -1], weight: 2}",
        -2 * nmm.DirectionalManipulability("ee", [1, -1], "xy"),
    ),
    (
        "{kind: inverse_condition, frame: ee, rows: [x, rz], length: 0.5, of: arm}",
        -nmm.InverseCondition("ee", ["x", "rz"], "arm", length=0.5),
    ),
    ("{kind: potential_energy, gravity: [1, 0, -9]}", nmm.PotentialEnergy([1, 0, -9])),
    (
        "{kind: manipulability, frame: ee, rows: xy, weight: {kind: line, start: 0, end: 2, duration: 1}}",
        -(nmm.Line([0], [2], 1) * nmm.Manipulability("ee", "xy")),
    ),
    (
        "{kind: quadratic, terms: [{of: q1, target: {kind: polynomial, coefficients: [[1], [2]], "
        "duration: 3}}]}",
        nmm.Quadratic(nmm.QuadraticTerm("q1", nmm.Polynomial([[1], [2]], 3))),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), SAID)
def test_scenarios_say_the_same(
    robot_2r: nmm.Robot, tmp_path: Path, text: str, expected: nmm.extending.Objective
) -> None:
    objective = posed(text)(tmp_path)
    assert objective is not None
    here = nmm.Configuration(robot_2r, [0.1, -0.3, 0.5, 0.7, 1.1])
    for t in (0.0, 0.7):
        assert objective.value(here, t) == expected.value(here, t)
        assert np.array_equal(objective.gradient(here, t), expected.gradient(here, t))


def made(objective: Callable[[], nmm.extending.Objective]) -> Callable[[Path], object]:
    return lambda _: objective().value(nmm.Configuration(loaded("unicycle_2r"), np.zeros(5)))


REFUSED: list[tuple[Callable[[Path], object], str]] = [
    (made(lambda: nmm.InverseCondition("hand", "xy")), "unknown frame 'hand'"),
    (made(lambda: nmm.DirectionalManipulability("hand", [1, 0], "xy")), "unknown frame 'hand'"),
    (made(lambda: nmm.DirectionalManipulability("ee", [0, 0], "xy")), "direction: expected a vector that is"),
    (made(lambda: nmm.DirectionalManipulability("ee", [1, 0, 0], "xy")), "direction: expected 2 components"),
    (made(lambda: nmm.InverseCondition("ee", "xyz", "arm")), "condition number of the arm: expected"),
    (made(lambda: nmm.Manipulability("ee", "xyz", "platform")), "of the platform: expected at most 2 rows"),
    (made(lambda: nmm.InverseCondition("ee", "x")), "expected at least two"),
    (made(lambda: nmm.InverseCondition("ee", "xx")), "each once"),
    (made(lambda: nmm.InverseCondition("ee", "xy", length=0.0)), "length: expected a number above 0"),
    (made(lambda: nmm.Manipulability("ee", "xy", weights={"leg": 2.0})), "unknown input or group 'leg'"),
    (made(lambda: nmm.Manipulability("ee", "xy", weights={"arm": -1})), "weights: q1: expected a number"),
    (made(lambda: nmm.Manipulability("ee", "xy", weights=[1, 2])), "weights: expected 4 numbers"),
    (made(lambda: nmm.WeightedManipulability("ee", "xy", 1.5)), "alpha: expected a number from 0 to 1"),
    (made(nmm.LimitBarrier), "limit barrier: unicycle_2r has no coordinate with two limits"),
    (made(lambda: nmm.LimitBarrier(["q1"])), "limit barrier: q1: unicycle_2r has no limits"),
    (made(lambda: nmm.LimitBarrier(["q1"], [1], [1])), "q1: expected lower below upper"),
    (made(lambda: nmm.LimitBarrier(margin=0.5)), "margin: expected a number above 0 and below 0.5"),
    (made(lambda: nmm.PreferredPosture({})), "posture: expected values of coordinates by name"),
    (made(lambda: nmm.PreferredPosture({"q9": 1.0})), "unknown coordinate 'q9'"),
    (made(lambda: nmm.PreferredPosture({"q1": 1.0}, {"q2": 1.0})), "weights: unknown coordinate 'q2'"),
    (made(lambda: nmm.PreferredPosture({"q1": 1.0}, {"q1": 0.0})), "weights: q1: expected a number above 0"),
    (made(lambda: nmm.PreferredPosture({"q1": nmm.Circle([0, 0], 1, 1)})), "target of q1: expected one row"),
    (made(lambda: nmm.PreferredPosture({"q1": np.nan})), "posture: q1: target: expected finite"),
    (made(nmm.Alignment), "expected either along, a direction, or at, a point"),
    (made(lambda: nmm.Alignment(0.0, at=[1, 2])), "expected either along, a direction, or at, a point"),
    (made(lambda: nmm.Alignment([0.0, 0.0])), "along: expected a direction with x or y"),
    (made(lambda: nmm.Alignment(at="hand")), "unknown frame 'hand'"),
    (made(lambda: nmm.Alignment(at=nmm.Heading("ee"))), "at: expected a point with x and y in m"),
    (made(lambda: nmm.Alignment([1, 2, 3, 4])), "along: expected an angle in rad, or a direction"),
    (made(lambda: nmm.Alignment(0.0, of="psi")), "unknown coordinate 'psi'"),
    (made(lambda: nmm.PotentialEnergy([0, 0, 0])), "gravity: expected a vector that is not zero"),
    (made(lambda: nmm.Circle([0, 0], 1, 1) * nmm.PotentialEnergy()), "weight: expected a function of one"),
    (made(lambda: WeightedSum((1.0, nmm.Position("ee")))), "expected terms of one row"),
    (lambda _: nmm.VelocityOf(nmm.Position("ee")), "of: expected a circle without run_up, line, "),
    (posed("{kind: posture, posture: {q1: [1, 2]}}"), "target of q1: expected one row"),
    (posed("{kind: posture, posture: {q1: fast}}"), "posture.q1.*expected a number"),
    (posed("{kind: potential_energy, weight: -1}"), "objective.weight: expected a number above 0"),
    (posed("{kind: potential_energy, weight: heavy}"), "objective.weight: .*expected a number"),
    (
        posed("{kind: potential_energy, weight: {kind: circle, center: [0, 0], radius: 0, rate: 1}}"),
        "objective.weight.radius: expected a number above 0",
    ),
    (
        posed("{kind: potential_energy, weight: {kind: circle, center: [0, 0], radius: 1, rate: 1}}"),
        "objective.weight: .*expected a function of one row, got ",
    ),
    (
        posed("{kind: quadratic, terms: [{of: q1, target: {kind: heading, frame: hand}}]}"),
        "objective.terms.0.target.frame: .*unknown frame 'hand'",
    ),
    (posed("{kind: alignment, at: hand}"), "objective.at.*unknown frame 'hand'"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_bad_input_is_refused_in_one_line(
    call: Callable[[Path], object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(nmm.InputError) as caught:
        call(tmp_path)
    assert re.search(message, str(caught.value)), str(caught.value)
    assert "\n" not in str(caught.value)
