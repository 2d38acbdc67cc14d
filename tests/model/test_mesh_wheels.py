"""Wheels of which only a mesh is known have its radius."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh
from urdf_parts import joint, link, robot, shape, write

import nmm

SPIN = '<axis xyz="0 0 1"/><limit effort="1" velocity="9"/>'
MESH = '<mesh filename="wheel.stl"/>'


def cart(path: Path, height: float, tag: str = "visual") -> Path:
    """Two wheels whose joints turn about their own z axes, at a height over the root link's plane, m."""
    parts = [link("base")]
    for side, y in (("left", 0.2), ("right", -0.2)):
        place = f'<origin xyz="0 {y} {height}" rpy="-1.5707963 0 0"/>'
        parts += [
            joint(f"{side}_wheel", "base", side, "continuous", SPIN, place),
            link(side, shape(MESH, tag)),
        ]
    return write(path / "cart.urdf", robot(*parts))


@pytest.mark.parametrize("tag", ["visual", "collision"])
@pytest.mark.parametrize("height", [0.1, 0.0, -0.3])
def test_the_radius_is_that_of_the_mesh(tmp_path: Path, height: float, tag: str) -> None:
    trimesh.creation.cylinder(radius=0.08, height=0.05, sections=72).export(tmp_path / "wheel.stl")
    wheels = nmm.load(cart(tmp_path, height, tag)).wheels
    assert [wheel.radius for wheel in wheels] == pytest.approx([0.08, 0.08], rel=2e-3)


def test_a_height_that_agrees_with_the_mesh_stays(tmp_path: Path) -> None:
    trimesh.creation.cylinder(radius=0.0995, height=0.05, sections=72).export(tmp_path / "wheel.stl")
    assert [wheel.radius for wheel in nmm.load(cart(tmp_path, 0.1)).wheels] == [0.1, 0.1]


def test_a_box_that_stands_for_a_wheel_has_half_its_width(tmp_path: Path) -> None:
    trimesh.creation.box((0.16, 0.16, 0.05)).export(tmp_path / "wheel.stl")
    radii = [wheel.radius for wheel in nmm.load(cart(tmp_path, 0.1, "collision")).wheels]
    assert radii == pytest.approx([0.08, 0.08], rel=2e-3)


def test_a_mesh_that_cannot_be_read_leaves_the_height(tmp_path: Path) -> None:
    write(tmp_path / "wheel.stl", "no mesh")
    assert [wheel.radius for wheel in nmm.load(cart(tmp_path, 0.1)).wheels] == [0.1, 0.1]
