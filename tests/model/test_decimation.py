"""Meshes of a page have fewer triangles, and their surfaces are where they were."""

from __future__ import annotations

from collections.abc import Callable

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from places import UR5

import nmm
from nmm.base.arrays import Array
from nmm.views.playback.meshes import OFF, Indices, _light, decimated, mesh_pieces

Mesh = tuple[Array, Indices]


def distances(points: Array, mesh: Mesh) -> Array:
    """From points to a surface, m, as Coal finds them."""
    vertices, faces = mesh
    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(faces), len(vertices))
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in vertices:
        corners.append(vertex)
    for a, b, c in faces.tolist():
        triangles.append(coal.Triangle(a, b, c))
    surface.addSubModel(corners, triangles)
    surface.endModel()
    here, ball, asked = coal.Transform3s(), coal.Sphere(1e-9), coal.DistanceRequest()
    found = []
    for point in points:
        at = coal.Transform3s(np.eye(3), point)
        found.append(abs(coal.distance(ball, at, surface, here, asked, coal.DistanceResult())))
    return np.array(found)


def apart(one: Mesh, other: Mesh, samples: int = 400) -> float:
    """The largest distance found from either surface to the other, m."""
    found = 0.0
    for here, there in ((one, other), (other, one)):
        points, _ = trimesh.sample.sample_surface(trimesh.Trimesh(*here, process=False), samples, seed=0)
        found = max(found, float(distances(np.asarray(points), there).max()))
    return found


def welded(mesh: trimesh.Trimesh) -> Mesh:
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.uint32)


def half_ball() -> Mesh:
    """A surface with an opening."""
    ball = trimesh.creation.icosphere(5)
    return welded(trimesh.Trimesh(ball.vertices, ball.faces[(ball.triangles_center[:, 2] > 0.1)]))


def three_sheets() -> Mesh:
    """Three half planes that meet in one edge, each of many triangles: no manifold."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, 13), np.linspace(0, 1, 13)))
    cell = np.array([13 * i + j for i in range(12) for j in range(12)])
    faces = np.vstack(
        [np.column_stack([cell, cell + 1, cell + 14]), np.column_stack([cell, cell + 14, cell + 13])]
    )
    turns = [pin.rpy.rpyToMatrix(0.0, angle, 0.0) for angle in (0.0, 2.0, 4.0)]
    points = np.vstack([np.column_stack([x, y, 0.0 * x]) @ turn.T for turn in turns])
    return welded(trimesh.Trimesh(points, np.vstack([faces + 169 * k for k in range(3)]), process=False))


@pytest.mark.parametrize(
    ("make", "share"),
    [
        (lambda: welded(trimesh.creation.icosphere(5)), 0.4),
        (lambda: welded(trimesh.creation.box((1, 2, 3)).subdivide().subdivide().subdivide()), 0.05),
        (half_ball, 0.4),
        (three_sheets, 0.2),
    ],
    ids=["ball", "box", "half ball", "three sheets"],
)
def test_a_surface_stays_where_it_is(make: Callable[[], Mesh], share: float) -> None:
    mesh, off = make(), 2e-3
    found = decimated(*mesh, off)
    assert len(found[1]) < share * len(mesh[1])
    assert apart(mesh, found) < 2.0 * off
    # No opening is closed: what is open stays so.
    area = trimesh.Trimesh(*found, process=False).area
    assert area == pytest.approx(trimesh.Trimesh(*mesh, process=False).area, rel=0.01)


def test_few_triangles_stay() -> None:
    one = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]], dtype=np.uint32)
    vertices, faces = decimated(*one, 1e-3)
    assert len(faces) == 1
    assert np.array_equal(np.sort(vertices, axis=0), np.sort(one[0], axis=0))


def shape_of(part: pin.GeometryObject) -> tuple[str, float]:
    return type(part.geometry).__name__, part.geometry.computeVolume()


@pytest.mark.thorough
def test_the_meshes_of_robots_stay_where_they_are() -> None:
    """A UR5's, to a thousandth of each mesh's size, from 95,694 triangles; what collides keeps all."""
    robot = nmm.load(UR5)
    solid = robot.collision_model.geometryObjects
    collided = [shape_of(part) for part in solid]
    count = 0
    for part in robot.visual_model.geometryObjects:
        pieces = mesh_pieces(part)
        count += sum(len(piece.faces) for piece in pieces)
        scene = trimesh.load_scene(part.meshPath, process=False)
        original = trimesh.util.concatenate([mesh for mesh in scene.dump() if len(mesh.faces)])
        mesh = np.array(original.vertices) * part.meshScale, np.array(original.faces, dtype=np.uint32)
        joined = trimesh.util.concatenate(
            [trimesh.Trimesh(p.vertices, p.faces, process=False) for p in pieces]
        )
        drawn = np.array(joined.vertices), np.array(joined.faces, dtype=np.uint32)
        size = float(np.linalg.norm(np.ptp(mesh[0], axis=0)))
        assert apart(mesh, drawn, 150) < 2.5 * OFF * size, part.name
    assert count < 30_000
    assert [shape_of(part) for part in solid] == collided


def test_what_is_coarser_has_fewer_triangles_for_thin_parts_too() -> None:
    """A plate that is thinner than the tolerance: nothing would be left of it, a finer one keeps it."""
    plate = trimesh.creation.box([1.0, 1.0, 0.004]).subdivide().subdivide().subdivide()
    vertices, faces = _light(plate, 0.02)
    assert 0 < len(faces) < len(plate.faces) / 2
    np.testing.assert_allclose(np.ptp(vertices, axis=0)[:2], 1.0, atol=0.02)
