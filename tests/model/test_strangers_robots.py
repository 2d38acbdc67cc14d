"""Robots as other people's files have them: shared names, mass on a fixed base, axles elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from findings import codes, holds, of_code
from numpy.typing import NDArray
from places import DATA
from urdf_parts import inertial, joint, link, robot, write

import nmm
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading.ground import slipping_wheels

Array = NDArray[np.float64]

UP = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="2"/>'
LEVEL = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'


def wheeled(path: Path, x: float = 0.0, wheel: str = "left_wheel", arm: str = "shoulder") -> Path:
    """Two wheels x ahead of the root, one of them named as its link, and an arm of one joint."""
    parts = [link("base", inertial(5.0)), link("left_wheel"), link("right_wheel"), link("upper", inertial())]
    parts += [
        joint(name, "base", child, "continuous", LEVEL, f'<origin xyz="{x} {y} 0.1"/>')
        for name, child, y in ((wheel, "left_wheel", 0.3), ("right", "right_wheel", -0.3))
    ]
    parts.append(joint(arm, "base", "upper", "revolute", UP, '<origin xyz="0.2 0 0.4"/>'))
    return write(path, robot(*parts))


def test_a_link_and_a_joint_may_share_a_name(tmp_path: Path, rng: np.random.Generator) -> None:
    """Pinocchio's reduction and composition raise for such files: nmm does not."""
    shared, apart = (
        nmm.load(wheeled(tmp_path / f"{name}.urdf", wheel=name)) for name in ("left_wheel", "other")
    )
    assert [wheel.joint for wheel in shared.wheels] == ["left_wheel", "right"]
    assert set(shared.frames) == set(apart.frames) - {"other"}
    locked = nmm.load(wheeled(tmp_path / "again.urdf"), lock={"shoulder": 0.5})
    assert locked.n == 3
    for base in (shared, locked):
        mounted = nmm.mount(base, DATA + "z1_description/urdf/z1.urdf", at="base")
        q = mounted.q(rng.uniform(-0.5, 0.5, mounted.n))
        z1 = nmm.load(DATA + "z1_description/urdf/z1.urdf", platform="fixed")
        alone = Configuration(z1, q[-z1.n :])
        foot = Configuration(mounted, q).placement("base")
        for frame in ("link06", "gripperMover"):
            here = Configuration(mounted, q).placement(frame)
            assert here.isApprox(foot * alone.placement(frame), 1e-12)


@pytest.mark.parametrize("name", ["small_arm", DATA + "ur_description/urdf/ur5_robot.urdf"])
def test_the_centre_of_mass_of_a_fixed_base_counts_its_foot(name: str, rng: np.random.Generator) -> None:
    fixed = nmm.load(name, platform="fixed")
    q = fixed.q(rng.uniform(-1, 1, fixed.n))

    def weighed(q: Array) -> Array:
        """The sum over every body, the one that stands still among them."""
        data = fixed.model.createData()
        pin.forwardKinematics(fixed.model, data, q)
        bodies = [
            (inertia.mass, data.oMi[i].act(inertia.lever)) for i, inertia in enumerate(fixed.model.inertias)
        ]
        total: Array = sum(mass * place for mass, place in bodies) / sum(mass for mass, _ in bodies)
        return total

    centre, jacobian = Configuration(fixed, q).center_of_mass()
    np.testing.assert_allclose(centre, weighed(q), atol=1e-14)
    h = 1e-6
    differences = np.column_stack(
        [(weighed(q + h * e) - weighed(q - h * e)) / (2 * h) for e in np.eye(fixed.n)]
    )
    np.testing.assert_allclose(jacobian, differences, atol=1e-9)
    compiled = nmm.evaluate(nmm.CenterOfMass(), 0.0, Configuration(fixed, q))
    np.testing.assert_array_equal(compiled.value, centre)
    np.testing.assert_array_equal(compiled.value_q, jacobian)


def test_wheels_that_the_platform_would_slide_are_named(tmp_path: Path) -> None:
    """The reference point is 0.2 m from the axle: turning, each wheel slides at 0.2 m/s for 1 rad/s."""
    path = wheeled(tmp_path / "behind.urdf", x=-0.2, wheel="left")
    wrong = nmm.load(path, axle=(0.0, 0.0))
    assert slipping_wheels(wrong) == {"left": pytest.approx(0.2), "right": pytest.approx(0.2)}
    (note,) = of_code(wrong.notes, "wheels_slide")
    assert holds(note, "wheels_slide", platform="unicycle", several_axles=False)
    assert note.values["speeds"] == slipping_wheels(wrong)
    task = nmm.Task(nmm.LinearCoordinates("theta"), nmm.Line([0.0], [0.5], 0.2))
    run = nmm.simulate(nmm.Controller(wrong, task, nmm.ProjectedGradient()), {}, 0.2, 0.1)
    assert "wheels_slide" in codes(run)
    assert "wheels_slid" in codes(run)
    for right in (nmm.load(path), nmm.load(path, axle=(-0.2, 0.0))):
        assert slipping_wheels(right) == {}
        assert not of_code(right.notes, "wheels_slide")
    assert slipping_wheels(nmm.load(path, axle=(0.1, 0.0))) != {}


@pytest.mark.parametrize(
    "name", ["differential_base", "car_base", "trailer_base", "omni_base", "unicycle_2r"]
)
def test_no_bundled_wheel_slides(name: str) -> None:
    assert slipping_wheels(nmm.load(name)) == {}


def test_a_steered_wheel_off_its_pivot_is_no_car(tmp_path: Path) -> None:
    parts = [link(name) for name in ("base", "column", "front", "left", "right")]
    parts += [
        joint("steering", "base", "column", "revolute", UP, '<origin xyz="0.7 0 0.1"/>'),
        joint("front_wheel", "column", "front", "continuous", LEVEL, '<origin xyz="-0.05 0 0"/>'),
        joint("left_wheel", "base", "left", "continuous", LEVEL, '<origin xyz="0 0.3 0.1"/>'),
        joint("right_wheel", "base", "right", "continuous", LEVEL, '<origin xyz="0 -0.3 0.1"/>'),
    ]
    path = write(tmp_path / "trailing.urdf", robot(*parts))
    with pytest.raises(nmm.RobotError, match=r"the steered wheel below its steering axis.*front_wheel"):
        nmm.load(path, platform="car")
    assert nmm.load(path, platform="wheeled").u_names[0] == "v"


def test_a_steering_joints_velocity_limits_its_rate() -> None:
    car = nmm.load("car_base")
    assert car.u_limits[car.input("steering_rate")] == car.model.velocityLimit[car.coordinate("steering")]
    assert np.isinf(car.u_limits[car.input("v")])


def test_an_arm_is_the_same_from_its_file_and_loaded() -> None:
    """The wheels of a mobile robot that is carried stand still either way."""
    from_file = nmm.mount("unicycle_2r", "trailer_base", at="arm_base")
    loaded = nmm.mount("unicycle_2r", nmm.load("trailer_base"), at="arm_base")
    assert from_file.q_names == loaded.q_names


@pytest.mark.parametrize(
    "placement",
    [pin.SE3(np.eye(3), np.array([np.nan, 0, 0])), pin.SE3(2 * np.eye(3), np.zeros(3))],
    ids=["not finite", "no rotation"],
)
def test_a_placement_that_is_none_is_refused(placement: pin.SE3) -> None:
    with pytest.raises(nmm.RobotError, match="placement: "):
        nmm.mount("car_base", "small_arm", placement=placement)


def test_names_are_strings() -> None:
    with pytest.raises(nmm.RobotError, match="name: expected a string, got 3"):
        nmm.load("unicycle_2r", name=3)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(nmm.RobotError, match="name: expected a string, got 3"):
        nmm.mount("car_base", "small_arm", name=3)  # type: ignore[arg-type]  # wrong on purpose


@pytest.mark.parametrize("function", [nmm.Position("tip", "xy"), nmm.CenterOfMass("xy")], ids=["tip", "mass"])
def test_a_robot_of_one_joint(function: nmm.extending.Function, tmp_path: Path) -> None:
    """For one coordinate Pinocchio's Jacobians are vectors."""
    parts = [link("base"), link("arm", inertial()), link("tip")]
    parts += [joint("q1", "base", "arm", body=UP), joint("end", "arm", "tip", "fixed", "")]
    one = nmm.load(write(tmp_path / "one.urdf", robot(*parts)), platform="fixed")
    assert one.q_names == ("q1",)
    step = 1e-6
    ahead, behind = (nmm.evaluate(function, 0.0, Configuration(one, [0.4 + way])) for way in (step, -step))
    here = nmm.evaluate(function, 0.0, Configuration(one, [0.4]))
    np.testing.assert_allclose(here.value_q[:, 0], (ahead.value - behind.value) / (2 * step), atol=1e-9)
