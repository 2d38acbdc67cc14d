"""Configurations and velocities against Pinocchio's own kinematics of its own layouts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from findings import refused
from numpy.typing import NDArray
from urdf_parts import joint, link, random_tree, robot, shape, write

import nmm
from nmm import PinocchioLayout
from nmm.model.platforms import FixedBase, Unicycle
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

ROOT_JOINTS = {"planar": pin.JointModelPlanar, "freeflyer": pin.JointModelFreeFlyer}
each_root = pytest.mark.parametrize("root", ["planar", "freeflyer", "chain"])
each_joint = pytest.mark.parametrize("root", list(ROOT_JOINTS))


class Steered(Unicycle):
    """A platform with a joint of its own, for the order of coordinates only."""

    coordinates = ("x", "y", "theta", "steer")


def text() -> str:
    """An arm, a steering column that the file has after it, and wheels; continuous and sliding joints."""
    solid = shape('<sphere radius="0.1"/>', "collision") + shape('<sphere radius="0.1"/>')
    level = '<origin xyz="0 0.2 0.1"/>'
    return robot(
        *(link(name, solid) for name in ("base", "a", "b", "c", "s", "w")),
        joint("arm_1", "base", "a", "continuous", '<axis xyz="0.6 0 0.8"/>'),
        joint(
            "arm_2",
            "a",
            "b",
            "prismatic",
            '<axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="1" velocity="1"/>',
        ),
        joint("arm_3", "b", "c", "continuous"),
        joint("steer", "base", "s"),
        joint("wheel", "base", "w", "continuous", '<axis xyz="0 1 0"/>', level),
        link("axle"),
        joint("axle_joint", "base", "axle", "fixed", "", '<origin xyz="-0.3 0.1 0" rpy="0 0 0.7"/>'),
    )


@pytest.fixture
def machine(tmp_path: Path) -> Robot:
    return nmm.load(write(tmp_path / "r.urdf", text()), platform=Steered())


def random_rows(robot: Robot, rng: np.random.Generator, rows: int) -> Array:
    q = rng.uniform(-1, 1, (rows, robot.n))
    q[:, 2] *= 30
    return q


def poses(model: pin.Model, q: Array) -> dict[str, Array]:
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    kinds = (pin.FrameType.BODY, pin.FrameType.FIXED_JOINT)
    return {f.name: data.oMf[i].homogeneous for i, f in enumerate(model.frames) if i and f.type in kinds}


def twists(model: pin.Model, q: Array, v: Array) -> dict[str, Array]:
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    return {
        f.name: pin.getFrameVelocity(model, data, i, pin.LOCAL_WORLD_ALIGNED).vector
        for i, f in enumerate(model.frames)
        if f.type == pin.FrameType.BODY
    }


def assert_same(mine: dict[str, Array], its: dict[str, Array], tolerance: float = 1e-12) -> None:
    shared = [name for name in its if name in mine]
    assert len(shared) >= 4
    for name in shared:
        np.testing.assert_allclose(mine[name], its[name], atol=tolerance, err_msg=name)


def assert_converts(layout: PinocchioLayout, rng: np.random.Generator) -> None:
    """Placements, velocities, both ways, one at a time and as rows; and integrate."""
    robot, model = layout.robot, layout.model
    q, q_dot = random_rows(robot, rng, 20), rng.normal(size=(20, robot.n))
    there, v = layout.configuration(q), layout.velocity(q, q_dot)
    for k in range(len(q)):
        assert_same(poses(robot.model, q[k]), poses(model, there[k]))
        assert_same(twists(robot.model, q[k], q_dot[k]), twists(model, there[k], v[k]), 1e-11)
        np.testing.assert_array_equal(layout.configuration(q[k]), there[k])
        np.testing.assert_array_equal(layout.velocity(q[k], q_dot[k]), v[k])
        np.testing.assert_allclose(layout.coordinates(there[k], near=q[k]), q[k], atol=1e-12)
        np.testing.assert_allclose(layout.rates(there[k], v[k]), q_dot[k], atol=1e-12)
    np.testing.assert_allclose(layout.rates(there, v), q_dot, atol=1e-12)
    # Pinocchio's own step along v and ours along q_dot differ by their curvature only.
    errors = []
    for dt in (1e-3, 5e-4):
        end = pin.integrate(model, there[0], v[0] * dt)
        errors.append(np.abs(layout.coordinates(end, near=q[0]) - q[0] - q_dot[0] * dt).max())
    assert errors[0] < 1e-5
    assert errors[1] < 0.3 * errors[0] or errors[0] < 1e-12


@each_root
def test_models_made_here(root: str, machine: Robot, rng: np.random.Generator) -> None:
    layout = PinocchioLayout(machine, root)  # type: ignore[arg-type]  # one of three
    assert (layout.model.nq, layout.model.nv) == {"planar": (8, 7), "freeflyer": (11, 10), "chain": (7, 7)}[
        root
    ]
    assert_converts(layout, rng)


@each_joint
@pytest.mark.parametrize("axle", [None, "axle", (0.2, -0.1)])
def test_models_of_the_same_file(root: str, axle: object, tmp_path: Path, rng: np.random.Generator) -> None:
    """As Pinocchio reads the file: (cos, sin) pairs, wheels, the joints in its order, its root's place."""
    path = write(tmp_path / "r.urdf", text())
    model = pin.buildModelFromUrdf(str(path), ROOT_JOINTS[root]())
    loaded = nmm.load(path, platform=Steered(), axle=axle)  # type: ignore[arg-type]  # of several types
    layout = PinocchioLayout(loaded, model)
    assert layout.model is model
    assert model.nq > loaded.n
    assert_converts(layout, rng)


@each_joint
def test_locked_joints_stand_where_they_are(root: str, tmp_path: Path, rng: np.random.Generator) -> None:
    path = write(tmp_path / "r.urdf", text())
    model = pin.buildModelFromUrdf(str(path), ROOT_JOINTS[root]())
    loaded = nmm.load(path, lock={"arm_1": 4.0, "arm_2": 0.3})
    layout = PinocchioLayout(loaded, model)
    assert_converts(layout, rng)
    there = layout.configuration(np.zeros(loaded.n))
    index = model.joints[model.getJointId("arm_2")].idx_q
    there[index] += 0.1
    with refused("joint arm_2") as caught:
        layout.coordinates(there)
    assert caught.value.got == pytest.approx(0.1)


@each_root
def test_loaded_from_a_pinocchio_model_and_back(root: str, tmp_path: Path, rng: np.random.Generator) -> None:
    """The model that another tool has, through `load`, and out again: the same kinematics and masses."""
    source = random_tree(rng, 7)
    joint_model = ROOT_JOINTS[root]() if root in ROOT_JOINTS else None
    raw = (
        pin.buildModelFromXML(source, joint_model)
        if joint_model
        else nmm.load(write(tmp_path / "tree.urdf", source)).model
    )
    loaded = nmm.load(raw)
    assert_converts(PinocchioLayout(loaded, raw), rng)
    models = nmm.pinocchio_models(loaded, root)  # type: ignore[arg-type]  # one of three
    layout = PinocchioLayout(loaded, models.model)
    assert_converts(layout, rng)
    q = random_rows(loaded, rng, 1)[0]
    raw_q, out_q = PinocchioLayout(loaded, raw).configuration(q), layout.configuration(q)
    assert_same(poses(raw, raw_q), poses(models.model, out_q))
    assert pin.computeTotalMass(models.model) == pytest.approx(pin.computeTotalMass(raw), rel=1e-12)
    com = [pin.centerOfMass(m, m.createData(), at) for m, at in ((raw, raw_q), (models.model, out_q))]
    np.testing.assert_allclose(com[0], com[1], atol=1e-12)
    again = nmm.load(models.model)
    assert again.q_names == loaded.q_names


@each_root
def test_shapes_go_along(root: str, machine: Robot, rng: np.random.Generator) -> None:
    models = nmm.pinocchio_models(machine, root)  # type: ignore[arg-type]  # one of three
    layout = PinocchioLayout(machine, models.model)
    q = random_rows(machine, rng, 1)[0]
    pairs = [(pair.first, pair.second) for pair in models.collision_model.collisionPairs]
    assert pairs == [(pair.first, pair.second) for pair in machine.collision_model.collisionPairs]
    assert len(pairs) > 0
    assert models.visual_model.ngeoms == machine.visual_model.ngeoms
    placed, expected = models.collision_model.createData(), machine.collision_model.createData()
    pin.updateGeometryPlacements(
        models.model, models.model.createData(), models.collision_model, placed, layout.configuration(q)
    )
    pin.updateGeometryPlacements(
        machine.model, machine.model.createData(), machine.collision_model, expected, q
    )
    for mine, its in zip(placed.oMg, expected.oMg, strict=True):
        np.testing.assert_allclose(mine.homogeneous, its.homogeneous, atol=1e-12)


@each_root
def test_trajectories_keep_their_turns(root: str, machine: Robot) -> None:
    """Angles that make several turns come back as they went, from the turn that one says."""
    layout = PinocchioLayout(machine, root)  # type: ignore[arg-type]  # one of three
    q = np.linspace(0, 1, 200)[:, np.newaxis] * [1, 2, 40, 0.5, -20, 0.3, 30] + [0, 0, 9, 0, 0, 0, 0]
    q[:, 4] += 7
    there = layout.configuration(q)
    np.testing.assert_allclose(layout.coordinates(there, near=q[0]), q, atol=1e-12)
    back = layout.coordinates(there)
    shift = back - q
    np.testing.assert_allclose(shift - shift[0], 0, atol=1e-12)
    if root != "chain":
        assert np.abs(back[0, 2]) <= np.pi
    assert layout.configuration(np.zeros((0, 7))).shape == (0, layout.model.nq)
    assert layout.coordinates(np.zeros((0, layout.model.nq))).shape == (0, 7)


def test_fixed_base(tmp_path: Path, rng: np.random.Generator) -> None:
    path = write(tmp_path / "r.urdf", random_tree(rng, 6))
    loaded = nmm.load(path, platform=FixedBase())
    layout = PinocchioLayout(loaded, pin.buildModelFromUrdf(str(path)))
    q = rng.uniform(-1, 1, loaded.n)
    assert_same(poses(loaded.model, q), poses(layout.model, layout.configuration(q)))
    np.testing.assert_allclose(layout.coordinates(layout.configuration(q)), q, atol=1e-14)
    assert nmm.pinocchio_model(loaded, "chain").nq == loaded.n
    with refused(loaded.name, got="planar"):
        nmm.pinocchio_model(loaded, "planar")
    with refused(loaded.name):
        PinocchioLayout(loaded, pin.buildModelFromUrdf(str(path), pin.JointModelPlanar()))
    with refused(loaded.name):
        PinocchioLayout(nmm.load(path), pin.buildModelFromUrdf(str(path)))


def test_configurations_that_are_off_the_plane(machine: Robot) -> None:
    layout = PinocchioLayout(machine, "freeflyer")
    level = layout.configuration(np.zeros((3, machine.n)))
    for index, value, where, off in (
        (2, 0.1, "z", 0.1),
        (3, 0.1, "quaternion", np.hypot(0.1, 1.0) - 1.0),
        (6, 0.9, "quaternion", 0.1),
    ):
        wrong = level.copy()
        wrong[1, index] = value
        with refused(f"row 1: {where}") as caught:
            layout.coordinates(wrong)
        assert caught.value.got == pytest.approx(off)
    wrong = level.copy()
    wrong[1, 3:7] = [np.sin(0.1), 0, 0, np.cos(0.1)]
    with refused("row 1: roll and pitch"):
        layout.coordinates(wrong)
    v = np.zeros((3, layout.model.nv))
    for index in (2, 3, 4):
        off = v.copy()
        off[2, index] = 0.2
        with refused("row 2: velocity along z, about x and y", got=0.2):
            layout.rates(level, off)
    planar = PinocchioLayout(machine)
    with refused("cos θ, sin θ", got=1.0):
        planar.coordinates(np.zeros(planar.model.nq))


def test_height_of_the_root(tmp_path: Path, rng: np.random.Generator) -> None:
    """A root above the reference point: a free flyer has the height, a planar joint has none."""
    path = write(tmp_path / "r.urdf", text())
    loaded = nmm.load(path, axle=(0.1, 0.0, -0.2), wheels={"wheel": 0.1}, lock={"steer": 0.0})
    free = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    layout = PinocchioLayout(loaded, free)
    assert_converts(layout, rng)
    assert layout.configuration(np.zeros(loaded.n))[2] == pytest.approx(0.2)
    with refused("model: z") as caught:
        PinocchioLayout(loaded, pin.buildModelFromUrdf(str(path), pin.JointModelPlanar()))
    assert caught.value.got == pytest.approx(0.2)


def test_models_that_do_not_fit(machine: Robot, tmp_path: Path) -> None:
    with refused(got="plane", available=["planar", "freeflyer", "chain"]):
        nmm.pinocchio_model(machine, "plane")  # type: ignore[arg-type]  # wrong on purpose
    with refused("model", got=3):
        PinocchioLayout(machine, 3)  # type: ignore[arg-type]  # wrong on purpose
    other = pin.buildModelFromXML(robot(link("a"), link("b"), joint()), pin.JointModelPlanar())
    with refused(got="j", available=["steer", "arm_1", "arm_2", "arm_3"]):
        PinocchioLayout(machine, other)
    less = pin.buildModelFromXML(
        robot(link("base"), link("s"), joint("steer", "base", "s")), pin.JointModelPlanar()
    )
    with refused(machine.name, got=["arm_1", "arm_2", "arm_3"]):
        PinocchioLayout(machine, less)
    layout = PinocchioLayout(machine)
    for call, where in (
        (lambda: layout.configuration(np.zeros(3)), "q"),
        (lambda: layout.velocity(np.zeros(7), np.zeros((2, 7))), "q_dot"),
        (lambda: layout.coordinates([np.nan] * 8), "configuration"),
        (lambda: layout.rates(np.zeros(8), np.zeros(8)), "velocity"),
    ):
        with refused(where):
            call()
