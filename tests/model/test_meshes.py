"""Meshes are read when something draws or collides: not before, once, and as Pinocchio reads them."""

from __future__ import annotations

import gc
import os
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from threading import Barrier

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from findings import assert_found, holds, of_code
from places import DATA, UR5
from spatial_arms import MOVING
from spatial_arms import UR5 as POSED
from thinned import thinned
from urdf_parts import joint, link, robot, shape, write

import nmm
from nmm import RobotError
from nmm.model.robots import mesh_files, meshes
from nmm.model.robots.loading.check_parts import MESH_SUFFIXES
from nmm.model.robots.loading.packages import package_file
from nmm.model.robots.robot import Robot

FINGERS = {"panda_finger_joint1": 0.01}
TIAGO = f"{DATA}tiago_description/robots/tiago.urdf"
FILES: dict[str, tuple[str, dict[str, float]]] = {
    "ur5": (UR5, {}),
    "tiago": (TIAGO, {}),
    "panda": (f"{DATA}panda_description/urdf/panda.urdf", FINGERS),
    "kinova": (f"{DATA}kinova_description/robots/kinova.urdf", {}),
    "so100": (f"{DATA}so_arm_description/urdf/so100.urdf", {}),
}


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The mesh files that are read, in order."""
    files: list[str] = []
    original = meshes.mesh_of

    def noting(file: str, scale: np.ndarray) -> object:
        files.append(file)
        return original(file, scale)

    monkeypatch.setattr(meshes, "mesh_of", noting)
    return files


def cube(path: Path, size: float = 1.0) -> Path:
    trimesh.creation.box((size, size, size)).export(path)
    return path


def meshed(folder: Path, *names: str) -> Path:
    """A robot of two links: the first is seen by every mesh named, the second collides by the first."""
    seen = "".join(shape(f'<mesh filename="{name}" scale="1 2 -3"/>') for name in names)
    solid = shape(f'<mesh filename="{names[0]}"/>', "collision")
    return write(folder / "r.urdf", robot(link("a", seen), link("b", solid), joint()))


def unread(geometry: pin.GeometryModel) -> int:
    return sum(meshes.is_unread(part) for part in geometry.geometryObjects)


# ------------------------------------------------------------------------------------------------ not before


@pytest.mark.parametrize("suffix", MESH_SUFFIXES)
def test_every_format_is_read_by_what_the_install_has(suffix: str, tmp_path: Path) -> None:
    """trimesh leaves the readers' own packages to us: pyproject.toml names them."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.5)
    files = ball.export(file_type=suffix[1:])
    for name, content in (files if isinstance(files, dict) else {"model": files}).items():
        place = tmp_path / (name if isinstance(files, dict) else f"model{suffix}")
        place.write_bytes(content.encode() if isinstance(content, str) else content)
    vertices, faces = mesh_files.mesh_arrays(str(tmp_path / f"model{suffix}"))
    assert len(faces) == len(ball.faces)
    assert np.allclose(np.linalg.norm(vertices, axis=1), 0.5, atol=1e-6)


def test_text_that_is_no_utf_8_is_read(tmp_path: Path) -> None:
    path = cube(tmp_path / "cube.obj")
    path.write_bytes("# gezeichnet für die Prüfung\n".encode("latin-1") + path.read_bytes())
    assert len(mesh_files.mesh_arrays(str(path))[1]) == 12


def test_no_mesh_is_read_for_control(read: list[str], tmp_path: Path) -> None:
    """Not by loading, mounting, Pinocchio's models, a controller, or a run without figures."""
    arm = nmm.load(UR5)
    both = nmm.mount(nmm.mount("unicycle_2r", arm, at="arm_base", prefix="l_"), arm, at="arm_base")
    tiago = nmm.load(TIAGO, lock={"torso_lift_joint": 0.1}, axle="base_link", platform="differential")
    fixed = nmm.load(TIAGO, platform="fixed")
    for machine in (arm, both, tiago, fixed):
        assert unread(machine.shapes.visual_model) > 5
        assert unread(machine.shapes.collision_model) > 5
        pickle.loads(pickle.dumps(machine))
        replace(machine, **machine.shapes._asdict(), name="another")
        nmm.PinocchioLayout(machine, "chain").configuration(machine.q())
        assert repr(machine)
    assert arm.shapes.collision_model.collisionPairs
    (note,) = of_code(arm.notes, "collision_pairs")
    assert note.values["count"] == len(arm.shapes.collision_model.collisionPairs)
    controller = nmm.Controller(arm, nmm.Task(nmm.Position("tool0"), MOVING, 1.0), nmm.ProjectedGradient())
    q0 = arm.q(POSED)
    controller(0.0, q0)
    nmm.simulate(controller, q0, duration=0.1, dt=0.01).save(tmp_path / "run", figures=False)
    nmm.Trajectory.load(tmp_path / "run", arm)
    assert read == []


def test_files_that_are_no_meshes_do_for_control(tmp_path: Path) -> None:
    """Whoever reads, and by whichever way, would stumble: that they are there is all that loading asks."""
    write(tmp_path / "junk.stl", "junk")
    arm = nmm.load(meshed(tmp_path, "junk.stl"))
    assert nmm.mount("unicycle_2r", arm, at="arm_base").n == 6
    with pytest.raises(RobotError, match=r"link 'a', visual: mesh 'gone.stl': no such file.*link 'b', coll"):
        nmm.load(meshed(tmp_path, "gone.stl"))


def test_figures_read_the_platform_alone(read: list[str]) -> None:
    from nmm.views.figures.silhouette import Silhouette

    arm = nmm.load(UR5)
    Silhouette(arm, "tool0").at(arm.q())
    assert [Path(file).name for file in read] == ["base.dae"]


def test_bodies_without_visuals_read_their_collision_shapes_alone(read: list[str], tmp_path: Path) -> None:
    from nmm.views.playback.sticks import appearance

    solids = {name: cube(tmp_path / f"{name}.stl") for name in "ab"}
    parts = [shape(f'<mesh filename="{file}"/>', "collision") for file in solids.values()]
    text = robot(link("a", parts[0] + shape('<sphere radius="1"/>')), link("b", parts[1]), joint())
    looks = appearance(nmm.load(write(tmp_path / "r.urdf", text)))
    assert looks.solids == ("b",)
    assert read == [str(solids["b"])]
    assert unread(looks.shapes) == 0


# ------------------------------------------------------------------------------------------ as Pinocchio does


def made(name: str) -> tuple[Robot, pin.Model, Path]:
    """A robot, and Pinocchio's model of the file."""
    file, lock = FILES[name]
    path = package_file(file)
    return nmm.load(file, lock=lock), pin.buildModelFromUrdf(str(path)), path


def assert_same_surface(mine: pin.GeometryObject, its: pin.GeometryObject) -> None:
    """Coal's reader merges corners and, where a file has several parts, joins the faces of one to corners of
    another: corners reach equally far everywhere, and of one part (STL) the surfaces are as large."""
    away = np.random.default_rng(0).normal(size=(100, 3))
    corners = [np.array(one.geometry.vertices()) for one in (mine, its)]
    size = float(np.ptp(corners[1], axis=0).max())
    reached = [(points @ away.T).max(axis=0) for points in corners]
    np.testing.assert_allclose(reached[0], reached[1], rtol=0, atol=1e-6 * size)
    if mine.meshPath.lower().endswith(".stl"):
        areas = [area(one.geometry) for one in (mine, its)]
        assert areas[0] == pytest.approx(areas[1], rel=1e-6)


def area(mesh: pin.hppfcl.BVHModelBase) -> float:
    points = np.array(mesh.vertices())
    faces = [[mesh.tri_indices(i)[k] for k in range(3)] for i in range(mesh.num_tris)]
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def assert_same_shape(mine: pin.GeometryObject, its: pin.GeometryObject) -> None:
    """All of a shape but its joint, frame and place, which the model gives."""
    assert type(mine.geometry) is type(its.geometry)
    for one in (mine, its):  # meshes are shared, and somebody may have asked for the box of one
        one.geometry.computeLocalAABB()
    if isinstance(mine.geometry, pin.hppfcl.BVHModelBase):
        assert_same_surface(mine, its)
    else:
        assert mine.geometry == its.geometry
    assert mine.meshPath == its.meshPath or Path(mine.meshPath).samefile(its.meshPath)
    for name in ("meshScale", "meshColor"):
        np.testing.assert_array_equal(getattr(mine, name), getattr(its, name))
    assert mine.overrideMaterial == its.overrideMaterial
    assert mine.meshTexturePath == its.meshTexturePath
    assert type(mine.meshMaterial) is type(its.meshMaterial)
    assert mine.disableCollision == its.disableCollision


@pytest.mark.parametrize("name", thinned(FILES, ("ur5", "panda").__contains__))
def test_shapes_are_pinocchios(name: str) -> None:
    loaded, plain, path = made(name)
    share = [str(path.parents[4])]
    for shapes, kind in ((loaded.visual_model, pin.VISUAL), (loaded.collision_model, pin.COLLISION)):
        eager = pin.buildGeomFromUrdf(plain, str(path), kind, package_dirs=share)
        assert eager.ngeoms > 0
        assert unread(shapes) == unread(eager) == 0
        for mine, its in zip(shapes.geometryObjects, eager.geometryObjects, strict=True):
            assert mine.name == its.name
            assert_same_shape(mine, its)


def eagerly(monkeypatch: pytest.MonkeyPatch, make: Callable[[], Robot]) -> Robot:
    """A robot whose meshes were read as soon as they were met."""

    def read_now(part: pin.GeometryObject, file: str, scale: object) -> None:
        meshes.leave_unread(part, file, scale)  # type: ignore[arg-type]  # handed on
        meshes.read_meshes([part], "eager")

    with monkeypatch.context() as patch:
        patch.setattr("nmm.model.robots.loading.source.leave_unread", read_now)
        return make()


ROBOTS: dict[str, Callable[[], Robot]] = {
    "held": lambda: nmm.load(TIAGO, platform="fixed"),
    "moved": lambda: nmm.load(TIAGO, axle=(0.05, 0.1), lock={"torso_lift_joint": 0.1}),
    "mounted": lambda: nmm.mount("unicycle_2r", UR5, at="arm_base", placement=((0, 0, 1), (0, 0.3, 0))),
    "twice": lambda: nmm.mount(
        nmm.mount("unicycle_2r", UR5, at="arm_base", prefix="l_"), nmm.load(UR5), at="arm_base"
    ),
    **{name: (lambda name=name: nmm.load(name)) for name in ("unicycle_2r", "trailer_base")},  # type: ignore[misc]
}


@pytest.mark.parametrize("name", thinned(ROBOTS, lambda name: name not in ("held", "twice")))
def test_what_is_done_to_shapes_is_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locking, moving, mounting, wheels left out and pairs: whether a mesh is read changes nothing."""
    late, early = ROBOTS[name](), eagerly(monkeypatch, ROBOTS[name])
    assert late.notes == early.notes
    assert late.fingerprint == early.fingerprint
    assert unread(early.shapes.visual_model) == 0
    for field in ("visual_model", "collision_model"):
        mine, its = getattr(late, field), getattr(early, field)
        assert mine.ngeoms > 0
        assert list(mine.collisionPairs) == list(its.collisionPairs)
        for one, other in zip(mine.geometryObjects, its.geometryObjects, strict=True):
            assert (one.name, one.parentJoint, one.parentFrame) == (
                *(other.name, other.parentJoint, other.parentFrame),
            )
            np.testing.assert_array_equal(one.placement.homogeneous, other.placement.homogeneous)
            assert_same_shape(one, other)
    models = nmm.pinocchio_models(ROBOTS[name](), "chain")
    assert unread(models.visual_model) == unread(models.collision_model) == 0


# ------------------------------------------------------------------------------------------------------ once


def test_meshes_are_read_once_and_kept(read: list[str], tmp_path: Path) -> None:
    """By all shapes, models and robots that have them at one scale, for as long as one of these is there."""
    file = str(cube(tmp_path / "one.stl"))
    other = str(cube(tmp_path / "other.stl"))
    loaded = nmm.load(meshed(tmp_path, "one.stl", "other.stl", "one.stl"))
    mounted = nmm.mount("unicycle_2r", loaded, at="arm_base")
    assert read == []
    assert loaded.visual_model is loaded.visual_model
    assert read == [file, other]
    assert unread(loaded.collision_model) == 0  # at another scale
    assert read == [file, other, file]
    for machine in (mounted, loaded, nmm.load(tmp_path / "r.urdf")):
        assert unread(machine.visual_model) == unread(machine.collision_model) == 0
        nmm.pinocchio_models(machine)
    assert len(read) == 3
    del loaded, mounted, machine
    gc.collect()
    assert not any(key[0] in (file, other) for key in meshes._IN_USE)


def test_a_mesh_that_was_written_anew_is_read_anew(tmp_path: Path) -> None:
    for size in (1.0, 3.0):
        cube(tmp_path / "part.stl", size)
        # Files are as long, and may be written within one tick of the file system's clock.
        os.utime(tmp_path / "part.stl", (size, size))
        loaded = nmm.load(meshed(tmp_path, "part.stl"))
        (part,) = loaded.collision_model.geometryObjects
        part.geometry.computeLocalAABB()
        np.testing.assert_allclose(part.geometry.aabb_local.max_, 0.5 * size)
        kept = loaded  # the old one is in use when the new one is read
    assert kept is loaded


def test_threads_ask_at_the_same_time(read: list[str], tmp_path: Path) -> None:
    names = [cube(tmp_path / f"{i}.stl", 1.0 + i).name for i in range(12)]
    loaded = nmm.load(meshed(tmp_path, *names))
    together = Barrier(8)

    def ask(_: int) -> int:
        together.wait()
        return unread(loaded.visual_model)

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(ask, range(8))) == [0] * 8
    assert [Path(file).name for file in read] == names


# ------------------------------------------------------------------------------------------- as any dataclass


def test_pickles_carry_what_there_is(read: list[str], tmp_path: Path) -> None:
    file = cube(tmp_path / "part.stl")
    loaded = nmm.load(meshed(tmp_path, "part.stl"))
    late = pickle.loads(pickle.dumps(loaded))
    assert read == []
    assert late.visual_model == loaded.visual_model
    file.unlink()
    copied = pickle.loads(pickle.dumps(loaded))
    assert copied.visual_model == loaded.visual_model
    with pytest.raises(RobotError, match=r"r: link 'b': mesh .*part\.stl cannot be read: No such file"):
        _ = copied.collision_model


def test_robots_stay_frozen_and_replaceable(tmp_path: Path) -> None:
    cube(tmp_path / "part.stl")
    loaded = nmm.load(meshed(tmp_path, "part.stl"))
    with pytest.raises(FrozenInstanceError):
        loaded.visual_model = pin.GeometryModel()  # type: ignore[misc]  # wrong on purpose
    named, empty = replace(loaded, name="named"), pin.GeometryModel()
    assert named.visual_model is loaded.visual_model
    assert unread(named.visual_model) == 0
    bare = replace(loaded, visual_model=empty)
    assert bare.visual_model is empty
    assert bare.collision_model is loaded.collision_model


# ---------------------------------------------------------------------------------------------------- errors


def test_all_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    """With its link; the robot goes on as a mechanism, and draws once the files are there."""
    for name in ("one.stl", "two.obj"):
        write(tmp_path / name, "junk")
    cube(tmp_path / "good.stl")
    loaded = nmm.load(meshed(tmp_path, "one.stl", "good.stl", "two.obj"))
    for _ in range(2):
        with pytest.raises(RobotError) as caught:
            _ = loaded.visual_model
        lost = [{"link": "a", "mesh": str(tmp_path / name)} for name in ("one.stl", "two.obj")]
        assert_found(caught.value.findings, *(("mesh_unreadable", values) for values in lost))
    arm = nmm.mount("unicycle_2r", loaded, at="arm_base", prefix="second_")
    with pytest.raises(RobotError) as caught:
        _ = arm.visual_model
    assert caught.value.where == "unicycle_2r with second"
    assert holds(caught.value.findings[0], "mesh_unreadable", link="second_a", mesh=str(tmp_path / "one.stl"))
    cube(tmp_path / "one.stl")
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "two.obj")
    assert unread(loaded.visual_model) == 0


def test_a_check_reads_the_meshes(tmp_path: Path) -> None:
    from nmm.model.robots.loading.report import file_report

    write(tmp_path / "junk.stl", "junk")
    path = meshed(tmp_path, "junk.stl")
    mesh = str(tmp_path / "junk.stl")
    assert_found(file_report(path).problems, ("mesh_unreadable", {"link": "a", "mesh": mesh}))
    cube(tmp_path / "junk.stl")
    assert file_report(path).problems == ()
