"""Mesh files with something changed in them: refused in a line, or a shape that collides and is drawn."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh
from hypothesis import strategies as st

import nmm
from nmm.base.errors import NmmError
from nmm.views.figures.silhouette import platform_shapes
from nmm.views.playback.shapes import shapes

from .hunting import Hunt, refused
from .mutants import CUTS, VALUES, damaged

#: How trimesh writes each format, by the name of the case.
FORMATS: dict[str, tuple[str, dict[str, Any]]] = {
    "stl": ("stl", {}), "ascii stl": ("stl", {"file_type": "stl_ascii"}), "ply": ("ply", {}),
    "ascii ply": ("ply", {"encoding": "ascii"}), "obj": ("obj", {}), "dae": ("dae", {}), "glb": ("glb", {}),
    "off": ("off", {}),
}  # fmt: skip

CASES = st.fixed_dictionaries(
    {
        "format": st.sampled_from(sorted(FORMATS)),
        "coloured": st.booleans(),
        "words": st.one_of(
            st.just([]), st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), VALUES), max_size=2)
        ),
        "cuts": st.one_of(CUTS, st.just([])),
    }
)


@cache
def _whole(name: str, coloured: bool) -> bytes:
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.3)
    if coloured:
        mesh.visual.vertex_colors = np.arange(4 * len(mesh.vertices)).reshape(-1, 4) % 256
    _, options = FORMATS[name]
    made = (
        mesh.export(file_type=FORMATS[name][0], **options)
        if "file_type" not in options
        else mesh.export(**options)
    )
    return made.encode() if isinstance(made, str) else bytes(made)


def check(case: Any) -> str:
    suffix, _ = FORMATS[case["format"]]
    content = _whole(case["format"], case["coloured"])
    for share, value in case["words"]:  # a number of a header, an index, an attribute
        words = content.split(b" ")
        words[int(share * len(words))] = value.encode("utf-8", "surrogatepass")
        content = b" ".join(words)
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / f"mesh.{suffix}"
        mesh.write_bytes(damaged(content, case["cuts"]))
        shape = f'<geometry><mesh filename="{mesh.name}"/></geometry>'
        robot = Path(folder) / "robot.urdf"
        robot.write_text(
            f'<robot name="r"><link name="a"><visual>{shape}</visual><collision>{shape}</collision></link>'
            "</robot>"
        )
        made = nmm.load(robot, platform="unicycle")
        try:
            (shown,) = made.visual_model.geometryObjects
            (solid,) = made.collision_model.geometryObjects
        except NmmError as error:
            return refused(error)
        corners = np.array(solid.geometry.vertices())
        assert np.all(np.isfinite(corners))
        assert shapes(shown)
        assert platform_shapes(made, (0, 1, 2, 3))
        try:
            nmm.Obstacle(nmm.ConvexMesh(mesh), [2.0, 0.0, 0.0], name="stone")
        except NmmError as error:
            return f"flat: {refused(error)}"
        one = pin.hppfcl.Transform3s(np.eye(3), np.array([2.0, 0.0, 0.0]))
        pin.hppfcl.distance(
            solid.geometry, pin.hppfcl.Transform3s(), solid.geometry, one, pin.hppfcl.DistanceRequest(),
            pin.hppfcl.DistanceResult(),
        )  # fmt: skip
    return "read"


HUNT = Hunt("meshes", CASES, check)
