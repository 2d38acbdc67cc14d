"""Dynamics against what shares no code with it: constraints of contact points, energy, momentum, gravity."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from places import UR5

import nmm
from nmm.base.arrays import Array
from nmm.base.convex_hull import convex_corners
from nmm.cli.torques import torques
from nmm.model.dynamics.support import Support
from nmm.model.dynamics.torques import accelerations, torques_along
from nmm.motion.table import summary_rows
from nmm.views.playback.channels import channels, events

G = 9.81


@cache
def robot_of(name: str) -> nmm.Robot:
    base, _, arm = name.partition("+")
    if base.startswith("tiago"):
        return nmm.Scenario.load("tiago_pose").robot()
    robot = nmm.load(base)
    return nmm.mount(robot, nmm.load({"ur5": UR5}.get(arm, arm)), prefix=f"{arm}_") if arm else robot


ROLLING = [
    "unicycle_2r", "unicycle_3r", "differential_base+ur5", "car_base", "car_base+ur5", "trailer_base",
    "trailer_base+small_arm", "tiago", "omni_base+ur5",
]  # fmt: skip
ALL = [*ROLLING, "small_arm"]


def moving(robot: nmm.Robot, rng: np.random.Generator, count: int) -> tuple[Array, Array, Array]:
    q = robot.following.placed(rng.uniform(-0.3, 0.3, (count, robot.n)))
    return q, rng.normal(size=(count, robot.n_u)), rng.normal(size=(count, robot.n_u))


@pytest.mark.parametrize("name", ALL)
def test_mass_matrix_and_bias_are_inverse_dynamics(name: str, rng: np.random.Generator) -> None:
    robot = robot_of(name)
    dynamics = nmm.Dynamics(robot)
    q, u, u_dot = moving(robot, rng, 5)
    f = dynamics.inverse(q, u, u_dot)
    for k in range(5):
        M = dynamics.M(q[k])
        np.testing.assert_allclose(M, M.T, atol=1e-12)
        assert np.linalg.eigvalsh(M)[0] > 0.0
        np.testing.assert_allclose(M @ u_dot[k] + dynamics.h(q[k], u[k]), f[k], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_motors_do_the_work_of_the_inputs(name: str, rng: np.random.Generator) -> None:
    robot = robot_of(name)
    dynamics = nmm.Dynamics(robot)
    q, u, u_dot = moving(robot, rng, 5)
    f = dynamics.inverse(q, u, u_dot)
    work = dynamics.actuators.torques(q, f) * dynamics.actuators.rates(q, u)
    np.testing.assert_allclose(work.sum(axis=1), np.sum(f * u, axis=1), rtol=1e-12, atol=1e-12)


class Contacts:
    """Rows A(Q) Q_dot = 0 of a robot's display model: what touches the ground is at rest there."""

    def __init__(self, robot: nmm.Robot, dynamics: nmm.Dynamics) -> None:
        self.robot, self.model, self.still = robot, dynamics.model, dynamics.left_out
        self.data = self.model.createData()

    def column(self, name: str) -> int:
        return int(self.model.joints[self.model.getJointId(name)].idx_v)

    def rows(self, Q: Array) -> Array:
        model, data, robot = self.model, self.data, self.robot
        pin.computeJointJacobians(model, data, Q)
        rows = [np.eye(model.nv)[self.column(name)] for name in self.still]
        for wheel in robot.wheels:
            joint = model.getJointId(wheel.joint)
            J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
            at_contact = J[:3] - pin.skew(np.array([0.0, 0.0, -wheel.radius])) @ J[3:]
            if wheel.roller:  # it is at rest along the axis of the roller that is on the ground
                axis = data.oMi[joint].rotation @ axis_of(model, joint)
                ahead, (c, s) = np.cross(axis, [0.0, 0.0, 1.0]), (np.cos(wheel.roller), np.sin(wheel.roller))
                rows.append((c * ahead + s * axis) @ at_contact)
            elif wheel.joint not in self.still:
                rows += [*at_contact[:2]]
            elif not wheel.swivel:  # of a trailer: held, it still moves no way across
                axis = data.oMi[joint].rotation @ axis_of(model, joint)
                rows.append(axis @ J[:3])
        for name, pivot in {
            w.swivel: w.pivot for w in robot.wheels if w.swivel not in ("", *self.still)
        }.items():
            steering, L, (x, y, _) = self.column("steering"), robot.platform.lengths["wheelbase"], pivot
            # It points across the line from (0, L / tan δ), about which the car turns.
            tangent = np.tan(Q[steering])
            slope = x * L * (1.0 + tangent**2) / ((L - y * tangent) ** 2 + (x * tangent) ** 2)
            row = np.eye(model.nv)[self.column(name)]
            row[steering] = -slope
            rows.append(row)
        for one in robot.mimic_joints:
            row = np.zeros(model.nv)
            row[self.column(one.joint)], row[self.column(one.leader)] = 1.0, -one.multiplier
            rows.append(row)
        return np.array(rows)


def axis_of(model: pin.Model, joint: int) -> Array:
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, pin.neutral(model))
    return np.array(data.S).reshape(6)[3:]


@pytest.mark.parametrize("name", ROLLING)
def test_the_torques_move_a_robot_on_rolling_contacts_as_asked(name: str, rng: np.random.Generator) -> None:
    """Forward dynamics of all joints, M Q_ddot + nle = B tau + Aᵀ c, with A written from contact points."""
    robot = robot_of(name)
    dynamics = nmm.Dynamics(robot)
    contacts = Contacts(robot, dynamics)
    model, data, actuators = dynamics.model, dynamics.model.createData(), dynamics.actuators
    q, u, u_dot = moving(robot, rng, 4)
    motions = dynamics.motions(q, u, u_dot)
    torques = actuators.torques(q, dynamics.inverse(q, u, u_dot))
    for k, (Q, Q_dot, Q_ddot) in enumerate(zip(*motions, strict=True)):
        A = contacts.rows(Q)
        np.testing.assert_allclose(A @ Q_dot, 0.0, atol=1e-9)
        h = 1e-3  # of order 4
        near, far = (contacts.rows(Q + k * h * Q_dot) - contacts.rows(Q - k * h * Q_dot) for k in (1, 2))
        A_dot = (8.0 * near - far) / (12.0 * h)
        forces = np.zeros(model.nv)
        forces[[contacts.column(one) for one in actuators.names]] = torques[k]
        M = np.triu(pin.crba(model, data, Q))
        M += np.triu(M, 1).T
        bias = pin.nonLinearEffects(model, data, Q, Q_dot)
        nothing = np.zeros((len(A), len(A)))
        both = np.block([[M, A.T], [A, nothing]])
        found = np.linalg.lstsq(both, np.concatenate([forces - bias, -A_dot @ Q_dot]), rcond=1e-12)[0]
        np.testing.assert_allclose(found[: model.nv], Q_ddot, rtol=1e-8, atol=2e-8)


@pytest.mark.parametrize("name", ["unicycle_3r", "car_base+ur5"])
def test_free_motion_keeps_its_energy_with_the_order_of_the_integrator(name: str) -> None:
    robot = robot_of(name)
    dynamics = nmm.Dynamics(robot)
    model, data = dynamics.model, dynamics.model.createData()

    def rate(x: Array) -> Array:
        q, u = x[: robot.n], x[robot.n :]
        return np.concatenate([robot.S(q) @ u, -np.linalg.solve(dynamics.M(q), dynamics.h(q, u))])

    def energy(x: Array) -> float:
        q, u = x[: robot.n], x[robot.n :]
        Q = dynamics.motions(q[np.newaxis], u[np.newaxis], 0.0 * u[np.newaxis])[0][0]
        return float(0.5 * u @ dynamics.M(q) @ u + pin.computePotentialEnergy(model, data, Q))

    start = np.concatenate([robot.rest, np.linspace(0.3, 0.6, robot.n_u)])
    errors = []
    for steps in (40, 80):
        x, h = start.copy(), 0.4 / steps
        for _ in range(steps):
            a = rate(x)
            b = rate(x + 0.5 * h * a)
            c = rate(x + 0.5 * h * b)
            d = rate(x + h * c)
            x += h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        errors.append(abs(energy(x) - energy(start)))
    assert 0.0 < errors[0] < 1e-2
    assert errors[0] / errors[1] > 10.0  # 16 at order 4


def test_a_standing_arm_carries_its_weight(rng: np.random.Generator) -> None:
    robot, alone = robot_of("differential_base+ur5"), nmm.load(UR5, platform="fixed")
    q = rng.uniform(-1.0, 1.0, alone.n)
    f = nmm.Dynamics(robot).h(np.concatenate([np.zeros(3), q]), np.zeros(robot.n_u))
    data = alone.model.createData()
    np.testing.assert_allclose(f[2:], pin.computeGeneralizedGravity(alone.model, data, q), atol=1e-10)
    np.testing.assert_allclose(f[:2], 0.0, atol=1e-10)  # on level ground


def test_a_load_weighs_as_much_as_its_lever_says() -> None:
    robot = robot_of("unicycle_3r")
    place = [0.1, 0.0, 0.0]
    q, still = robot.q({"q2": -0.4, "q3": 0.7}), np.zeros(robot.n_u)
    plain, loaded = nmm.Dynamics(robot), nmm.Dynamics(robot, payload={"ee": (2.0, place)})
    here = nmm.Configuration(robot, q)
    J = here.jacobian("ee")
    lever = here.placement("ee").rotation @ place
    lift = J[2] + np.cross(J[3:].T, lever)[:, 2]
    np.testing.assert_allclose(loaded.h(q, still) - plain.h(q, still), 2.0 * G * lift @ robot.S(q), atol=1e-9)


@pytest.mark.parametrize(
    "payload", [{"ee": -1.0}, {"eee": 1.0}, {"ee": "much"}, {"ee": (1.0, [0.0, 1.0])}, {"ee": float("nan")}]
)
def test_what_is_no_load_is_refused(payload: dict[str, object]) -> None:
    with pytest.raises(nmm.InputError):
        nmm.Dynamics(robot_of("unicycle_3r"), payload=payload)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["differential_base+ur5", "car_base+ur5", "trailer_base+small_arm"])
def test_the_zero_moment_point_is_that_of_momentum(name: str, rng: np.random.Generator) -> None:
    """At rest below the centre of mass; in motion, where the rate of momentum says that the ground pushes."""
    robot = robot_of(name)
    dynamics, support = nmm.Dynamics(robot), Support(robot)
    q, u, u_dot = moving(robot, rng, 3)
    still = np.zeros_like(u)
    found = support.zero_moment(dynamics.forces(q, still, still)[1])
    model, data = dynamics.model, dynamics.model.createData()
    for k, Q in enumerate(dynamics.motions(q, still, still)[0]):
        np.testing.assert_allclose(found[k], pin.centerOfMass(model, data, Q)[:2], atol=1e-9)
    found = support.zero_moment(dynamics.forces(q, u, u_dot)[1])
    for k, (Q, Q_dot, Q_ddot) in enumerate(zip(*dynamics.motions(q, u, u_dot), strict=True)):
        pin.computeCentroidalMomentumTimeVariation(model, data, Q, Q_dot, Q_ddot)
        F = data.dhg.linear - data.mass[0] * model.gravity.linear
        com = data.com[0] - [0.0, 0.0, support.height]
        M = np.cross(com, F) + data.dhg.angular  # about the ground below the world's origin
        np.testing.assert_allclose(found[k], [-M[1] / F[2], M[0] / F[2]], atol=1e-9)


def test_the_margin_is_the_distance_to_the_nearest_edge() -> None:
    robot = robot_of("differential_base+ur5")
    support = Support(robot)
    q = robot.q({"x": 1.0, "y": -2.0, "theta": 0.7})
    wheels = support.points(q)
    corners = wheels[convex_corners(wheels)]
    middle = corners.mean(axis=0)
    for x, y in ((0.0, 0.0), (0.05, 0.02), (5.0, 0.0)):
        point = middle + np.array([x, y])
        (margin,), _ = support.margins(q[np.newaxis], point[np.newaxis])
        ends = np.roll(corners, -1, axis=0)
        area = lambda a, b, c: np.cross(np.append(b - a, 0.0), np.append(c - a, 0.0))[2]  # noqa: E731
        heights = [area(a, b, point) / np.linalg.norm(b - a) for a, b in zip(corners, ends, strict=True)]
        assert margin == pytest.approx(min(heights), abs=1e-12)
    assert margin < 0.0


def test_a_hull_has_the_outer_points_alone() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5], [0.5, 0.0]])
    assert sorted(convex_corners(square)) == [0, 1, 2, 3]
    area = square[convex_corners(square)]
    ends = np.roll(area, -1, axis=0)
    assert 0.5 * np.sum(area[:, 0] * ends[:, 1] - area[:, 1] * ends[:, 0]) == pytest.approx(1.0)


def test_accelerations_stop_at_jumps() -> None:
    t = np.linspace(0.0, 2.0, 201)
    u = np.column_stack([t**2, np.where(t > 1.0, 3.0, 0.0)])
    u_dot, jumps = accelerations(t, u)
    assert np.flatnonzero(jumps).tolist() == [100]
    np.testing.assert_allclose(
        u_dot[1:-1, 0], np.where(np.isin(np.arange(1, 200), [100, 101]), u_dot[1:-1, 0], 2.0 * t[1:-1])
    )
    np.testing.assert_allclose(u_dot[[100, 101], 0], 2.0 * t[[100, 101]], atol=0.011)
    np.testing.assert_allclose(u_dot[:, 1], 0.0)


def test_the_papers_cases_need_more_than_their_wheels_have() -> None:
    """133 % in case 1 at the start; the finding names the wheel and the time."""
    found = nmm.Scenario.load("unicycle_2r_position").run().torques()
    (one,) = found.findings
    assert (one.code, one.values["actuator"], one.where["t"]) == ("effort_exceeded", "left_wheel_joint", 0.0)
    assert one.values["peak"] / one.values["effort"] == pytest.approx(1.33, abs=0.005)


def test_a_runs_summary_and_page_tell_what_its_motors_lack(tmp_path: Path) -> None:
    """Apart from warnings, in a saved run once, and in its page beside the curve that crosses its limit."""
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.2}).run()
    told = run.summary()
    (found,) = [one for one in told["findings"] if one["line"] == "motors"]
    assert (found["code"], found["values"]["actuator"]) == ("effort_exceeded", "left_wheel_joint")
    assert found["text"] not in told["warnings"]
    row = dict(summary_rows(run, told))["motors beyond their limits"]
    assert row == f"left_wheel_joint {found['values']['peak']:.3g} N m (at most 20)"
    again = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False))
    assert again.summary()["findings"] == told["findings"]
    assert again.verdict.as_json() == run.verdict.as_json()
    shown = channels(run)
    (wheel,) = [one for one in shown.channels if one.name == "torque left_wheel_joint"]
    assert wheel.limits == (-20.0, 20.0)
    assert np.nanmax(np.abs(wheel.values)) == pytest.approx(found["values"]["peak"])
    assert (0.0, found["text"]) in events(run, shown)


def test_a_robot_that_its_arm_pulls_off_the_ground_tips() -> None:
    robot = robot_of("differential_base+ur5")
    q, u = np.tile(robot.rest, (2, 1)), np.zeros((2, robot.n_u))
    u_dot = np.outer([1e4, -1e4], np.eye(robot.n_u)[3])  # one way the shoulder lifts all the rest
    found = torques_along(robot, np.arange(2.0), q, u, u_dot=u_dot)
    off = np.isnan(found.zero_moment).all(axis=1)
    assert off.sum() == 1
    (tips,) = (one for one in found.findings if one.code == "tips")
    assert (tips.values["margin"], tips.where["t"]) == (None, found.t[off][0])
    assert "pull" in str(tips)


def test_where_a_main_body_has_no_mass_nothing_is_said_of_tipping() -> None:
    robot = nmm.load("car_base")
    assert len(Support(robot).names) == 4
    model = robot.display_model
    model.inertias[model.getJointId("theta")] = pin.Inertia.Zero()
    assert Support(robot).names == ()


def test_a_robot_that_reaches_far_with_a_load_tips() -> None:
    robot = robot_of("differential_base+ur5")
    controller = nmm.Controller(
        robot, nmm.Task(nmm.Posture(), np.zeros(robot.n - 3)), nmm.ProjectedGradient()
    )
    run = nmm.simulate(controller, robot.rest, 0.1, 0.01)
    found = run.torques(payload={"ur5_ee_link": 40.0})
    assert [one.code for one in found.findings][-1] == "tips"
    assert found.margins.min() < 0.0
    assert run.torques().findings == ()


@pytest.mark.parametrize(("steps", "is_named"), [(2, True), (100, False)])
def test_a_jump_of_inputs_is_named_as_the_cause_of_tipping(steps: int, is_named: bool) -> None:
    robot = robot_of("differential_base+ur5")
    t, u = np.arange(301) * 0.01, np.zeros((301, robot.n_u))
    u[:, 0] = np.interp(np.arange(301), [150, 150 + steps], [1.0, -steps * 0.2])  # 20 m/s² and more
    q = np.tile(robot.rest, (301, 1))
    found = torques_along(robot, t, q, u)
    (tips,) = (one for one in found.findings if one.code == "tips")
    ((name, change),) = tips.values["jumps"].items() if is_named else ((robot.u_names[0], None),)
    assert name == robot.u_names[0]
    assert change == (pytest.approx(-1.4) if is_named else None)
    assert ("limits.acceleration" in str(tips)) is is_named
    assert bool(tips.values["jumps"]) is is_named


def test_the_command_writes_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = ["duration=0.2"]
    assert torques("unicycle_3r_position", payload=["ee=0.5@0,0,0.1"], settings=settings, as_json=True) == 0
    said = json.loads(capsys.readouterr().out)
    folder = tmp_path / said["folder"]
    rows = np.loadtxt(folder / "torques.csv", delimiter=",", skiprows=1, encoding="utf-8")
    names = (folder / "torques.csv").read_text("utf-8").splitlines()[0].split(",")
    assert names[1] == "left_wheel_joint [N m]"
    peak = said["actuators"]["left_wheel_joint"]["peak"]
    assert np.abs(rows[:, 1]).max() == pytest.approx(peak, rel=1e-12)
    assert json.loads((folder / "summary.json").read_text("utf-8"))["actuators"] == said["actuators"]
    assert (folder / "torques.png").stat().st_size > 1000
    run = nmm.Scenario.load("unicycle_3r_position", {"duration": 0.2}).run()
    assert run.torques(payload={"ee": (0.5, [0.0, 0.0, 0.1])}).peaks[0] == pytest.approx(peak, rel=1e-12)
    assert run.torques().peaks[3] < said["actuators"]["q2"]["peak"]
    run.save("a_run", figures=False)
    assert torques("a_run") == 0
    assert (tmp_path / "runs" / "a_run-torques" / "torques.csv").exists()


@pytest.mark.parametrize("name", ["unicycle_3r", "differential_base+ur5", "small_arm"])
def test_the_figures_last_panel_names_its_time(name: str) -> None:
    robot, t = robot_of(name), np.linspace(0.0, 1.0, 11)
    q = np.tile(robot.rest, (11, 1))
    figure = torques_along(robot, t, q, np.zeros((11, robot.n_u))).plot()
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels == [*[""] * (len(labels) - 1), "time t [s]"]


@pytest.mark.parametrize(
    ("source", "options", "names"),
    [
        ("unicycle_3r", {}, "unicycle_3r"),
        ("no_such_run", {}, "no_such_run"),
        ("unicycle_2r_position", {"payload": ["ee"]}, "--payload"),
        ("unicycle_2r_position", {"payload": ["ee=-1"], "settings": ["duration=0.1"]}, "payload: ee"),
        ("unicycle_2r_position", {"payload": ["ee=1@0,0"], "settings": ["duration=0.1"]}, "payload: ee"),
        ("unicycle_2r_position", {"payload": ["ee=1@0,0,z"]}, "payload: ee"),
        ("unicycle_2r_position", {"payload": ["eee=1"], "settings": ["duration=0.1"]}, "payload"),
    ],
)
def test_the_command_refuses_in_one_line(
    source: str, options: dict[str, list[str]], names: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(nmm.InputError, match=names):
        torques(source, **options)  # type: ignore[arg-type]
    assert not [*tmp_path.iterdir()]
