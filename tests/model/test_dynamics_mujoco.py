"""Dynamics against MuJoCo, which has its own model of the same masses, joints and contacts."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import ROOT
from test_dynamics import moving, robot_of

import nmm
from nmm.base.arrays import Array
from nmm.model.dynamics.support import Support

mujoco = pytest.importorskip("mujoco")

ROBOTS = ["differential_base+ur5", "car_base+ur5", "tiago"]
#: Stands in for no mass and no inertia, kg and kg m²: MuJoCo wants some.
NEXT_TO_NOTHING = 1e-12


def placed(body: Any, placement: pin.SE3) -> Any:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    body.pos, body.quat = placement.translation, [w, x, y, z]
    return body


def weigh(body: Any, inertia: pin.Inertia) -> None:
    body.explicitinertial = True
    body.mass, body.ipos = max(inertia.mass, NEXT_TO_NOTHING), inertia.lever
    (xx, yy, zz), (xy, xz, yz) = inertia.inertia.diagonal(), inertia.inertia[[0, 0, 1], [1, 2, 2]]
    body.fullinertia = [*(max(one, NEXT_TO_NOTHING) for one in (xx, yy, zz)), xy, xz, yz]


class Twin:
    """A Pinocchio model in MuJoCo, joint by joint; `order` (nv,) : where MuJoCo has its joints."""

    def __init__(self, model: pin.Model) -> None:
        spec = mujoco.MjSpec()
        spec.compiler.balanceinertia = False
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        bodies = [spec.worldbody]
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        for k in range(1, model.njoints):
            body = placed(bodies[model.parents[k]].add_body(), model.jointPlacements[k])
            weigh(body, model.inertias[k])
            column = pin.getJointJacobian(model, data, k, pin.LOCAL)[:, model.joints[k].idx_v]
            slides = bool(np.abs(column[:3]).max() > 0.5)
            kinds = mujoco.mjtJoint
            joint = body.add_joint(
                name=model.names[k],
                type=kinds.mjJNT_SLIDE if slides else kinds.mjJNT_HINGE,
                axis=column[:3] if slides else column[3:],
            )
            joint.armature = model.armature[model.joints[k].idx_v]
            bodies.append(body)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        names = [model.names[k] for k in range(1, model.njoints)]
        assert [model.joints[k].idx_v for k in range(1, model.njoints)] == list(range(model.nv))
        self.order = np.array([self.model.joint(name).dofadr[0] for name in names])

    def inverse(self, Q: Array, Q_dot: Array, Q_ddot: Array) -> Array:
        """The joints' forces and torques (nv,)."""
        data = self.data
        data.qpos[self.order], data.qvel[self.order], data.qacc[self.order] = Q, Q_dot, Q_ddot
        mujoco.mj_inverse(self.model, data)
        return np.array(data.qfrc_inverse[self.order])

    def M(self, Q: Array) -> Array:
        nothing = np.zeros_like(Q)
        weight = self.inverse(Q, nothing, nothing)
        return np.array([self.inverse(Q, nothing, one) - weight for one in np.eye(Q.size)])


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_matrix_bias_and_torques_are_mujocos(name: str, rng: np.random.Generator) -> None:
    """Of all joints, wheels and steering included, along motions that roll."""
    dynamics = nmm.Dynamics(robot_of(name))
    robot, model = dynamics.robot, dynamics.model
    twin, data = Twin(model), model.createData()
    q, u, u_dot = moving(robot, rng, 3)
    Q, Q_dot, Q_ddot = dynamics.motions(q, u, u_dot)
    for k in range(3):
        M = np.triu(pin.crba(model, data, Q[k]))
        M += np.triu(M, 1).T
        size = np.abs(M).max()
        np.testing.assert_allclose(twin.M(Q[k]), M, rtol=0.0, atol=1e-10 * size)
        bias = pin.nonLinearEffects(model, data, Q[k], Q_dot[k])
        np.testing.assert_allclose(
            twin.inverse(Q[k], Q_dot[k], 0.0 * Q[k]), bias, rtol=0.0, atol=1e-10 * size
        )
    # What the inputs feel: the power of all joints' torques, at the rates that each input causes.
    f = dynamics.inverse(q, u, u_dot)
    for k in range(3):
        torques = twin.inverse(Q[k], Q_dot[k], Q_ddot[k])
        for j, one in enumerate(np.eye(robot.n_u)):
            (rates,) = dynamics.motions(q[[k]], one[np.newaxis], np.zeros((1, robot.n_u)))[1]
            assert torques @ rates == pytest.approx(f[k, j], rel=1e-9, abs=1e-9 * np.abs(torques).max())


def falls(robot: nmm.Robot, dynamics: nmm.Dynamics, q: Array) -> bool:
    """Whether the robot, as one rigid body on the points where its wheels stand, leans by 0.1 rad in 5 s."""
    model, data = dynamics.model, dynamics.model.createData()
    (Q,) = dynamics.motions(q[np.newaxis], np.zeros((1, robot.n_u)), np.zeros((1, robot.n_u)))[0]
    pin.centerOfMass(model, data, Q)
    pin.ccrba(model, data, Q, np.zeros(model.nv))
    support = Support(robot)
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50.0, 50.0, 1.0])
    body = spec.worldbody.add_body(pos=[0.0, 0.0, -support.height])
    body.add_freejoint()
    weigh(body, pin.Inertia(data.mass[0], data.com[0], np.array(data.Ig.inertia)))
    ball = 0.005
    for x, y in support.points(q):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[ball, 0, 0], pos=[x, y, support.height + ball])
    built = spec.compile()
    built.opt.timestep = 0.002
    state = mujoco.MjData(built)
    for _ in range(2500):
        mujoco.mj_step(built, state)
        if 2.0 * np.hypot(*state.qpos[4:6]) > 0.1:
            return True
    return False


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_robot_tips_where_the_zero_moment_point_leaves_its_wheels(side: float) -> None:
    """8 mm inside it stands, 8 mm outside it falls; the load that a hand holds makes the difference."""
    robot = robot_of("differential_base+ur5")
    support, q = Support(robot), robot.rest
    still = np.zeros((1, robot.n_u))

    def margin(mass: float) -> float:
        forces = nmm.Dynamics(robot, payload={"ur5_ee_link": mass}).forces(q[np.newaxis], still, still)[1]
        return float(support.margins(q[np.newaxis], support.zero_moment(forces))[0][0])

    light, heavy = 0.1, 1e4
    assert margin(light) > 0.008 > -0.008 > margin(heavy)
    for _ in range(60):
        middle = np.sqrt(light * heavy)
        light, heavy = (middle, heavy) if margin(middle) > side * 0.008 else (light, middle)
    assert falls(robot, nmm.Dynamics(robot, payload={"ur5_ee_link": light}), q) == (side < 0.0)


@pytest.fixture(scope="module")
def tutorial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of docs/tutorials/robot_loop.md."""
    folder = tmp_path_factory.mktemp("robot_loop")
    page = ROOT / "docs" / "tutorials" / "robot_loop.md"
    for path in page.parent.glob("*.py"):
        shutil.copy(path, folder)
    for code in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
        (folder / code.split("\n")[0].removeprefix("# ")).write_text(code, encoding="utf-8")
    return folder


def numbers_of(folder: Path, name: str, *shorter: tuple[str, str]) -> list[list[float]]:
    """Those that a file prints, by line; `shorter` is a text in it each, and what takes its place."""
    code = (folder / name).read_text(encoding="utf-8")
    for text, instead in shorter:
        assert code.count(text) == 1, text
        code = code.replace(text, instead)
    name = "shorter.py" if shorter else name
    (folder / name).write_text(code, encoding="utf-8")
    done = subprocess.run([sys.executable, name], cwd=folder, capture_output=True, text=True, check=True)
    lines = [re.findall(r"(?<![\w.])\d+(?:\.\d+)?", line) for line in done.stdout.splitlines()]
    return [[float(one) for one in line] for line in lines]


#: One kind of contact instead of three, and 6 s of motion instead of 10.
SHORTER = (
    ("((0.004, 1.0), (0.004, 0.5), (0.02, 1.0))", "((0.004, 0.5),)"),
    ("range(5000)", "range(3000)"),
    ("k == 1000", "k == 300"),
)


@pytest.mark.parametrize("shorter", [SHORTER, pytest.param((), marks=pytest.mark.thorough)])
def test_the_loop_of_the_tutorial_leads_mujocos_robot_as_far_as_odometry_goes(
    tutorial: Path, shorter: tuple[tuple[str, str], ...]
) -> None:
    for contact, _friction, off, drift, share in numbers_of(tutorial, "mujoco_loop.py", *shorter):
        assert contact in (4.0, 20.0)
        assert abs(off - drift) <= 5.0  # mm: what the servos' lag adds
        assert 1.0 < drift < 100.0
        assert 5.0 < share < 100.0


@pytest.mark.parametrize(
    "shorter", [(("start, 4.0, 0.005)", "start, 1.0, 0.005)"),), pytest.param((), marks=pytest.mark.thorough)]
)
def test_computed_torques_are_those_foretold(tutorial: Path, shorter: tuple[tuple[str, str], ...]) -> None:
    (platform, joints), (share, *_) = numbers_of(tutorial, "computed_torque.py", *shorter)
    assert platform <= 0.5  # mm
    assert joints <= 0.02
    assert share <= 1.0  # per cent


def test_where_a_cable_breaks_a_stop_along_the_limits_asks_less_of_the_motors_than_zeros(
    tutorial: Path,
) -> None:
    (along,), (zeros,), *found = numbers_of(tutorial, "broken_cable.py")
    assert 10.0 < along < 0.6 * zeros
    assert found
