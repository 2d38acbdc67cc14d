"""Limits that are a class: hand speed, tip-over, a user's own; each against what shares no code with it."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest
from findings import every
from limit_grid import (
    CASES,
    ENTRIES,
    NAMES,
    Array,
    frames_at,
    moving,
    robot_of,
    rows_at,
    sample_at,
    unlimited,
    values_at,
)
from places import ROOT
from scipy.spatial import ConvexHull
from test_compiled_forms import assert_same, both_forms

import nmm
from nmm.base.errors import InputError
from nmm.base.kinds import LIMITS
from nmm.scenario.scenario import Scenario
from nmm.views import figures

DT = 0.01
PG = nmm.ProjectedGradient()
OWN = ROOT / "docs" / "own_kinds"


def test_the_grid_holds_every_kind() -> None:
    assert {entry.kind for entry in ENTRIES} == set(LIMITS)
    for entry in ENTRIES:
        assert type(entry.limit) is LIMITS[entry.kind]


@pytest.mark.parametrize(("limit", "name"), CASES, ids=NAMES)
def test_a_kernel_compiled_gives_what_it_gives_in_python(
    limit: nmm.Limit, name: str, rng: np.random.Generator
) -> None:
    robot = robot_of(name)
    stage = limit.stage(robot)
    for fast in (0.3, 0.0):
        q, u = moving(robot, rng, fast)
        sample, frames = sample_at(robot, q, u, DT), frames_at(robot, q, stage)
        one, other = unlimited(robot, stage), unlimited(robot, stage)
        both_forms((stage.kernel, *((sample, frames, stage.numbers, rows) for rows in (one, other))))
        for plain, made in zip(one, other, strict=True):
            assert_same(plain, made, 1e-12)
        values = np.zeros((2, len(limit.rows(robot))))
        u_dot = rng.normal(size=robot.n_u)
        both_forms((stage.values, *((sample, frames, stage.numbers, u_dot, out) for out in values)))
        assert_same(*values, 1e-12)


# The speed of a hand


def speeds(robot: nmm.Robot, frame: str, q: Array, q_dot: Array) -> Array:
    """(N,), from central differences of where Pinocchio has the frame along q_dot."""
    model, data, h = robot.model, robot.model.createData(), 1e-6
    k = model.getFrameId(frame)

    def place(at: Array) -> Array:
        pin.framesForwardKinematics(model, data, at)
        return np.array(data.oMf[k].translation)

    along = zip(q, q_dot, strict=True)
    return np.array([np.linalg.norm(place(x + h * v) - place(x - h * v)) / (2.0 * h) for x, v in along])


def circling(robot: nmm.Robot, limits: nmm.Limits, order: int = 1, dt: float = DT) -> nmm.Controller:
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2.0, 0.0], 0.6, rate=0.8), gain=4.0)
    return nmm.Controller(robot, task, nmm.ReducedGradient(), limits=limits, dt=dt, order=order)


@pytest.mark.parametrize(
    ("order", "method", "acceleration"),
    [(1, "zoh", None), (1, "rk4", None), (1, "midpoint", 5.0), (2, "zoh", 5.0)],
)
def test_a_hand_is_never_faster_and_loses_one_per_cent(
    order: int, method: str, acceleration: float | None
) -> None:
    robot, v = robot_of("unicycle_2r"), 0.25
    limits = nmm.Limits(bounds=nmm.HandSpeed("ee", v), acceleration=acceleration)
    run = nmm.simulate(circling(robot, limits, order), robot.q({"q2": 0.5}), 8.0, DT, method=method)
    found = speeds(robot, "ee", run.q, run.q_dot)
    assert found.max() <= v
    assert np.median(found[100:]) >= 0.99 * v * (1.0 - 1e-3)  # it wants to be faster
    at = run.shares[:, run.limit_names.index("speed of ee")]
    np.testing.assert_allclose(at, np.maximum(1.0 - (v - found) / (2.0 * v), 0.5), atol=1e-8)
    assert run.margin.min() > 0.0


def test_without_the_limit_the_hand_is_faster() -> None:
    robot = robot_of("unicycle_2r")
    run = nmm.simulate(circling(robot, nmm.Limits()), robot.q({"q2": 0.5}), 8.0, DT)
    assert speeds(robot, "ee", run.q, run.q_dot).max() > 0.5


@pytest.mark.parametrize("name", ["unicycle_3r", "unicycle_2r"])
def test_the_box_lies_within_the_sphere_and_holds_the_velocity_before(
    name: str, rng: np.random.Generator
) -> None:
    robot, v = robot_of(name), 0.25
    limit = nmm.HandSpeed("ee", v)
    for fast in (0.0, 1e-6, 0.05, 0.1, 0.2, 1.0):
        q, u = moving(robot, rng, fast)
        p = nmm.Configuration(robot, q).jacobian("ee")[:3] @ robot.S(q)
        A, lower, upper = rows_at(robot, limit, q, u, DT)
        axes = A @ np.linalg.pinv(p)
        np.testing.assert_allclose(axes @ p, A, atol=1e-12)
        np.testing.assert_array_equal(lower, -upper)
        assert np.linalg.norm(upper) == pytest.approx(v, rel=1e-12)  # its corners are on the sphere
        if np.linalg.norm(p @ u) < 0.99 * v:
            assert np.all(np.abs(A @ u) <= upper + 1e-12)
        if name == "unicycle_3r":
            np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)


@pytest.mark.parametrize("name", ["unicycle_2r", "unicycle_3r"])
def test_inputs_within_the_box_keep_the_speed(name: str, rng: np.random.Generator) -> None:
    robot, v = robot_of(name), 0.25
    limit, reached = nmm.HandSpeed("ee", v), []
    for _ in range(50):
        q, before = moving(robot, rng, 0.1)
        A, _, upper = rows_at(robot, limit, q, before, DT)
        u = rng.normal(size=robot.n_u)
        u /= np.max(np.abs(A @ u) / np.maximum(upper, 1e-12))
        (speed,) = speeds(robot, "ee", q[np.newaxis], (robot.S(q) @ u)[np.newaxis])
        assert speed <= v * (1.0 + 1e-8)
        assert values_at(robot, limit, q, u, 0.0 * u, DT)[0] == pytest.approx(speed, abs=1e-8)
        reached.append(speed)
    assert max(reached) > 0.9 * v


# Tipping over

TIPPING = [name for limit, name in CASES if isinstance(limit, nmm.TipOver)]


def zmp_inside(robot: nmm.Robot, q: Array, u: Array, u_dot: Array) -> float:
    """How far inside the wheels' hull, m: the wrench is Pinocchio's recursive Newton-Euler algorithm's."""
    model, data, h = robot.model, robot.model.createData(), 1e-6
    q_dot = robot.S(q) @ u
    S_dot = (robot.S(q + h * q_dot) - robot.S(q - h * q_dot)) / (2.0 * h)
    pin.rnea(model, data, q, q_dot, robot.S(q) @ u_dot + S_dot @ u)
    wrench = data.liMi[1].act(data.f[1])
    pin.forwardKinematics(model, data, q)
    carriers = [data.oMi[model.getJointId(wheel.carrier)] for wheel in robot.wheels]
    pairs = list(zip(carriers, robot.wheels, strict=True))
    feet = np.array([at.act(wheel.pivot if wheel.swivel else wheel.center)[:2] for at, wheel in pairs])
    ground = np.median([at.act(wheel.center)[2] - wheel.radius for at, wheel in pairs])
    F, M = wrench.linear, wrench.angular - np.cross([0.0, 0.0, ground], wrench.linear)
    sides = ConvexHull(feet).equations  # n x + d <= 0 inside
    return float(-np.max(sides[:, :2] @ [-M[1] / F[2], M[0] / F[2]] + sides[:, 2]))


@pytest.mark.parametrize("name", TIPPING)
def test_the_recorded_zmp_is_that_of_newton_and_euler(name: str, rng: np.random.Generator) -> None:
    robot, limit = robot_of(name), nmm.TipOver(0.03)
    for _ in range(10):
        q, u = moving(robot, rng)
        u_dot = rng.normal(size=robot.n_u)
        (inside,) = values_at(robot, limit, q, u, u_dot, DT)
        assert inside == pytest.approx(zmp_inside(robot, q, u, u_dot), abs=1e-8)


@pytest.mark.parametrize("name", TIPPING)
def test_rows_are_the_zmp_and_its_derivative_by_the_inputs(name: str, rng: np.random.Generator) -> None:
    """At the inputs before: value and gradient of how far the ZMP is inside, by central differences."""
    robot, limit, step = robot_of(name), nmm.TipOver(0.03), 1e-5
    for _ in range(5):
        q, before = moving(robot, rng)
        A, lower, _ = rows_at(robot, limit, q, before, DT)
        corners = (len(A) - 1) // 2

        def by_rows(u: Array, A: Array = A, lower: Array = lower, corners: int = corners) -> float:
            room = A @ u - lower
            return float(0.03 + np.min(room[:corners]) / room[-1])

        def inside(u: Array, q: Array = q, before: Array = before) -> float:
            return zmp_inside(robot, q, u, (u - before) / DT)

        assert by_rows(before) == pytest.approx(inside(before), abs=1e-8)
        for way in np.eye(robot.n_u) * step:
            slope = (inside(before + way) - inside(before - way)) / (2.0 * step)
            by = (by_rows(before + way) - by_rows(before - way)) / (2.0 * step)
            assert by == pytest.approx(slope, rel=1e-4, abs=1e-5)


def test_rows_of_the_capture_point(rng: np.random.Generator) -> None:
    """c + √(z / g) c_dot on the platform: c_dot by differences of Pinocchio's centre of mass."""
    robot, margin, h = robot_of("differential_base+ur5"), 0.03, 1e-6
    q, u = moving(robot, rng)
    A, lower, _ = rows_at(robot, nmm.TipOver(margin), q, u, DT)
    data = robot.model.createData()
    still = q.copy()
    still[:3] = 0.0
    q_dot = robot.S(q) @ u
    q_dot[:3] = 0.0

    def centre(at: Array) -> Array:
        return np.array(pin.centerOfMass(robot.model, data, at))

    c = centre(still)
    c_dot = (centre(still + h * q_dot) - centre(still - h * q_dot)) / (2.0 * h)
    point = (c + np.sqrt(c[2] / 9.81) * c_dot)[:2]
    pin.forwardKinematics(robot.model, data, still)
    base = data.oMi[robot.model.getJointId("theta")]
    feet = np.array([base.act(wheel.pivot if wheel.swivel else wheel.center)[:2] for wheel in robot.wheels])
    sides = ConvexHull(feet).equations
    expected = np.min(-(sides[:, :2] @ point + sides[:, 2])) - margin
    corners = (len(A) - 1) // 2
    assert np.min((A @ u - lower)[corners:-1]) == pytest.approx(expected, abs=1e-7)


def reaching(limits: nmm.Limits, order: int = 1, dt: float = DT) -> nmm.Controller:
    """A base on two wheels and casters that hurries with its arm held out."""
    robot = robot_of("differential_base+ur5")
    task = nmm.Task(nmm.Position("ur5_ee_link", "xyz"), [3.0, 1.0, 0.8])
    return nmm.Controller(robot, task, PG, limits=limits, dt=dt, order=order)


def tipped(run: nmm.Trajectory, dt: float = DT) -> Array:
    """By Newton and Euler, at each sample."""
    before = np.vstack([np.zeros(run.u.shape[1]), run.u[:-1]])
    u_dot = (run.u - before) / dt if run.u_dot is None else run.u_dot
    return np.array([zmp_inside(run.robot, *one) for one in zip(run.q, run.u, u_dot, strict=True)])


LIFTED = {"ur5_shoulder_lift_joint": -1.0, "ur5_elbow_joint": 1.0}


@pytest.mark.parametrize(("order", "method"), [(1, "zoh"), (1, "rk4"), (2, "zoh")])
def test_a_robot_keeps_its_zmp_inside(order: int, method: str) -> None:
    """Within 2.1 mm, where limits of acceleration contradict it; without the limit it is 17 mm outside."""
    margin, start = 0.05, robot_of("differential_base+ur5").q(LIFTED)
    found = {}
    for bounds in ((), nmm.TipOver(margin)):
        controller = reaching(nmm.Limits(bounds=bounds, acceleration=3.0), order)
        run = nmm.simulate(controller, start, 6.0, DT, method=method)
        found[bool(bounds)] = tipped(run)
    assert found[False].min() < margin - 0.015
    assert found[True].min() > margin - 0.0021
    row = nmm.TipOver(margin).rows(run.robot)[0]
    at = run.shares[:, run.limit_names.index(row.name)]
    (size,) = nmm.TipOver(margin).stage(run.robot).sizes
    np.testing.assert_allclose(at, np.minimum((found[True] - margin) / size, 0.5), atol=1e-8)


def test_what_contradicts_is_named_once() -> None:
    controller = reaching(nmm.Limits(bounds=nmm.TipOver(0.05), acceleration=3.0))
    run = nmm.simulate(controller, run_start(controller), 6.0, DT, method="zoh")
    (contradicted,) = every(run, "limit_contradicted")
    assert contradicted.values["name"] == "ZMP inside the wheels"
    assert contradicted.values["unit"] == "m"
    against = contradicted.values["against"]
    assert len(against) == len(set(against)) > 1
    (broken,) = every(run, "functions_beyond_limits")
    assert broken.values["functions"][0]["beyond"] < 0.0021


def run_start(controller: nmm.Controller) -> Array:
    return controller.robot.q(LIFTED)


@pytest.mark.parametrize(("margin", "stands"), [(0.008, True), (-0.008, False)])
def test_mujoco_agrees_where_a_braking_robot_tips(margin: float, stands: bool) -> None:
    """A rigid robot brakes on frictional feet at a constant rate such that its ZMP is so far inside."""
    mujoco = pytest.importorskip("mujoco")
    robot = robot_of("differential_base+ur5")
    q, still = robot.q({"ur5_shoulder_lift_joint": -1.5}), np.zeros(robot.n_u)
    ahead = np.zeros(robot.n_u)
    ahead[:2] = 1.0  # both wheels
    limit = nmm.TipOver(0.0)

    def inside(rate: float) -> float:
        return float(values_at(robot, limit, q, still, -rate * ahead, DT)[0])

    low, high = 0.0, 200.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if inside(middle) > margin else (low, middle)
    slowed = -(robot.S(q) @ ahead)[0] * low  # m/s²
    model, data = robot.model, robot.model.createData()
    pin.ccrba(model, data, q, np.zeros(model.nv))
    pin.centerOfMass(model, data, q)
    spec = mujoco.MjSpec()
    plane = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50.0, 50.0, 1.0])
    plane.friction = [1.0, 0.005, 0.0001]
    body = spec.worldbody.add_body()
    body.add_freejoint()
    inertia = pin.Inertia(data.mass[0], data.com[0], np.array(data.Ig.inertia))
    body.explicitinertial = True
    body.mass, body.ipos = inertia.mass, inertia.lever
    (xx, yy, zz), (xy, xz, yz) = inertia.inertia.diagonal(), inertia.inertia[[0, 0, 1], [1, 2, 2]]
    body.fullinertia = [xx, yy, zz, xy, xz, yz]
    ball = 0.005
    for wheel in robot.wheels:
        x, y = (wheel.pivot if wheel.swivel else wheel.center)[:2]
        foot = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[ball, 0, 0], pos=[x, y, ball])
        foot.friction = [1.0, 0.005, 0.0001]
    built = spec.compile()
    built.opt.timestep = 0.001
    state = mujoco.MjData(built)
    fell = False
    for k in range(5000):  # seen from the braking ground: gravity leans forward, more and more
        built.opt.gravity = [-slowed * min(k / 2000, 1.0), 0.0, -9.81]
        mujoco.mj_step(built, state)
        fell = fell or bool(2.0 * np.hypot(*state.qpos[4:6]) > 0.1)
    assert fell != stands


# In files, in figures, and where they do not fit

SCENARIO = """
name: slow_hand
robot: unicycle_2r
q0: {q2: 0.5}
duration: 4
dt: 0.02
task: {kind: position, frame: ee, axes: xy, reference: [3.0, 1.0]}
resolver: {kind: pg}
limits:
  bounds:
    - {kind: hand_speed, frame: ee, speed: 0.25}
    - {kind: position, frame: ee, axes: y, upper: 2.0}
"""


def test_a_scenario_keeps_the_hand_slow(tmp_path: Path) -> None:
    path = tmp_path / "slow_hand.yaml"
    path.write_text(SCENARIO, encoding="utf-8")
    run = Scenario.load(path).run()
    assert "speed of ee" in run.limit_names
    assert speeds(run.robot, "ee", run.q, run.q_dot).max() <= 0.25
    (held,) = every(run, "limits_binding")
    assert held.values["limits"]["speed of ee"] > 0.9
    run.save(tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert "speed of ee" in json.dumps(summary)
    again = Scenario.load(tmp_path / "run" / "scenario.yaml").run()
    np.testing.assert_array_equal(again.q, run.q)
    opened = nmm.Trajectory.load(tmp_path / "run")
    assert opened.limit_names == run.limit_names
    np.testing.assert_array_equal(opened.margin, run.margin)
    shown = [text.get_text() for text in figures.limits(run).findobj(lambda it: hasattr(it, "get_text"))]
    assert any("speed of ee" in text for text in shown)


@pytest.mark.parametrize(
    ("change", "where", "near"),
    [
        ({"speed": -1}, "speed, m/s", "above 0"),
        ({"speed": "fast"}, "speed", "a number"),
        ({"frame": "eee"}, "frame", "did you mean 'ee'"),
        ({"kind": "hand_sped"}, "kind", "did you mean 'hand_speed'"),
        ({"sped": 1}, "sped", "did you mean 'speed'"),
        ({"kind": "tip_over", "speed": None, "frame": None, "margin": -0.1}, "margin, m", "got -0.1"),
        ({"kind": "tip_over", "speed": None, "frame": None}, "tip over", "three wheels"),
    ],
)
def test_wrong_keys_are_named(change: dict[str, object], where: str, near: str, tmp_path: Path) -> None:
    keys = {"kind": "hand_speed", "frame": "ee", "speed": 0.25} | change
    text = ", ".join(f"{key}: {value}" for key, value in keys.items() if value is not None)
    path = tmp_path / "wrong.yaml"
    path.write_text(SCENARIO.replace("kind: hand_speed, frame: ee, speed: 0.25", text), encoding="utf-8")
    with pytest.raises(InputError) as raised:
        Scenario.load(path).controller()
    said = str(raised.value)
    assert where in said
    assert near in said
    assert "limits.bounds" in said
    assert len(said) <= 300 + len(str(path))


def test_wrong_values_are_refused() -> None:
    for speed in (0.0, -1.0, np.nan, True, "0.25 m/s"):
        with pytest.raises(InputError, match="hand speed: speed, m/s"):
            nmm.HandSpeed("ee", speed)  # type: ignore[arg-type]  # on purpose
    with pytest.raises(InputError, match="frame"):
        nmm.HandSpeed(3, 0.25)  # type: ignore[arg-type]  # on purpose
    with pytest.raises(InputError, match="priority"):
        nmm.HandSpeed("ee", 0.25, priority=0)
    with pytest.raises(InputError, match="tip over: margin, m"):
        nmm.TipOver(-0.01)
    with pytest.raises(InputError, match=r"below 0\.19"):
        nmm.Limits(bounds=nmm.TipOver(0.3)).on(robot_of("differential_base+ur5"))
    with pytest.raises(InputError, match="against the main body"):
        nmm.TipOver(0.01).rows(robot_of("trailer_base"))
    with pytest.raises(InputError, match="bounds"):
        nmm.Limits(bounds=[0.25])  # type: ignore[list-item]  # on purpose


# A limit of one's own


def own(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, OWN / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_limit_of_a_user_is_one_file(tmp_path: Path) -> None:
    """docs/own_kinds/climb.py in a run; and, with one line, in a scenario."""
    Climb = own("climb").Climb
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee", "xz"), [2.0, 1.0], gain=3.0)
    start = robot.q({"q1": 0.4, "q2": 0.6, "q3": 0.9})
    largest = {}
    for bounds in ((), Climb("ee", 0.1)):
        controller = nmm.Controller(robot, task, PG, limits=nmm.Limits(bounds=bounds), dt=DT)
        run = nmm.simulate(controller, start, 3.0, DT, method="zoh")
        largest[bool(bounds)] = np.abs(np.gradient(run.path[:, 2], DT)).max()
    assert largest[False] > 0.3
    assert 0.09 < largest[True] <= 0.1001
    assert "climb of ee" in run.limit_names
    LIMITS["climb"] = Climb
    try:
        assert LIMITS.named("climb") is Climb
        assert LIMITS.words("climb") == "climb"
    finally:
        del LIMITS.data["climb"]


def test_a_kernel_of_another_signature_is_refused() -> None:
    module = own("climb")

    class Odd(module.Climb):  # type: ignore[misc, name-defined]  # loaded by its path
        def stage(self, robot: nmm.Robot) -> nmm.extending.LimitStage:
            stage: nmm.extending.LimitStage = super().stage(robot)
            return type(stage)(nmm.Unicycle().velocity_map, stage.values, 1, "m/s", stage.frames)

    with pytest.raises(InputError, match="a kernel of signature LIMIT_ROWS"):
        nmm.Limits(bounds=Odd("ee", 0.1)).on(nmm.load("unicycle_3r"))
