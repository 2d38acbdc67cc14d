"""The paper's claims (section VI), asserted on runs of the bundled scenarios at dt = 5 ms.

Bounds are stated beside what they bound, and what is the integrator's is shown to be so: it falls with
the fourth power of the step.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from nmm.motion.trajectory import Trajectory
from nmm.scenario import Scenario

SCENARIOS = {
    1: "unicycle_2r_position",
    2: "unicycle_2r_pointing",
    3: "unicycle_2r_link_pointing",
    4: "unicycle_3r_position",
}
RUNS = [(case, resolver) for case in SCENARIOS for resolver in ("rg", "pg")]
K, ALPHA = 1.0, 10.0
D, L1, L2 = 0.3, 0.5, 0.3

#: Largest departure from e(0) exp(-K t) at 5 ms, per case and resolver, in m and rad: what RK4 leaves in the
#: initial transient, where RG turns at up to 34 rad/s in case 3. Measured 0.7 times as much or less.
DEPARTURE = {
    (1, "rg"): 3e-9,
    (1, "pg"): 3e-9,
    (2, "rg"): 4e-7,
    (2, "pg"): 6e-10,
    (3, "rg"): 4e-6,
    (3, "pg"): 1e-6,
    (4, "rg"): 4e-8,
    (4, "pg"): 2e-8,
}


@cache
def run(case: int, resolver: str, dt: float = 0.005) -> Trajectory:
    trajectory = Scenario.load(SCENARIOS[case], {"dt": dt}).with_resolver(resolver).run()
    assert trajectory.complete, trajectory.message
    assert trajectory.t[-1] == 25.0
    return trajectory


def steady(trajectory: Trajectory) -> np.ndarray:
    """H in the second half of the run."""
    return trajectory.objective[trajectory.t >= 12.5]


def departure(trajectory: Trajectory) -> np.ndarray:
    """e(t) - e(0) exp(-K t), (N, s)."""
    return trajectory.error - trajectory.error[0] * np.exp(-K * trajectory.t)[:, None]


def settling_time(trajectory: Trajectory, fraction: float) -> float:
    """When H falls below a fraction of H(0) for good, s."""
    last = np.flatnonzero(trajectory.objective > fraction * trajectory.objective[0])[-1]
    return np.inf if last == len(trajectory) - 1 else float(trajectory.t[last + 1])


@pytest.mark.parametrize(("case", "resolver"), RUNS)
def test_error_decays_as_exp_minus_Kt(case: int, resolver: str) -> None:
    coarse, fine = (np.abs(departure(run(case, resolver, dt))).max() for dt in (0.005, 0.0025))
    assert coarse < DEPARTURE[case, resolver]
    # What departs is the integrator's: a sixteenth with half the step.
    assert 12.0 < coarse / fine < 20.0


@pytest.mark.parametrize(("case", "resolver"), RUNS)
def test_error_ends_at_the_integrators_precision(case: int, resolver: str) -> None:
    """After 25 s, exp(-25) of the initial error is left, 1.5e-11 to 5e-11, and 1.4e-12 of RK4's own."""
    coarse, fine = (run(case, resolver, dt) for dt in (0.005, 0.0025))
    assert coarse.error_norm[-1] < 5e-11
    ends = [float(np.linalg.norm(departure(trajectory)[-1])) for trajectory in (coarse, fine)]
    assert ends[0] < 2e-12
    assert ends[1] < 0.25 * ends[0]


@pytest.mark.parametrize(("case", "resolver"), RUNS)
def test_curves_do_not_change_below_5_ms(case: int, resolver: str) -> None:
    """Against 2.5 ms: 2e-5 m or rad in any coordinate, 1e-5 in H; 1e-6 once the transient is over."""
    coarse, fine = run(case, resolver), run(case, resolver, 0.0025)
    moved = np.abs(coarse.q - fine.q[::2]).max(axis=1)
    minimised = np.abs(coarse.objective - fine.objective[::2])
    assert moved.max() < 2e-5
    assert minimised.max() < 1e-5
    after = coarse.t > 2.0
    assert moved[after].max() < 1e-6
    assert minimised[after].max() < 1e-6


@pytest.mark.parametrize("case", SCENARIOS)
def test_rg_holds_h_closer_to_its_minimum_than_pg(case: int) -> None:
    rg, pg = run(case, "rg"), run(case, "pg")
    assert steady(rg).mean() <= steady(pg).mean()
    assert steady(rg).max() <= steady(pg).max()


@pytest.mark.parametrize("case", SCENARIOS)
def test_rg_approaches_the_minimum_faster(case: int) -> None:
    assert settling_time(run(case, "rg"), 0.01) < settling_time(run(case, "pg"), 0.01)


def test_case_1_rg_keeps_a_lower_ripple() -> None:
    assert np.ptp(steady(run(1, "rg"))) < 0.5 * np.ptp(steady(run(1, "pg")))


@pytest.mark.parametrize("resolver", ["rg", "pg"])
def test_case_1_platform_backs_up_first(resolver: str) -> None:
    trajectory = run(1, resolver)
    v = trajectory.u[:, trajectory.robot.u_names.index("v")]
    assert np.all(v[trajectory.t < 1.5] < 0.0)
    assert np.all(v[trajectory.t > 2.0] > 0.0)


def test_case_2_h_decays_as_exp_minus_2_alpha_t() -> None:
    departures = []
    for dt in (0.01, 0.005, 0.0025):
        trajectory = run(2, "rg", dt)
        exact = trajectory.objective[0] * np.exp(-2.0 * ALPHA * trajectory.t)
        departures.append(float(np.abs(trajectory.objective - exact).max()))
    assert departures[1] < 4e-8
    orders = np.log2(np.divide(departures[:-1], departures[1:]))
    np.testing.assert_allclose(orders, 4.0, atol=0.25)


def test_case_2_rg_keeps_the_absolute_minimum() -> None:
    """To rounding: q2 stops where RK4's largest increment, α dt/3 of the distance left, rounds to nothing."""
    stops_at = 0.5 * np.spacing(np.pi / 2) / (ALPHA * 0.005 / 3.0)
    assert steady(run(2, "rg")).max() <= 0.5 * stops_at**2
    assert steady(run(2, "pg")).max() > 1e-3


@pytest.mark.parametrize("case", SCENARIOS)
def test_no_switch_of_partition_in_the_published_motions(case: int) -> None:
    trajectory = run(case, "rg")
    assert trajectory.switches == 0
    names = {trajectory.robot.u_names[column] for column in trajectory.partition[0]}
    chosen = {1: {"v", "omega"}, 2: {"v", "omega", "q1"}, 3: {"v", "omega", "q1"}, 4: {"v", "omega", "q2"}}
    assert names == chosen[case]


def test_case_1_minors_stay_far_from_the_threshold() -> None:
    """Δ12 of eq. (15), the one in use, stays above 0.35 m; Θ is 0.01."""
    q1, q2 = run(1, "rg").q[:, 3:].T
    minor_12 = D + L1 * np.cos(q1) + L2 * np.cos(q1 + q2)
    assert np.abs(minor_12).min() > 0.35


def test_case_3_block_of_j_bar_stays_nonsingular() -> None:
    """Δ_bar123 = d (ρ - l2 cos(θ + q1 + q2 - γ)) / ρ stays above 0.23, and is the determinant inverted."""
    trajectory = run(3, "rg")
    x, y, theta, q1, q2 = trajectory.q.T
    to_target = np.array(
        [
            6.0 - (x + D * np.cos(theta) + L1 * np.cos(theta + q1)),
            2.0 - (y + D * np.sin(theta) + L1 * np.sin(theta + q1)),
        ]
    )
    rho, gamma = np.hypot(*to_target), np.arctan2(to_target[1], to_target[0])
    minor = D * (rho - L2 * np.cos(theta + q1 + q2 - gamma)) / rho
    assert 0.23 < minor.min() < 0.232
    controller = Scenario.load(SCENARIOS[3]).controller()
    for k in range(0, len(trajectory), 250):
        step = controller.evaluate(trajectory.t[k], trajectory.q[k])
        assert abs(np.linalg.det(step.J[:, :3])) == pytest.approx(minor[k], abs=1e-12)


@pytest.mark.parametrize("resolver", ["rg", "pg"])
@pytest.mark.parametrize("case", [3, 4])
def test_theta_passes_11_rad_without_a_jump(case: int, resolver: str) -> None:
    theta = run(case, resolver).q[:, 2]
    assert theta.max() > 11.0
    assert np.abs(np.diff(theta)).max() < 0.2


@pytest.mark.parametrize(("case", "resolver"), RUNS)
def test_no_lateral_velocity(case: int, resolver: str) -> None:
    """-sin θ x_dot + cos θ y_dot of the velocity that the closed loop integrates, m/s."""
    trajectory = run(case, resolver)
    controller = Scenario.load(SCENARIOS[case]).with_resolver(resolver).controller()
    for t, q in zip(trajectory.t[::10], trajectory.q[::10], strict=True):
        x_dot, y_dot = controller.velocity(t, q)[:2]
        assert abs(-np.sin(q[2]) * x_dot + np.cos(q[2]) * y_dot) <= 1e-12


def test_zero_order_hold_drives_along_arcs() -> None:
    """With constant inputs the chord of each step points halfway between both headings."""
    q = Scenario.load(SCENARIOS[1], {"method": "zoh"}).run().q
    moved = np.diff(q[:, :2], axis=0)
    middle = 0.5 * (q[1:, 2] + q[:-1, 2])
    sideways = (-np.sin(middle) * moved[:, 0] + np.cos(middle) * moved[:, 1]) / 0.005
    assert np.abs(sideways).max() <= 1e-12


@pytest.mark.parametrize(("case", "resolver"), RUNS)
def test_inputs_do_what_the_task_asks(case: int, resolver: str) -> None:
    assert run(case, resolver).residual.max() < 1e-10


@cache
def beginning(method: str, dt: float, tolerance: float = 1e-13) -> np.ndarray:
    """q of case 1's first two seconds, every 40 ms."""
    settings = {"method": method, "dt": dt, "tolerance": tolerance, "duration": 2}
    return Scenario.load(SCENARIOS[1], settings).run().q[:: round(0.04 / dt)]


@pytest.mark.parametrize(
    ("method", "order", "steps"),
    [
        ("euler", 1, (0.01, 0.005, 0.0025)),
        ("midpoint", 2, (0.01, 0.005, 0.0025)),
        ("rk4", 4, (0.02, 0.01, 0.005)),
        ("zoh", 1, (0.01, 0.005, 0.0025)),
    ],
)
def test_observed_order(method: str, order: int, steps: tuple[float, ...]) -> None:
    exact = beginning("adaptive", 0.04)
    errors = [float(np.abs(beginning(method, dt) - exact).max()) for dt in steps]
    observed = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(observed, order, atol=0.1)


def test_adaptive_agrees_with_a_small_step() -> None:
    apart = np.abs(beginning("adaptive", 0.04, 1e-9) - beginning("rk4", 0.001)).max()
    assert apart < 1e-9
