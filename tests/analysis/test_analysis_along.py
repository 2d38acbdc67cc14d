"""Singularity analysis along a motion: the same as at its samples, and the instants of known motions."""

from __future__ import annotations

import numpy as np
import pytest
from analysed import HELD, TIP, extended
from numpy import pi
from numpy.typing import NDArray
from paper_cases import CASES

from nmm.analysis import analyse, analyse_along
from nmm.base.errors import InputError
from nmm.control.controller import Controller
from nmm.control.functions.tasks import Position
from nmm.control.resolvers import ProjectedGradient
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot
from nmm.motion.simulation import simulate

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def no_offset() -> Robot:
    """unicycle_2r with its arm on the axle, d = 0."""
    return load("unicycle_2r", arguments={"d": 0.0})


def test_along_a_trajectory_is_the_same_as_at_its_samples() -> None:
    case = CASES[2]
    robot = load(case.robot)
    trajectory = simulate(case.controller(robot), case.q0, 2.0, 0.01)
    history = analyse_along(case.controller(robot), trajectory, length=0.5)
    plain = analyse_along((robot, case.tasks), trajectory.t, trajectory.q, minors=["omega, v, q1"])
    np.testing.assert_allclose(plain.sigma_min["robot"], trajectory.sigma_min, atol=1e-14)
    np.testing.assert_allclose(plain.minors["v, omega, q1"], history.minors["v, omega, q1"], atol=1e-14)
    np.testing.assert_array_equal(plain.minors["v, omega, q1"], -plain.minors.array[:, 0])
    for k in range(0, len(trajectory.t), 40):
        report = analyse(case.controller(robot), trajectory.q[k], trajectory.t[k], length=0.5)
        np.testing.assert_allclose(history.J[k], report.J, atol=1e-14)
        np.testing.assert_allclose(history.minors.array[k], report.minors.array, atol=1e-14)
        np.testing.assert_allclose(history.ratios[k], report.partitions.ratios, atol=1e-12)
        assert history.rank[k] == report.rank
        assert history.condition[k] == pytest.approx(report.condition)
        for name, part in report.parts.items():
            assert history.sigma_min[name][k] == pytest.approx(part.sigma_min, abs=1e-14)


def sweep(samples: int, **rates: tuple[float, float]) -> tuple[Array, Array]:
    """Times from 0 to 1 s and coordinates that run from one value to another."""
    t = np.linspace(0.0, 1.0, samples)
    names = ("x", "y", "theta", "q1", "q2")
    ends = [rates.get(name, (0.0, 0.0)) for name in names]
    return t, np.column_stack([np.linspace(*pair, samples) for pair in ends])


@pytest.mark.parametrize("samples", [30, 101])
def test_instants_of_a_known_motion(samples: int, no_offset: Robot) -> None:
    """q1 from 0 to 3, the arm stretched, d = 0: every minor of v with another vanishes at q1 = pi/2."""
    t, q = sweep(samples, q1=(0.0, 3.0))
    history = analyse_along((no_offset, TIP), t, q)
    instant = pi / 6
    second_order = 2.0 / samples**2
    columns = {crossing.columns for crossing in history.crossings}
    assert columns == {("v", "omega"), ("v", "q1"), ("v", "q2")}  # the others are zero to rounding
    for crossing in history.crossings:
        assert crossing.t == pytest.approx(instant, abs=second_order)
        assert crossing.sign == -1
        assert crossing.after == crossing.before + 1
    (dip,) = history.dips
    assert dip.t == pytest.approx(instant, abs=1e-6)
    assert dip.value < 1e-6
    assert not dip.at_end
    assert abs(t[dip.index] - instant) <= 1.0 / (samples - 1)
    # Between samples it is found too, whatever these say: at none of them σ_min is that low.
    assert history.sigma_min["robot"].min() > 1e-3
    (low,) = analyse_along((no_offset, TIP), t, q, threshold=1e-3).dips
    assert low.t == pytest.approx(instant, abs=1e-6)


def test_a_motion_that_rests_or_ends_at_a_singularity(no_offset: Robot) -> None:
    t, q = sweep(50, q1=(0.5, pi / 2))
    (dip,) = analyse_along((no_offset, TIP), t, q).dips
    assert (dip.t, dip.index, dip.at_end) == (1.0, 49, True)
    (other,) = analyse_along((no_offset, TIP), t, q[::-1]).dips
    assert (other.t, other.index, other.at_end) == (0.0, 0, True)
    rest = analyse_along((no_offset, TIP), t, np.tile(q[-1], (50, 1)))
    assert len(rest.dips) == 1
    assert rest.crossings == ()
    assert np.all(rest.rank == 1)
    assert np.all(np.isinf(rest.condition))
    # Where a minor rests at zero between two signs, the instant is the middle of the rest.
    q1 = np.concatenate([np.linspace(1.0, pi / 2, 10), np.full(11, pi / 2), np.linspace(pi / 2, 2.0, 10)])
    q = np.column_stack([np.zeros((31, 3)), q1, np.zeros(31)])
    crossing = analyse_along((no_offset, TIP), np.arange(31.0), q, minors=["v, q1"]).crossings
    assert [c.t for c in crossing] == [(9 + 21) / 2]


def test_a_regular_motion_has_no_dips(robot_2r: Robot) -> None:
    t, q = sweep(40, q1=(0.0, 3.0))
    assert analyse_along((robot_2r, TIP), t, q).dips == ()


def test_ej_along_a_motion(robot_2r: Robot) -> None:
    t, q = sweep(41, q1=(1.5, 3.0))
    history = analyse_along(extended(HELD, robot_2r), t, q)
    assert history.dips == ()
    (dip,) = history.extended_dips
    assert dip.t == pytest.approx((np.arccos(-0.6) - 1.5) / 1.5, abs=1e-6)
    assert dip.value < 1e-6


def test_an_input_that_only_rounding_feels_crosses_nothing() -> None:
    """The last joint of an arm turns about the tip's own axis: its column is 1e-16, of any sign."""
    robot = load("small_arm", platform="fixed")
    t = np.arange(200.0)
    q = np.array([0.3, 0.5, 0.1, 0.4, 0.2]) + np.linspace(-0.4, 0.7, 200)[:, np.newaxis] * [1, 0.2, 1, 0.3, 1]
    history = analyse_along((robot, Position("ee")), t, q)
    felt = [c for c in history.crossings if "q5" in c.columns]
    assert 0.0 < np.abs(history.J[..., -1]).max() < 1e-14
    assert felt == []
    assert history.crossings != ()


def test_wrong_motions(robot_2r: Robot) -> None:
    t, q = sweep(5)
    for given, message in (
        ((t,), "got no q"),
        ((t, q[:4]), "a row of 5 numbers"),
        ((t, q[:, :4]), "a row of 5 numbers"),
        ((t[::-1], q), "increasing"),
        (([], np.zeros((0, 5))), "a row of 5 numbers"),
    ):
        with pytest.raises(InputError, match=message):
            analyse_along((robot_2r, TIP), *given)
    trajectory = simulate(Controller(robot_2r, TIP, ProjectedGradient()), [0.1] * 5, 0.1, 0.05)
    with pytest.raises(InputError, match="a trajectory alone"):
        analyse_along((robot_2r, TIP), trajectory, trajectory.q)
    with pytest.raises(InputError, match="unknown input 'w'"):
        analyse_along((robot_2r, TIP), t, q, minors=["v, w"])
