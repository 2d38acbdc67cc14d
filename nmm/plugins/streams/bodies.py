"""Surfaces of what stands or moves beside a robot, as triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import trimesh

from nmm.model.collisions.elements.boxes import Elements
from nmm.model.collisions.obstacle import Obstacle
from nmm.plugins.streams.pictures import SensedCells, Surface, Triangles, Undrawn
from nmm.views.playback.meshes import mesh_pieces

coal = pin.hppfcl
#: Sides of what is round.
SIDES = 32


def surface(geometry: Any) -> Triangles | None:
    """The surface of one of Coal's shapes, m; None of one without a bounded surface."""
    made = _round_or_box(geometry)
    if made is not None:
        return Triangles(np.asarray(made.vertices, dtype=np.float64), np.asarray(made.faces, dtype=np.int64))
    pieces = mesh_pieces(pin.GeometryObject("body", 0, pin.SE3.Identity(), geometry))
    if not pieces:
        return None
    begins = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    faces = [piece.faces.astype(np.int64) + begin for piece, begin in zip(pieces, begins, strict=False)]
    return Triangles(np.vstack([piece.vertices for piece in pieces]).astype(np.float64), np.vstack(faces))


def shown_surface(obstacle: Obstacle, shape: Any) -> Surface:
    """An obstacle's shape as pictures have it: what was sensed as points, of which whoever draws it makes the
    surface, as that takes long."""
    if getattr(obstacle, "blank", False):
        return Undrawn("")
    if isinstance(shape, Elements):
        return SensedCells(shape.everywhere, shape.corner, shape.cell)
    made = surface(shape.drawn())
    return Undrawn("its surface has no end") if made is None else made


def _round_or_box(form: Any) -> trimesh.Trimesh | None:
    if isinstance(form, coal.Box):
        return trimesh.creation.box(extents=2.0 * np.array(form.halfSide))
    if isinstance(form, coal.Sphere):
        return trimesh.creation.icosphere(subdivisions=3, radius=float(form.radius))
    if isinstance(form, coal.Ellipsoid):
        ball = trimesh.creation.icosphere(subdivisions=3)
        ball.apply_scale(np.array(form.radii))
        return ball
    if isinstance(form, coal.Cone):
        height = 2.0 * float(form.halfLength)
        cone = trimesh.creation.cone(float(form.radius), height, sections=SIDES)
        cone.apply_translation([0.0, 0.0, -0.5 * height])
        return cone
    if isinstance(form, coal.Cylinder | coal.Capsule):
        radius, length = float(form.radius), 2.0 * float(form.halfLength)
        if isinstance(form, coal.Cylinder):
            return trimesh.creation.cylinder(radius, length, sections=SIDES)
        capsule = trimesh.creation.capsule(length, radius, count=[SIDES, SIDES // 2])
        capsule.apply_translation(-capsule.bounds.mean(axis=0))
        return capsule
    if isinstance(form, coal.ConvexBase):
        return trimesh.convex.convex_hull(np.array(form.points(), dtype=np.float64))
    return None
