"""Loading against independent readers: yourdfpy's kinematics, and Pinocchio's plain build of the file."""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
import xacro
import yourdfpy
from findings import assert_found, of_code, refused, refused_for
from numpy.typing import NDArray
from urdf_parts import AXIS, LIMIT, inertial, joint, link, random_tree, robot, shape, write

import nmm.base.bundled as bundled
from nmm.base.bundled import bundled_robots, bundled_scenarios
from nmm.base.errors import InputError, NmmError, RobotError
from nmm.model.platforms import PLATFORMS, Layout, Unicycle
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot

pytestmark = pytest.mark.usefixtures("xacro_each_time")

Array = NDArray[np.float64]

SHARE = next(p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix") / "share"
DATA = SHARE / "example-robot-data" / "robots"
# Arms alone, a tree with wheels, continuous joints, meshes of three formats.
FILES = {
    "ur5": DATA / "ur_description/urdf/ur5_robot.urdf",
    "xarm7": DATA / "xarm_description/urdf/xarm7.urdf",
    "kinova": DATA / "kinova_description/robots/kinova.urdf",
    "talos_left_arm": DATA / "talos_data/robots/talos_left_arm.urdf",
    "tiago_no_hand": DATA / "tiago_description/robots/tiago_no_hand.urdf",
}
ARM = {"unicycle_2r": ("q1", "q2"), "unicycle_3r": ("q1", "q2", "q3")}
OTHER = {"d": -0.2, "h": 0.5, "l1": 0.7, "l2": 0.6, "wheel_radius": 0.15, "track": 0.5}

each_bundled = pytest.mark.parametrize("name", list(ARM))


def expanded(name: str, arguments: dict[str, float] | None = None) -> str:
    given = {key: str(value) for key, value in (arguments or {}).items()}
    return str(xacro.process_file(str(bundled_robots()[name]), mappings=given).toxml())


def platform_pose(q: Array) -> Array:
    """The chain's pose written out: rotation about z by theta, then x and y."""
    c, s = np.cos(q[2]), np.sin(q[2])
    return np.array([[c, -s, 0, q[0]], [s, c, 0, q[1]], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def random_q(rng: np.random.Generator, model: pin.Model) -> Array:
    return np.concatenate([rng.uniform(-5, 5, 2), rng.uniform(-20, 20, 1), rng.uniform(-2, 2, model.nq - 3)])


def placements(model: pin.Model, q: Array) -> dict[str, Array]:
    """World placements of the links' frames."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    bodies = [(i, f.name) for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY]
    return {name: data.oMf[i].homogeneous for i, name in bodies}


def by_name(model: pin.Model, q: Array) -> dict[str, float]:
    return {str(model.names[i]): float(q[model.joints[i].idx_q]) for i in range(1, model.njoints)}


def full(source: pin.Model, values: dict[str, float]) -> Array:
    """A configuration of a plain Pinocchio model: (cos, sin) where it has such joints, zero by default."""
    q = pin.neutral(source)
    for i in range(1, source.njoints):
        j, value = source.joints[i], values.get(str(source.names[i]))
        if value is not None:
            q[j.idx_q : j.idx_q + j.nq] = [np.cos(value), np.sin(value)] if j.nq == 2 else [value]
    return q


def assert_kinematics_as_yourdfpy(robot: Robot, text: str, rng: np.random.Generator) -> None:
    twin = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=True)
    for model in (robot.model, robot.display_model):
        for _ in range(4):
            q = random_q(rng, model)
            values = by_name(model, q)
            twin.update_cfg({name: values.get(name, 0.0) for name in twin.actuated_joint_names})
            found = placements(model, q)
            assert set(found) == set(twin.link_map)
            for name, placement in found.items():
                expected = platform_pose(q) @ twin.get_transform(name, twin.base_link)
                np.testing.assert_allclose(placement, expected, atol=1e-10, err_msg=name)


# -------------------------------------------------------------------------------------------- kinematics


@each_bundled
@pytest.mark.parametrize("arguments", [{}, OTHER], ids=["paper", "other"])
def test_bundled_kinematics(name: str, arguments: dict[str, float], rng: np.random.Generator) -> None:
    loaded = load(name, arguments=arguments)
    assert loaded.q_names == ("x", "y", "theta", *ARM[name])
    assert loaded.model.nq == loaded.model.nv == loaded.n == 3 + len(ARM[name])
    assert_kinematics_as_yourdfpy(loaded, expanded(name, arguments), rng)


@pytest.mark.parametrize("name", list(FILES))
def test_kinematics_of_other_robots(
    name: str, rng: np.random.Generator, capfd: pytest.CaptureFixture[str]
) -> None:
    loaded = load(FILES[name])
    text = FILES[name].read_text(encoding="utf-8")
    plain = pin.buildModelFromXML(text)
    wheels = [wheel.joint for wheel in loaded.wheels]
    assert loaded.q_names == ("x", "y", "theta", *(n for n in list(plain.names)[1:] if n not in wheels))
    assert loaded.model.nq == loaded.model.nv
    assert loaded.display_model.nq == loaded.display_model.nv == loaded.model.nq + len(wheels)
    assert_kinematics_as_yourdfpy(loaded, text, rng)
    assert capfd.readouterr() == ("", "")


#: Robots of example-robot-data, and what is locked to load them.
PUBLIC: dict[str, tuple[str, dict[str, float]]] = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", {}),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", {}),
    "panda": ("panda_description/urdf/panda.urdf", {"panda_finger_joint1": 0.015}),
    "kinova": ("kinova_description/robots/kinova.urdf", {}),
    "tiago_no_hand": (
        "tiago_description/robots/tiago_no_hand.urdf",
        {"head_1_joint": 0.3, "head_2_joint": -0.2},
    ),
    "z1": ("z1_description/urdf/z1.urdf", {}),
}


@pytest.mark.parametrize("name", list(PUBLIC))
def test_public_robots_as_yourdfpy_has_them(name: str, rng: np.random.Generator) -> None:
    """Every link on 100 configurations; joints that follow locked ones stand where yourdfpy puts them."""
    file, lock = PUBLIC[name]
    loaded = load(f"package://example-robot-data/robots/{file}", lock=lock)
    twin = yourdfpy.URDF.load(str(DATA / file), load_meshes=False, build_scene_graph=True)
    model = loaded.display_model
    for _ in range(100):
        q = random_q(rng, model)
        values = by_name(model, q) | lock
        twin.update_cfg({joint: values[joint] for joint in twin.actuated_joint_names})
        pose, found = platform_pose(q), placements(model, q)
        assert set(found) == set(twin.link_map)
        graph = twin.scene.graph
        for link_name, placement in found.items():
            expected = pose @ graph.get(link_name, twin.base_link)[0]
            assert np.abs(placement - expected).max() < 1e-10, link_name
    assert loaded.parts.provenance.locked == lock


@pytest.fixture(params=[3, 8, 20])
def tree(request: pytest.FixtureRequest, tmp_path: Path, rng: np.random.Generator) -> tuple[Path, str]:
    text = random_tree(rng, request.param)
    return write(tmp_path / "tree.urdf", text), text


def test_kinematics_of_random_trees(tree: tuple[Path, str], rng: np.random.Generator) -> None:
    loaded = load(tree[0])
    assert_kinematics_as_yourdfpy(loaded, tree[1], rng)
    plain = pin.buildModelFromXML(tree[1])
    assert loaded.q_names[3:] == tuple(list(plain.names)[1:])
    assert {f.name for f in plain.frames} | {"x", "y", "theta"} == {f.name for f in loaded.model.frames}
    for f in plain.frames:
        assert loaded.model.existFrame(f.name, f.type), f.name


def test_jacobian_is_the_derivative(tree: tuple[Path, str], rng: np.random.Generator) -> None:
    model = load(tree[0]).model
    data, q, step = model.createData(), random_q(rng, model), 1e-6
    pin.computeJointJacobians(model, data, q)
    pin.framesForwardKinematics(model, data, q)
    for f in range(model.nframes):
        analytic = pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)
        rotation = data.oMf[f].rotation.copy()
        for k, e in enumerate(np.eye(model.nq)):
            ends = []
            for sign in (1, -1):
                other = model.createData()
                pin.framesForwardKinematics(model, other, q + sign * step * e)
                ends.append(other.oMf[f])
            linear = (ends[0].translation - ends[1].translation) / (2 * step)
            angular = rotation @ pin.log3(ends[1].rotation.T @ ends[0].rotation) / (2 * step)
            spin = (ends[0].rotation - ends[1].rotation) @ rotation.T / (2 * step)
            np.testing.assert_allclose(analytic[:3, k], linear, atol=2e-7)
            np.testing.assert_allclose(analytic[3:, k], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=2e-7)
            np.testing.assert_allclose(analytic[3:, k], angular, atol=2e-7)


@each_bundled
def test_coordinates_are_plain_numbers(name: str, rng: np.random.Generator) -> None:
    """q + v is the configuration after v, and theta counts its turns."""
    model = load(name).model
    q, v = random_q(rng, model), rng.normal(size=model.nv) * 10
    np.testing.assert_array_equal(pin.integrate(model, q, v), q + v)
    np.testing.assert_allclose(pin.difference(model, q, q + v), v, atol=1e-12)
    turned, back = q.copy(), q.copy()
    turned[2], back[2] = 20.0, 20.0 - 6 * np.pi
    ours, same = placements(model, turned), placements(model, back)
    for body, placement in ours.items():
        np.testing.assert_allclose(placement, same[body], atol=1e-12)
        np.testing.assert_allclose(
            placement,
            platform_pose(turned) @ np.linalg.inv(platform_pose(q)) @ placements(model, q)[body],
            atol=1e-12,
        )


def test_x_y_theta_are_three_simple_joints(robots: dict[str, Robot]) -> None:
    for loaded in robots.values():
        kinds = [loaded.model.joints[i].shortname() for i in (1, 2, 3)]
        assert kinds == ["JointModelPX", "JointModelPY", "JointModelRZ"]
        for limit, sign in ((loaded.model.lowerPositionLimit, -1), (loaded.model.upperPositionLimit, 1)):
            np.testing.assert_array_equal(limit, np.full(loaded.n, sign * np.inf))


def test_limits_and_dynamics_are_the_files(tree: tuple[Path, str]) -> None:
    model, plain = load(tree[0]).model, pin.buildModelFromXML(tree[1])
    for i in range(1, plain.njoints):
        ours = model.joints[model.getJointId(plain.names[i])]
        for name in (
            "velocityLimit",
            "upperEffortLimit",
            "lowerEffortLimit",
            "damping",
            "upperDryFrictionLimit",
        ):
            assert getattr(model, name)[ours.idx_v] == getattr(plain, name)[plain.joints[i].idx_v], name
        assert model.damping[ours.idx_v] > 0
        lower, upper = model.lowerPositionLimit[ours.idx_q], model.upperPositionLimit[ours.idx_q]
        if plain.joints[i].nq == 2:
            assert (lower, upper) == (-np.inf, np.inf)
        else:
            assert lower == plain.lowerPositionLimit[plain.joints[i].idx_q]
            assert upper == plain.upperPositionLimit[plain.joints[i].idx_q]
    assert np.all(np.isinf(model.velocityLimit[:3]))


def test_masses_go_along(tree: tuple[Path, str], rng: np.random.Generator) -> None:
    """Total mass, centre of mass and, for the arm's joints, the inertia matrix are the plain model's."""
    model, plain = load(tree[0]).model, pin.buildModelFromXML(tree[1], pin.JointModelFreeFlyer())
    q = random_q(rng, model)
    values = {**by_name(model, q)}
    there = full(plain, values)
    there[:7] = pin.SE3ToXYZQUAT(pin.SE3(platform_pose(q)))
    data, other = model.createData(), plain.createData()
    assert pin.computeTotalMass(model) == pytest.approx(pin.computeTotalMass(plain), rel=1e-12)
    np.testing.assert_allclose(
        pin.centerOfMass(model, data, q), pin.centerOfMass(plain, other, there), atol=1e-10
    )
    ours = np.array(pin.crba(model, data, q))
    theirs = np.array(pin.crba(plain, other, there))
    order = [plain.joints[plain.getJointId(name)].idx_v for name in list(model.names)[4:]]
    np.testing.assert_allclose(ours[3:, 3:], theirs[np.ix_(order, order)], atol=1e-9)


def assert_frames_are_a_tree(model: pin.Model) -> None:
    """Every frame's parent comes before it, on the same joint or the one above: going up ends."""
    for i, f in enumerate(model.frames):
        above = model.frames[f.parentFrame]
        assert i == 0 or f.parentFrame < i, f.name
        assert above.parentJoint in (f.parentJoint, model.parents[f.parentJoint]), f.name
        assert f.type != pin.FrameType.JOINT or model.names[f.parentJoint] == f.name


def test_frames_climb_to_the_universe(robots: dict[str, Robot]) -> None:
    for loaded in robots.values():
        assert_frames_are_a_tree(loaded.model)
        assert_frames_are_a_tree(loaded.display_model)


# ---------------------------------------------------------------------------------------------- geometry


@pytest.mark.parametrize("name", ["ur5", pytest.param("tiago_no_hand", marks=pytest.mark.thorough), "tree"])
def test_shapes_are_where_pinocchio_puts_them(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    path = FILES.get(name) or write(tmp_path / "tree.urdf", random_tree(rng, 8))
    loaded = load(path)
    plain = pin.buildModelFromUrdf(str(path))
    pairs = (
        (loaded.display_model, loaded.visual_model, pin.VISUAL),
        (loaded.model, loaded.collision_model, pin.COLLISION),
    )
    for model, shapes, kind in pairs:
        expected = pin.buildGeomFromUrdf(plain, str(path), kind, package_dirs=[str(SHARE)])
        assert [s.name for s in shapes.geometryObjects] == [s.name for s in expected.geometryObjects]
        assert expected.ngeoms > 0
        for q in (np.zeros(model.nq), random_q(rng, model)):
            placed, reference = shapes.createData(), expected.createData()
            pin.updateGeometryPlacements(model, model.createData(), shapes, placed, q)
            there = full(plain, by_name(model, q))
            pin.updateGeometryPlacements(plain, plain.createData(), expected, reference, there)
            for mine, its, s, e in zip(
                placed.oMg, reference.oMg, shapes.geometryObjects, expected.geometryObjects, strict=True
            ):
                np.testing.assert_allclose(
                    mine.homogeneous, platform_pose(q) @ its.homogeneous, atol=1e-10, err_msg=s.name
                )
                assert model.frames[s.parentFrame].name == plain.frames[e.parentFrame].name
                assert model.frames[s.parentFrame].parentJoint == s.parentJoint
                np.testing.assert_array_equal(s.meshColor, e.meshColor)
                np.testing.assert_array_equal(s.meshScale, e.meshScale)
                if e.meshPath not in ("", "BOX", "SPHERE", "CYLINDER"):
                    assert Path(s.meshPath).samefile(e.meshPath)


def write_box(path: Path) -> Path:
    """A unit cube as a mesh file, in the format that the suffix names."""
    trimesh.creation.box((1, 1, 1)).export(path, file_type=path.suffix[1:].lower())
    return path


def mesh_robot(filename: str) -> str:
    return robot(link("a", shape(f'<mesh filename="{filename}" scale="1 2 3"/>')), link("b"), joint())


@pytest.mark.parametrize("suffix", [".stl", ".STL", ".obj", ".dae", ".ply", ".glb", ".gltf", ".off", ".3mf"])
def test_mesh_formats(suffix: str, tmp_path: Path) -> None:
    mesh = write_box(tmp_path / f"part{suffix}")
    (part,) = load(as_file(tmp_path, mesh_robot(mesh.name))).visual_model.geometryObjects
    assert Path(part.meshPath) == mesh
    np.testing.assert_array_equal(part.meshScale, [1, 2, 3])
    part.geometry.computeLocalAABB()
    np.testing.assert_allclose(part.geometry.aabb_local.max_, [0.5, 1, 1.5], atol=1e-6)


@pytest.mark.parametrize(
    "name", ["part.stl", "../urdf/part.stl", "{}", "file://{}", "package://my robot/urdf/part.stl"]
)
def test_mesh_beside_the_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative to the file wherever one stands, absolute, or in the package that the file is in."""
    folder = tmp_path / "my robot" / "urdf"
    folder.mkdir(parents=True)
    mesh = write_box(folder / "part.stl")
    monkeypatch.chdir("/")
    texts = [name.format(mesh)]
    if name.startswith("file"):
        texts.append(name.format(str(mesh).replace(" ", "%20")))
    for text in texts:
        (part,) = load(as_file(folder, mesh_robot(text))).visual_model.geometryObjects
        assert Path(part.meshPath).samefile(mesh)


@pytest.mark.parametrize("scheme", ["package", "model"])
def test_mesh_in_a_package(scheme: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package, folder = tmp_path / "elsewhere" / "my robot", tmp_path / "robots"
    package.mkdir(parents=True)
    folder.mkdir()
    mesh = write_box(package / "part.stl")
    path = as_file(folder, mesh_robot(f"{scheme}://my robot/part.stl"))
    with refused_for(("mesh_missing", {"cause": "package", "package": "my robot"})):
        load(path)
    for given in ([package.parent], [str(package)], str(package)):
        (part,) = load(path, package_dirs=given).visual_model.geometryObjects
        assert Path(part.meshPath) == mesh
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{package.parent}")
    assert load(path).visual_model.ngeoms == 1


def test_source_in_a_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "my_robots" / "urdf"
    folder.mkdir(parents=True)
    write_box(folder / "part.stl")
    as_file(folder, mesh_robot("package://my_robots/urdf/part.stl"))
    name = "package://my_robots/urdf/r.urdf"
    loaded = load(name, package_dirs=[tmp_path])
    assert (loaded.source, loaded.q_names[3:]) == (name, ("j",))
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    assert load(name).parts.provenance.meshes == {"package://my_robots/urdf/part.stl": folder / "part.stl"}
    assert load(name).parts.provenance.packages == {"my_robots": tmp_path / "my_robots"}
    assert tmp_path in load(name).parts.provenance.searched
    with pytest.raises(RobotError) as caught:
        load("package://others/urdf/r.urdf")
    assert_found(caught.value.findings, ("package_missing", {"package": "others"}))
    assert str(tmp_path) in caught.value.findings[0].values["searched"]
    with refused_for(("mesh_missing", {"mesh": "package://my_robots/r.urdf", "cause": "file_in_package"})):
        load("package://my_robots/r.urdf")
    with refused(str(folder / "part.stl"), kind=RobotError, got="part.stl"):
        load("package://my_robots/urdf/part.stl")
    with refused_for(("package_missing", {"package": ""})):
        load("package://")


def test_missing_meshes_may_be_left_out(tmp_path: Path) -> None:
    """The shape is gone, the link and its other shapes stay, a note says so; other faults are faults."""
    mesh = shape('<mesh filename="package://nowhere/no.stl"/>')
    solid = shape('<sphere radius="0.1"/>')
    text = robot(link("a", mesh + solid), link("b", mesh.replace("visual", "collision")), joint())
    path = as_file(tmp_path, text)
    lost = ("mesh_missing", {"cause": "package", "package": "nowhere"})
    with refused_for(lost, lost):
        load(path)
    loaded = load(path, missing_meshes="skip")
    assert [part.name for part in loaded.visual_model.geometryObjects] == ["a_0"]
    assert loaded.collision_model.ngeoms == 0
    (note,) = of_code(loaded.notes, "shapes_left_out")
    assert note.values["names"] == ["package://nowhere/no.stl"]
    assert loaded.parts.provenance.meshes == {"package://nowhere/no.stl": None}
    assert loaded.parts.provenance.packages == {"nowhere": None}
    write(tmp_path / "part.step", "")
    unknown = as_file(tmp_path, mesh_robot("part.step"))
    with refused_for(("mesh_format_unknown", {})):
        load(unknown, missing_meshes="skip")
    with refused(kind=RobotError, got="ignore", available=("error", "skip")):
        load(path, missing_meshes="ignore")  # type: ignore[arg-type]  # wrong on purpose


# ------------------------------------------------------------------------------------------------ wheels


@each_bundled
@pytest.mark.parametrize("arguments", [{}, OTHER], ids=["paper", "other"])
def test_bundled_wheels(name: str, arguments: dict[str, float]) -> None:
    loaded = load(name, arguments=arguments)
    radius, half = arguments.get("wheel_radius", 0.1), arguments.get("track", 0.4) / 2
    assert [wheel.joint for wheel in loaded.wheels] == ["left_wheel_joint", "right_wheel_joint"]
    for wheel, side in zip(loaded.wheels, (half, -half), strict=True):
        np.testing.assert_allclose(wheel.center, [0, side, radius], atol=1e-12)
        np.testing.assert_allclose(wheel.axis, [0, 1, 0], atol=1e-12)
        assert wheel.radius == pytest.approx(radius, abs=1e-12)


def test_wheels_turn_on_the_display_model_only(robots: dict[str, Robot], rng: np.random.Generator) -> None:
    for loaded in robots.values():
        model, display = loaded.model, loaded.display_model
        q = random_q(rng, model)
        values = by_name(model, q) | {wheel.joint: rng.uniform(-9, 9) for wheel in loaded.wheels}
        shown = np.array([values[str(name)] for name in list(display.names)[1:]])
        ours, theirs = placements(model, q), placements(display, shown)
        turned = {wheel.joint.removesuffix("_joint"): wheel for wheel in loaded.wheels}
        for name, placement in ours.items():
            if name not in turned:
                np.testing.assert_allclose(theirs[name], placement, atol=1e-13)
                continue
            wheel = turned[name]
            spin = platform_pose(q)[:3, :3] @ pin.exp3(wheel.axis * values[wheel.joint])
            np.testing.assert_allclose(theirs[name][:3, :3], spin, atol=1e-12)
            np.testing.assert_allclose(
                theirs[name][:3, 3], (platform_pose(q) @ [*wheel.center, 1])[:3], atol=1e-12
            )


def wheeled(
    name: str = "w_joint",
    child: str = "wheel",
    axis: str = "0 0 1",
    origin: str = '<origin xyz="0 0.2 0.07" rpy="-1.5708 0 0"/>',
    kind: str = "continuous",
    solid: str = "",
    more: str = "",
) -> str:
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    return robot(
        link("base"),
        link(child, solid),
        joint(name, "base", child, kind, f'<axis xyz="{axis}"/>{limit}', origin),
        link("arm"),
        joint("arm_joint", "base", "arm"),
        more,
    )


def as_file(tmp_path: Path, text: str) -> Path:
    return write(tmp_path / "r.urdf", text)


@pytest.mark.parametrize(
    ("text", "wheels"),
    [
        (wheeled(), 1),
        (wheeled(child="w", name="Left_WHEEL"), 1),
        (wheeled(kind="revolute"), 1),
        (wheeled(child="w"), 0),
        (wheeled(origin='<origin xyz="0 0 0.1"/>'), 0),  # a vertical axis: a caster's swivel
        (wheeled(kind="prismatic"), 0),
        (wheeled(more=link("c") + joint("c_joint", "wheel", "c")), 0),
        (wheeled(more=link("c") + joint("c_joint", "wheel", "c", "fixed")), 1),
        (wheeled(child="w", more=link("wheel_cover") + joint("c_joint", "w", "wheel_cover", "fixed")), 0),
        (
            wheeled(
                more=link("c_wheel") + joint("c_joint", "arm", "c_wheel", body='<axis xyz="1 0 0"/>' + LIMIT)
            ),
            1,
        ),
    ],
)
def test_what_is_a_wheel(text: str, wheels: int, tmp_path: Path) -> None:
    loaded = load(as_file(tmp_path, text))
    assert len(loaded.wheels) == wheels
    assert loaded.display_model.nq == loaded.model.nq + wheels
    if wheels:
        assert "arm_joint" in loaded.q_names
        np.testing.assert_allclose(loaded.wheels[0].center, [0, 0.2, 0.07], atol=1e-12)
        np.testing.assert_allclose(loaded.wheels[0].axis, [0, 1, 0], atol=1e-5)
        assert loaded.wheels[0].radius == pytest.approx(0.07)
        assert of_code(loaded.notes, "wheels_left_out")


def test_wheel_left_a_coordinate_is_noted(tmp_path: Path) -> None:
    loaded = load(as_file(tmp_path, wheeled(origin='<origin xyz="0 0 0.1"/>')))
    about = {"name": "w_joint", "why": "axis_not_level"}
    assert_found(of_code(loaded.notes, "not_a_wheel"), ("not_a_wheel", about))


def test_wheels_as_asked(tmp_path: Path) -> None:
    path = as_file(tmp_path, wheeled(child="w"))
    assert [wheel.joint for wheel in load(path, wheels=["w_joint"]).wheels] == ["w_joint"]
    assert load(path, wheels={"w_joint": 0.3}).wheels[0].radius == 0.3
    named = as_file(tmp_path, wheeled())
    assert load(named, wheels=()).wheels == ()
    assert "w_joint" in load(named, wheels=()).q_names


@pytest.mark.parametrize(
    ("wheels", "where", "got"),
    [
        (["nothing"], "", "nothing"),
        (["theta"], "", "theta"),
        ("w_joint", ": wheels", "w_joint"),
        (5, ": wheels", 5),
        ({"w_joint": -1.0}, ": wheels: radius of w_joint", -1.0),
        ({"w_joint": "big"}, ": wheels: radius of w_joint", "big"),
    ],
)
def test_wheels_that_are_none(wheels: object, where: str, got: object, tmp_path: Path) -> None:
    path = as_file(tmp_path, wheeled())
    with refused(f"{path}{where}", kind=RobotError, got=got):
        load(path, wheels=wheels)  # type: ignore[arg-type]  # wrong on purpose
    with refused_for(("no_wheel", {"name": "arm_joint", "why": "axis_not_level"})):
        load(path, wheels=["arm_joint"])


@pytest.mark.parametrize("height", [0.0, -0.1])
def test_radius_from_the_shape(height: float, tmp_path: Path) -> None:
    origin = f'<origin xyz="0 0.2 {height}" rpy="-1.5708 0 0"/>'
    cylinder, sphere = '<cylinder radius="0.12" length="0.05"/>', '<sphere radius="0.11"/>'
    for solid, radius in (
        (shape(cylinder, "collision"), 0.12),
        (shape(sphere, "visual"), 0.11),
        (shape(cylinder, "visual") + shape(sphere, "collision"), 0.11),
        (shape(cylinder, "visual") + shape('<box size="1 1 1"/>', "collision"), 0.12),
    ):
        loaded = load(as_file(tmp_path, wheeled(origin=origin, solid=solid)))
        assert loaded.wheels[0].radius == pytest.approx(radius)
    path = as_file(tmp_path, wheeled(origin=origin, solid=shape('<box size="1 1 1"/>')))
    blind = load(path)  # as a unicycle, which needs none
    assert_found(of_code(blind.notes, "radius_unknown"), ("radius_unknown", {"names": ["w_joint"]}))
    assert blind.wheels == ()
    assert "w_joint" not in blind.q_names
    assert load(path, wheels={"w_joint": 0.2}).wheels[0].radius == 0.2


@pytest.mark.parametrize(("height", "radius"), [(0.05, 0.12), (0.3, 0.12), (0.1195, 0.1195)])
def test_a_shape_says_the_radius_where_the_root_is_not_on_the_ground(
    height: float, radius: float, tmp_path: Path
) -> None:
    """As of Husky: its root link is 0.13 m over the ground, and its wheels' centres 0.033 m over that."""
    origin = f'<origin xyz="0 0.2 {height}" rpy="-1.5708 0 0"/>'
    solid = shape('<cylinder radius="0.12" length="0.05"/>', "collision")
    assert load(as_file(tmp_path, wheeled(origin=origin, solid=solid))).wheels[0].radius == radius
    bare = load(as_file(tmp_path, wheeled(origin=origin, solid=shape('<box size="1 1 1"/>'))))
    assert bare.wheels[0].radius == height


# -------------------------------------------------------------------------------------- Pinocchio models


def arm_text() -> str:
    """A root link with a shape and mass, a bounded, an oblique continuous and a sliding joint."""
    oblique = '<axis xyz="0.6 0 0.8"/>'
    return robot(
        link("base", inertial() + shape('<box size="1 1 1"/>')),
        *(link(name, inertial(2.0, "0.1 0 0")) + "" for name in ("b", "c", "d")),
        joint("first", "base", "b"),
        joint("second", "b", "c", "continuous", oblique),
        joint("third", "c", "d", "prismatic", '<axis xyz="0 1 0"/>' + LIMIT),
        link("camera", shape('<sphere radius="0.1"/>')),
        joint("mount", "base", "camera", "fixed"),
    )


ROOTS = {
    "fixed": None,
    "planar": pin.JointModelPlanar(),
    "free flyer": pin.JointModelFreeFlyer(),
}


def pose_numbers(root: str, q: Array) -> list[float]:
    if root == "planar":
        return [q[0], q[1], np.cos(q[2]), np.sin(q[2])]
    return [q[0], q[1], 0, 0, 0, np.sin(q[2] / 2), np.cos(q[2] / 2)] if root == "free flyer" else []


@pytest.mark.parametrize("root", list(ROOTS))
def test_pinocchio_model(root: str, rng: np.random.Generator) -> None:
    text, joint_model = arm_text(), ROOTS[root]
    model = pin.buildModelFromXML(text) if joint_model is None else pin.buildModelFromXML(text, joint_model)
    shapes = pin.buildGeomFromUrdfString(model, text, pin.VISUAL)
    before, shapes_before = model.copy(), shapes.copy()

    loaded = load(model, visual_model=shapes, collision_model=shapes)

    assert loaded.q_names == ("x", "y", "theta", "first", "second", "third")
    assert (loaded.source, loaded.name) == ("pin.Model", "r")
    assert loaded.model.nq == loaded.model.nv == 6
    assert model == before
    assert shapes == shapes_before
    for _ in range(5):
        q = random_q(rng, loaded.model)
        q[3:] = rng.uniform(-9, 9, 3)
        there = full(model, by_name(loaded.model, q))
        pose = pose_numbers(root, q)
        there[: len(pose)] = pose
        moved = platform_pose(q) if root == "fixed" else np.eye(4)
        for name, placement in placements(model, there).items():
            np.testing.assert_allclose(
                placements(loaded.model, q)[name], moved @ placement, atol=1e-12, err_msg=name
            )
        placed, expected = shapes.createData(), shapes.createData()
        pin.updateGeometryPlacements(
            loaded.display_model, loaded.display_model.createData(), loaded.visual_model, placed, q
        )
        pin.updateGeometryPlacements(model, model.createData(), shapes, expected, there)
        for mine, its in zip(placed.oMg, expected.oMg, strict=True):
            np.testing.assert_allclose(mine.homogeneous, moved @ its.homogeneous, atol=1e-12)
    assert {f.name for f in model.frames} <= {f.name for f in loaded.model.frames}
    assert_frames_are_a_tree(loaded.model)
    if root != "fixed":
        assert of_code(loaded.notes, "root_replaced")


def test_model_that_has_the_chain_is_kept(rng: np.random.Generator) -> None:
    first = load(pin.buildModelFromXML(arm_text()))
    again = load(first.model)
    for name in ("frames", "joints", "inertias"):
        pairs = zip(getattr(again.model, name), getattr(first.model, name), strict=True)
        assert all(mine == its for mine, its in pairs), name
    for name in ("lowerPositionLimit", "velocityLimit", "upperEffortLimit", "rotorGearRatio"):
        np.testing.assert_array_equal(getattr(again.model, name), getattr(first.model, name))
    assert again.model is not first.model
    chain = pin.Model()
    parent = 0
    for name, kind in (("x", pin.JointModelPX()), ("y", pin.JointModelPY()), ("theta", pin.JointModelRUBZ())):
        parent = chain.addJoint(parent, kind, pin.SE3.Identity(), name)
    place = pin.SE3.Random()
    chain.addJoint(parent, pin.JointModelRUBY(), place, "arm")
    loaded = load(chain)
    assert loaded.q_names == ("x", "y", "theta", "arm")
    assert loaded.name == "robot"
    q = random_q(rng, loaded.model)
    data = loaded.model.createData()
    pin.framesForwardKinematics(loaded.model, data, q)
    turn = pin.SE3(pin.exp3(np.array([0, q[3], 0])), np.zeros(3))
    np.testing.assert_allclose(
        data.oMf[loaded.frame_id("arm")].homogeneous,
        platform_pose(q) @ place.homogeneous @ turn.homogeneous,
        atol=1e-12,
    )


def test_limits_of_a_chain_are_kept() -> None:
    """Velocity and effort limits of x, y and theta, and where they may be."""
    model, parent = pin.Model(), 0
    for i, (name, kind) in enumerate(
        (("x", pin.JointModelPX()), ("y", pin.JointModelPY()), ("theta", pin.JointModelRZ()))
    ):
        bounds = [np.full(1, value + i) for value in (-5.0, 5.0, -1.0, 1.0, -30.0, 30.0, 0.1, 0.1, 0.2)]
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name, *bounds)
    model.addJoint(parent, pin.JointModelRX(), pin.SE3.Random(), "arm")
    loaded = load(model)
    np.testing.assert_array_equal(loaded.model.velocityLimit[:3], [1, 2, 3])
    np.testing.assert_array_equal(loaded.model.upperEffortLimit[:3], [5, 6, 7])
    np.testing.assert_array_equal(loaded.model.lowerPositionLimit[:3], [-30, -29, -28])
    np.testing.assert_array_equal(loaded.model.damping[:3], [0.2, 1.2, 2.2])
    np.testing.assert_array_equal(loaded.q_limits[:3, 1], [30, 31, 32])


@pytest.mark.parametrize("root", list(ROOTS))
def test_reference_configurations_go_along(root: str, rng: np.random.Generator) -> None:
    """Those of an SRDF, by joint: continuous ones as an angle, x, y, theta at 0, locked ones left out."""
    text, joint_model = arm_text(), ROOTS[root]
    model = pin.buildModelFromXML(text) if joint_model is None else pin.buildModelFromXML(text, joint_model)
    values = {"first": 0.3, "second": -2.5, "third": 0.7}
    model.referenceConfigurations["home"] = full(model, values)
    for lock in ({}, {"third": 0.1}):
        loaded = load(model, lock=lock)
        kept = {entry.key(): np.array(entry.data()) for entry in loaded.model.referenceConfigurations}
        expected = [0, 0, 0, *(values[name] for name in loaded.q_names[3:])]
        np.testing.assert_allclose(kept["home"], expected, atol=1e-15)


def test_root_joint_that_is_not_at_the_origin(rng: np.random.Generator) -> None:
    """The chain starts where the planar joint did; what stands in the world stays there."""
    model, place = pin.Model(), pin.SE3.Random()
    root = model.addJoint(0, pin.JointModelPlanar(), place, "root")
    model.addFrame(pin.Frame("post", 0, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    arm = model.addJoint(root, pin.JointModelRX(), pin.SE3.Random(), "arm")
    frame = model.addJointFrame(arm, model.addJointFrame(root, 0))
    model.addFrame(pin.Frame("tip", arm, frame, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    loaded = load(model)
    q = np.array([1.0, 2.0, 0.7, -0.4])
    data, other = loaded.model.createData(), model.createData()
    pin.framesForwardKinematics(loaded.model, data, q)
    pin.framesForwardKinematics(model, other, np.array([1.0, 2.0, np.cos(0.7), np.sin(0.7), -0.4]))
    assert_frames_are_a_tree(loaded.model)
    for name in ("post", "tip"):
        mine, its = data.oMf[loaded.frame_id(name)], other.oMf[model.getFrameId(name)]
        np.testing.assert_allclose(mine.homogeneous, its.homogeneous, atol=1e-12)


def test_model_made_by_hand() -> None:
    """Without frames of joints, with shapes that name no frame, motors and collision pairs."""
    model = pin.Model()
    height = pin.SE3(np.eye(3), np.array([0, 0.2, 0.1]))
    wheel = model.addJoint(0, pin.JointModelRUBY(), height, "wheel")
    elbow = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "elbow")
    model.armature[:], model.rotorInertia[:], model.rotorGearRatio[:] = [1, 2], [3, 4], [5, 6]
    shapes = pin.GeometryModel()
    for i, parent in enumerate((wheel, elbow, 0)):
        part = pin.GeometryObject(f"part{i}", parent, pin.SE3.Random(), coal.Sphere(0.1))
        shapes.addGeometryObject(part)
    shapes.addCollisionPair(pin.CollisionPair(0, 1))

    loaded = load(model, visual_model=shapes, collision_model=shapes)

    assert loaded.q_names == ("x", "y", "theta", "elbow")
    assert_frames_are_a_tree(loaded.model)
    assert_frames_are_a_tree(loaded.display_model)
    for name in ("velocityLimit", "upperEffortLimit", "upperPositionLimit"):
        np.testing.assert_array_equal(getattr(loaded.model, name), np.full(4, np.inf))
    assert list(loaded.display_model.names)[1:] == ["x", "y", "theta", "wheel", "elbow"]
    for name, own in (("armature", 2), ("rotorInertia", 4), ("rotorGearRatio", 6)):
        assert getattr(loaded.model, name)[3] == own
    for tree, geometry in (
        (loaded.model, loaded.collision_model),
        (loaded.display_model, loaded.visual_model),
    ):
        assert geometry.collisionPairs[0] == pin.CollisionPair(0, 1)
        for part, original in zip(geometry.geometryObjects, shapes.geometryObjects, strict=True):
            assert tree.frames[part.parentFrame].parentJoint == part.parentJoint
            fixed = height if part.name == "part0" and tree is loaded.model else pin.SE3.Identity()
            assert part.placement.isApprox(fixed * original.placement)


def two_joints(second: object, name: str = "odd") -> pin.Model:
    model = pin.Model()
    first = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "arm")
    model.addJoint(first, second, pin.SE3.Identity(), name)
    return model


def composite() -> pin.JointModelComposite:
    made = pin.JointModelComposite()
    for part in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ()):
        made.addJoint(part)
    return made


@pytest.mark.parametrize(
    ("second", "kind"),
    [
        (pin.JointModelSpherical(), "Spherical"),
        (pin.JointModelSphericalZYX(), "SphericalZYX"),
        (pin.JointModelTranslation(), "Translation"),
        (pin.JointModelFreeFlyer(), "FreeFlyer"),
        (pin.JointModelPlanar(), "Planar"),
        (composite(), "Composite"),
    ],
)
def test_joints_with_more_freedom_are_refused(second: object, kind: str) -> None:
    with refused("pin.Model", kind=RobotError, what=f"odd ({kind})"):
        load(two_joints(second))


def test_helical_joint_keeps_its_pitch() -> None:
    loaded = load(two_joints(pin.JointModelHX(0.25)))
    data = loaded.model.createData()
    pin.framesForwardKinematics(loaded.model, data, np.array([0, 0, 0, 0, 2.0]))
    np.testing.assert_allclose(data.oMf[loaded.frame_id("odd")].translation, [0.5, 0, 0], atol=1e-12)


def test_shapes_on_a_joint_that_is_not_there() -> None:
    large = load(pin.buildModelFromXML(arm_text()))
    text = arm_text()
    shapes = pin.buildGeomFromUrdfString(pin.buildModelFromXML(text), text, pin.VISUAL)
    shapes.geometryObjects[0].parentJoint = 9
    with refused("visual_model", kind=RobotError, got="base_0"):
        load(large.model, visual_model=shapes)
    with refused("collision_model", kind=RobotError, got="shapes"):
        load(large.model, collision_model="shapes")  # type: ignore[arg-type]  # wrong on purpose


# ---------------------------------------------------------------------------------------- locked joints


def test_locked_joints(tmp_path: Path, rng: np.random.Generator) -> None:
    path = write(tmp_path / "arm.urdf", arm_text())
    whole, part = load(path), load(path, lock={"second": 0.7, "third": -0.2})
    assert part.q_names == ("x", "y", "theta", "first")
    (note,) = of_code(part.notes, "joints_locked")
    assert note.values["values"] == {"second": 0.7, "third": -0.2}
    q = random_q(rng, part.model)
    expected = placements(whole.model, np.array([*q, 0.7, -0.2]))
    for name, placement in placements(part.model, q).items():
        np.testing.assert_allclose(placement, expected[name], atol=1e-12)
    with refused(str(path), kind=RobotError, got="arm", available=("first", "second", "third")):
        load(path, lock={"arm": 1.0})
    with refused(f"{path}: lock: second", kind=RobotError, got=np.nan):
        load(path, lock={"second": np.nan})
    with refused("lock", kind=RobotError, got=["second"]):
        load(path, lock=["second"])  # type: ignore[arg-type]  # wrong on purpose


def mimicking(*mimics: str, leader: str = "revolute") -> str:
    """Joint j moves b, and each further joint k, l... the link c, d... with the <mimic> given."""
    names = "klmn"[: len(mimics)]
    followers = [
        joint(name, "b", f"of_{name}", body=AXIS + LIMIT + mimic)
        for name, mimic in zip(names, mimics, strict=True)
    ]
    body = AXIS + (LIMIT if leader != "fixed" else "")
    return robot(
        link("a"),
        link("b"),
        *(link(f"of_{name}") for name in names),
        joint(kind=leader, body=body),
        *followers,
    )


def test_mimic_joints_follow_locked_ones(tmp_path: Path) -> None:
    """At multiplier * value + offset, through each other, in any order in the file."""
    path = as_file(
        tmp_path,
        mimicking(
            '<mimic joint="l" multiplier="-0.5"/>',
            '<mimic joint="j" multiplier="2" offset="0.1"/>',
            '<mimic joint="j"/>',
        ),
    )
    loaded = load(path, lock={"j": 0.2})
    assert loaded.n == 3
    assert loaded.parts.provenance.mimicked == {
        "l": ("j", 0.5),
        "m": ("j", 0.2),
        "k": ("l", -0.25),
    }
    (note,) = of_code(loaded.notes, "mimics_locked")
    assert note.values["values"] == {"l": ["j", 0.5], "m": ["j", 0.2], "k": ["l", -0.25]}
    by_hand = load(path, lock={"j": 0.2, "k": -0.25, "l": 0.5, "m": 0.2})
    for name, placement in placements(by_hand.model, np.zeros(3)).items():
        np.testing.assert_allclose(placements(loaded.model, np.zeros(3))[name], placement, atol=1e-15)
    # A follower that is locked itself follows nobody; those behind it follow it.
    assert load(path, lock={"l": 0.4, "m": 0.0}).q_names == ("x", "y", "theta", "j")
    assert load(path, lock={"l": 0.4, "m": 0.0}).parts.provenance.mimicked == {"k": ("l", -0.2)}
    with refused("lock: l, which follows j", kind=RobotError, got=1.1):
        load(path, lock={"j": 0.5})


def test_mimic_of_a_fixed_joint(tmp_path: Path) -> None:
    path = as_file(tmp_path, mimicking('<mimic joint="j" offset="0.3"/>', leader="fixed"))
    assert load(path).parts.provenance.mimicked == {"k": ("j", 0.3)}


@pytest.mark.parametrize(
    ("mimic", "code", "values"),
    [
        ("<mimic/>", "attribute_missing", {"element": "mimic", "attribute": "joint"}),
        ('<mimic joint="j" multiplier="two"/>', "not_numbers", {"attribute": "multiplier", "got": "two"}),
        ('<mimic joint="k"/>', "mimic_cycle", {"joints": ["k", "k"]}),
    ],
)
def test_mimics_that_are_wrong(mimic: str, code: str, values: dict[str, object], tmp_path: Path) -> None:
    with refused_for((code, {"joint": "k", **values})):
        load(as_file(tmp_path, mimicking(mimic)), lock={"j": 0.0})


@pytest.mark.parametrize("value", [1.01, -2, 1e9])
def test_locked_outside_the_limits(value: float, tmp_path: Path) -> None:
    path = as_file(tmp_path, robot(link("a"), link("b"), joint()))
    with refused(f"{path}: lock: j", kind=RobotError, got=value):
        load(path, lock={"j": value})
    assert load(path, lock={"j": 1.0}).n == 3
    turning = as_file(tmp_path, robot(link("a"), link("b"), joint(kind="continuous", body=AXIS)))
    assert load(turning, lock={"j": value}).n == 3


# ------------------------------------------------------------------------------------------ axle, platform


def axled() -> str:
    """A root link over whose rear, turned by a quarter, the axle is; a tilted frame and an arm."""
    parts = [
        ("axle", '<origin xyz="-0.4 0.1 -0.2" rpy="0 0 1.5707963267948966"/>'),
        ("oblique", '<origin xyz="-0.4 0 0" rpy="0.1 0 0"/>'),
    ]
    wheel = joint(
        "wheel_joint",
        "base",
        "wheel",
        "continuous",
        '<axis xyz="1 0 0"/>',
        '<origin xyz="-0.4 0.4 -0.1"/>',
    )
    return robot(
        link(
            "base", inertial(2.0) + shape('<box size="1 1 1"/>') + shape('<box size="1 1 1"/>', "collision")
        ),
        *(link(name) + joint(f"{name}_joint", "base", name, "fixed", "", origin) for name, origin in parts),
        link("wheel", shape('<cylinder radius="0.1" length="0.1"/>', "collision")),
        wheel,
        link("arm", inertial() + shape('<sphere radius="0.1"/>', "collision")),
        joint("j", "base", "arm"),
    )


AXLE = pin.SE3(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), np.array([-0.4, 0.1, -0.2]))
AXLES: list[tuple[object, pin.SE3]] = [
    ("axle", AXLE),
    ((-0.4, 0.1, -0.2), pin.SE3(np.eye(3), AXLE.translation)),
    ([-0.4, 0.1], pin.SE3(np.eye(3), np.array([-0.4, 0.1, 0]))),
    (np.array([-0.4, 0.1]), pin.SE3(np.eye(3), np.array([-0.4, 0.1, 0]))),
]


@pytest.mark.parametrize(("axle", "place"), AXLES)
def test_axle(axle: object, place: pin.SE3, tmp_path: Path, rng: np.random.Generator) -> None:
    """Everything moves by the inverse of the axle's placement; the chain turns about it."""
    path = as_file(tmp_path, axled())
    plain, moved = load(path, axle=(0, 0)), load(path, axle=axle)  # type: ignore[arg-type]  # of several types
    for _ in range(5):
        q = random_q(rng, moved.model)
        still = np.concatenate([np.zeros(3), q[3:]])
        motion = platform_pose(q) @ place.inverse().homogeneous
        before, after = placements(plain.model, still), placements(moved.model, q)
        for name in before:
            np.testing.assert_allclose(after[name], motion @ before[name], atol=1e-12, err_msg=name)
        masses, solids = [], []
        for one, at in ((plain, still), (moved, q)):
            masses.append(pin.centerOfMass(one.model, one.model.createData(), at))
            placed = one.collision_model.createData()
            pin.updateGeometryPlacements(one.model, one.model.createData(), one.collision_model, placed, at)
            solids.append([pose.homogeneous for pose in placed.oMg])
        np.testing.assert_allclose(masses[1], (motion @ [*masses[0], 1])[:3], atol=1e-12)
        for here, there in zip(*solids, strict=True):
            np.testing.assert_allclose(there, motion @ here, atol=1e-12)
    assert_frames_are_a_tree(moved.model)
    (note,) = of_code(moved.notes, "reference_moved")
    np.testing.assert_allclose(note.values["at"], place.translation, atol=1e-12)
    (wheel,) = moved.wheels
    np.testing.assert_allclose(wheel.center, place.actInv(np.array([-0.4, 0.4, -0.1])), atol=1e-12)
    np.testing.assert_allclose(wheel.axis, place.rotation.T @ [1, 0, 0], atol=1e-12)


@pytest.mark.parametrize("axle", ["nowhere", "oblique", "arm", (1.0,), (1.0, np.nan), 3.0])
def test_axles_that_are_none(axle: object, tmp_path: Path) -> None:
    path = as_file(tmp_path, axled())
    with refused(f"{path}: axle", kind=RobotError, got=axle) as caught:
        load(path, axle=axle)  # type: ignore[arg-type]  # wrong on purpose
    there = {"theta", "base", "axle_joint"} <= {*(caught.value.available or ())}
    assert there == (axle == "nowhere")


def test_axle_of_a_locked_part(tmp_path: Path) -> None:
    """What stands still on the root link is part of it."""
    text = axled().replace('rpy="0.1 0.2 0.3"', 'rpy="0 0 0"')
    moved = load(as_file(tmp_path, text), axle="arm", lock={"j": 0.5})
    np.testing.assert_allclose(placements(moved.model, np.zeros(3))["arm"], np.eye(4), atol=1e-12)


def test_declared_platform(tmp_path: Path) -> None:
    for platform in ("unicycle", "fixed"):
        path = as_file(tmp_path, robot(f'<nmm platform="{platform}"/>', link("a"), link("b"), joint()))
        assert load(path).platform.name == platform
        assert load(path).parts.provenance.platform == "file"
        assert load(path, platform="unicycle").platform.name == "unicycle"
    assert load(path, platform="unicycle").parts.provenance.platform == "given"
    plain = load(as_file(tmp_path, robot(link("a"), link("b"), joint())))
    assert (plain.platform.name, plain.parts.provenance.platform) == ("unicycle", "default")
    expanded = robot('<nmm platform="fixed"/>', link("a"), attributes=f'name="r" {XACRO}')
    assert load(write(tmp_path / "r.xacro", expanded)).n == 0
    for declared, code, values in (
        ('<nmm platform="fixd"/>', "name_unknown", {"line": 1, "kind": "platform", "got": "fixd"}),
        ("<nmm/>", "attribute_missing", {"element": "nmm", "attribute": "platform"}),
        ('<nmm platform="fixed" wheelbase="1"/>', "name_unknown", {"kind": "attribute", "got": "wheelbase"}),
        ('<nmm platform="fixed"/>' * 2, "platform_twice", {}),
    ):
        with refused_for((code, values)):
            load(as_file(tmp_path, robot(declared, link("a"))))


class Measured(Unicycle):
    """A platform that measures what it is given, and needs two wheels."""

    name = "measured"
    seen: object = None

    @classmethod
    def fit(cls, layout: Layout) -> Measured:
        cls.seen = layout
        if len(layout.wheels) != 2:
            raise InputError(where="platform measured", expected="two wheels", got=len(layout.wheels))
        return cls()


def test_platform_is_measured_in_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the axle, with locked joints standing still; what it lacks is said with the file's name."""
    monkeypatch.setitem(PLATFORMS, "measured", Measured)
    loaded = load("unicycle_2r", platform="measured", axle=(0.1, 0.0))
    assert isinstance(loaded.platform, Measured)
    layout = Measured.seen
    assert isinstance(layout, Layout)
    assert [(wheel.joint, round(wheel.x, 12)) for wheel in layout.wheels] == [
        ("left_wheel_joint", -0.1),
        ("right_wheel_joint", -0.1),
    ]
    with refused("unicycle_2r: platform measured", kind=RobotError, got=1):
        load("unicycle_2r", platform="measured", lock={"left_wheel_joint": 0.0})


class Steered(Unicycle):
    """A platform with a joint of its own, for the order of coordinates only."""

    coordinates = ("x", "y", "theta", "steer")


def test_platforms_own_joints_come_first(tmp_path: Path) -> None:
    text = robot(
        *(link(name) for name in ("base", "a", "b", "s", "w")),
        joint("arm_1", "base", "a"),
        joint("arm_2", "a", "b"),
        joint("steer", "base", "s"),
        joint("wheel", "base", "w", "continuous", '<axis xyz="0 1 0"/>', '<origin xyz="0 0 0.1"/>'),
    )
    path = as_file(tmp_path, text)
    assert load(path).q_names == ("x", "y", "theta", "arm_1", "arm_2", "steer")
    assert load(path, platform=Steered()).q_names == ("x", "y", "theta", "steer", "arm_1", "arm_2")
    with refused("unicycle_2r", kind=RobotError, got="steer", available=("q1", "q2")):
        load("unicycle_2r", platform=Steered())
    with refused(str(path), kind=RobotError, got="steer", available=("arm_1", "arm_2")):
        load(path, platform=Steered(), lock={"steer": 0.0})


def test_platform_by_name() -> None:
    assert isinstance(load("unicycle_2r", platform="unicycle").platform, Unicycle)
    with refused(got="tank", available=("unicycle",)):
        load("unicycle_2r", platform="tank")
    with refused("platform", got=3):
        load("unicycle_2r", platform=3)  # type: ignore[arg-type]  # wrong on purpose


def test_platform_alone_is_noted(tmp_path: Path) -> None:
    loaded = load(as_file(tmp_path, robot(link("base"))))
    assert loaded.q_names == ("x", "y", "theta")
    assert of_code(loaded.notes, "no_arm")


# ------------------------------------------------------------------------------------------ files, xacro

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def test_arguments(tmp_path: Path) -> None:
    loaded = load("unicycle_2r", arguments={"l1": 0.75, "d": np.float64(0.1)})
    assert loaded.arguments["l1"] == "0.75"
    assert loaded.arguments["d"] == "0.1"
    assert loaded.arguments["l2"] == "0.3"
    assert list(loaded.arguments) == ["d", "h", "l1", "l2", "wheel_radius", "track"]
    text = robot(
        '<xacro:arg name="camera" default="false"/>',
        link("a"),
        f'<xacro:if value="$(arg camera)">{link("camera")}{joint("c", "a", "camera", "fixed")}</xacro:if>',
        attributes=f'name="r" {XACRO}',
    )
    path = write(tmp_path / "r.urdf.xacro", text)
    assert "camera" not in load(path).frames
    for true in (True, np.True_, 1, "true"):
        assert "camera" in load(path, arguments={"camera": true}).frames
    assert load(path, arguments={"camera": np.True_}).arguments == {"camera": "true"}


def test_includes_and_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Includes are found beside the file and, by package, in the caller's folders, the environment, above."""
    package = tmp_path / "parts_description"
    (package / "urdf").mkdir(parents=True)
    part = robot('<xacro:arg name="size" default="1"/>', link("b"), attributes=XACRO)
    write(package / "urdf" / "part.xacro", part)
    include = '<xacro:include filename="$(find parts_description)/urdf/part.xacro"/>'
    text = robot(include, link("a"), joint(), attributes=f'name="r" {XACRO}')
    outside = tmp_path / "robots"
    outside.mkdir()
    monkeypatch.chdir(outside)
    inside = write(package / "urdf" / "whole.xacro", text)
    monkeypatch.chdir("/")
    assert load(inside).q_names[3:] == ("j",)
    deep = tmp_path / "deep"
    deep.mkdir()
    (deep / "parts").mkdir()
    (package).rename(deep / "parts" / "parts_description")
    path = write(outside / "whole.xacro", text)
    with refused_for(("package_missing", {"package": "parts_description"})):
        load(path)
    assert load(path, package_dirs=[deep / "parts"]).arguments == {"size": "1"}
    assert load(path, package_dirs=[deep / "parts"], arguments={"size": 2}).arguments == {"size": "2"}
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(deep / "parts"))
    assert load(path).q_names[3:] == ("j",)
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    (deep / "parts").rename(deep / "share")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(deep))
    assert load(path).q_names[3:] == ("j",)
    assert capfd.readouterr() == ("", "")


def test_optional_include_may_be_missing(tmp_path: Path) -> None:
    include = '<xacro:include filename="nothing.xacro" optional="true"/>'
    path = write(tmp_path / "r.xacro", robot(include, link("a"), attributes=f'name="r" {XACRO}'))
    assert load(path).frames[-1] == "a"


def test_xacro_warnings_become_notes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    parts = ('<xacro:property name="pi" value="3"/>', '${xacro.message("to the terminal")}', link("a"))
    path = write(tmp_path / "r.xacro", robot(*parts, attributes=f'name="r" {XACRO}'))
    (note,) = of_code(load(path).notes, "xacro_warned")
    assert "redefining global symbol: pi" in note.values["text"]
    assert capfd.readouterr() == ("", "")


def test_xacro_is_left_as_it_was() -> None:
    import xacro.substitution_args as substitution

    before = (xacro.parse, xacro.verbosity, substitution._eval_find, substitution._eval_dict["find"])
    load("unicycle_2r")
    with pytest.raises(RobotError):
        load("unicycle_2r", arguments={"h": 0})
    assert before == (xacro.parse, xacro.verbosity, substitution._eval_find, substitution._eval_dict["find"])
    assert xacro.substitution_args_context["arg"] == {}


def test_threads_may_load_at_the_same_time() -> None:
    lengths = [0.4 + 0.05 * i for i in range(8)]
    with ThreadPoolExecutor(4) as pool:
        loaded = list(pool.map(lambda length: load("unicycle_2r", arguments={"l1": length}), lengths))
    for one, length in zip(loaded, lengths, strict=True):
        q = np.zeros(5)
        reach = placements(one.model, q)["ee"][0, 3] - placements(one.model, q)["link1"][0, 3]
        assert reach == pytest.approx(length + 0.3)


def test_names_and_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = load("unicycle_2r", name="mine")
    assert (loaded.name, loaded.source, loaded.model.name) == ("mine", "unicycle_2r", "mine")
    path = as_file(tmp_path, robot(link("a")))
    monkeypatch.chdir(tmp_path)
    for source in (path, str(path), "r.urdf", "./r.urdf", Path("r.urdf")):
        assert (load(source).name, load(source).source) == ("r", str(source))
    # A file beside us does not hide the bundled robot; a byte order mark and a declaration do no harm.
    write(tmp_path / "unicycle_2r", "not a robot")
    assert load("unicycle_2r").n == 5
    path.write_bytes(b"\xef\xbb\xbf<?xml version='1.0'?>\n" + robot(link("Größe")).encode())
    assert load(path).frames[-1] == "Größe"


def test_loads_quickly() -> None:
    """A bundled robot takes about 55 ms of a processor (where this was written); not ten times that."""
    load("unicycle_3r")
    taken = []
    for _ in range(3):
        start = time.process_time()
        load("unicycle_3r")
        taken.append(time.process_time() - start)
    assert min(taken) < 0.5


# ----------------------------------------------------------------------------------------------- bundled


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The package as if it were installed in a site-packages folder."""
    package = tmp_path / "site-packages" / "nmm"
    package.mkdir(parents=True)
    monkeypatch.setattr(bundled, "_PACKAGE", package)
    bundled._folder.cache_clear()
    yield package
    bundled._folder.cache_clear()


def test_bundled_in_the_checkout(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    assert set(ARM) <= set(bundled_robots())
    assert all(path.is_file() for path in bundled_robots().values())
    assert not any("." in name for name in (*bundled_robots(), *bundled_scenarios()))
    assert all(path.suffix == ".yaml" and path.is_absolute() for path in bundled_scenarios().values())


def test_bundled_in_a_wheel(elsewhere: Path) -> None:
    parts = elsewhere / "_bundled" / "robots" / "common"
    parts.mkdir(parents=True)
    write(parts / "part.xacro", "")
    write(parts.parent / "one.urdf.xacro", "")
    write(parts.parent / "notes.txt", "")
    assert bundled_robots() == {"one": parts.parent / "one.urdf.xacro"}


@pytest.mark.parametrize("project", [None, '[project]\nname = "other"', "[project", '[tool]\nname = "nmm"'])
def test_somebody_elses_folder_is_not_ours(elsewhere: Path, project: str | None) -> None:
    (elsewhere.parent / "robots").mkdir()
    write(elsewhere.parent / "robots" / "their.urdf.xacro", "")
    if project is not None:
        write(elsewhere.parent / "pyproject.toml", project)
    with pytest.raises(NmmError, match="incomplete"):
        bundled_robots()
