"""Robots in the page: Pinocchio's visual geometries as three.js geometries, on a node for each joint."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import Body as Body
from nmm.model.robots.surroundings import Carried
from nmm.model.robots.surroundings import Surroundings as Surroundings
from nmm.views.playback.drawing import Command, Drawing, Rgb, animation, packed, page_times, segment
from nmm.views.playback.keyframes import Keyframes
from nmm.views.playback.meshes import OFF, Color, Indices, mesh_pieces
from nmm.views.playback.placements import Placements, position_and_quaternion
from nmm.views.playback.sticks import appearance

fcl = pin.hppfcl

#: three.js turns its cylinders, cones and capsules about y, Pinocchio about z.
Y_TO_Z = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

CARRIED: Rgb = (0.84, 0.66, 0.40)


class DrawnRobot:
    """A robot in the page: a node for each joint in its parent's, visuals below. `paths` has the nodes of the
    display model's joints, from joint 1; `root` is the root link's."""

    def __init__(
        self,
        drawing: Drawing,
        robot: Robot,
        path: str,
        *,
        tint: Rgb | None = None,
        opacity: float = 1.0,
        rank: int = 0,
        off: float = OFF,
    ) -> None:
        model = robot.display_model
        self.placements = Placements(robot)
        below = [path]
        for joint in range(1, model.njoints):
            below.append(f"{below[model.parents[joint]]}/{segment(model.names[joint])}")
        self.paths, self._below = below[1:], below
        # A fixed base stands at the robot's own node.
        self.root = below[model.getJointId("theta") if robot.platform.n_p else 0]
        self._drawing = drawing
        for i, geometry in enumerate(appearance(robot).shapes.geometryObjects):
            at = f"{below[geometry.parentJoint]}/visual {i} {segment(geometry.name)}"
            drawing.transform(at, np.array(geometry.placement.homogeneous))
            for k, shape in enumerate(shapes(geometry, off)):
                color = _mixed(shape.color[:3], tint)
                drawing.object(
                    f"{at}/{k}", shape.geometry, color, opacity=opacity * shape.color[3], rank=rank
                )
                if not np.array_equal(shape.matrix, np.eye(4)):
                    drawing.transform(f"{at}/{k}", shape.matrix)

    def frame_node(self, drawing: Drawing, frame: str, name: str) -> str:
        """Draw a node of that name at a frame; returns its path."""
        model = self.placements.model
        model_frame = model.frames[model.getFrameId(frame)]
        path = f"{self._below[model_frame.parentJoint]}/{segment(name)}"
        drawing.transform(path, np.array(model_frame.placement.homogeneous))
        return path

    def carry(self, drawing: Drawing, carried: Sequence[Carried]) -> None:
        """Draw what frames carry, as a part of the robot."""
        model = self.placements.model
        for i, item in enumerate(carried):
            frame = model.frames[model.getFrameId(item.frame)]
            path = f"{self._below[frame.parentJoint]}/visual carried {i} {segment(item.name)}"
            drawing.transform(path, frame.placement.homogeneous @ item.place)
            for k, shape in enumerate(shapes(pin.GeometryObject(item.name, 0, pin.SE3(), item.geometry))):
                drawing.object(f"{path}/{k}", shape.geometry, CARRIED)
                drawing.transform(f"{path}/{k}", shape.matrix)

    def place(self, q: Array, wheels: Array) -> None:
        for path, matrix in self._nodes(q, wheels):
            self._drawing.transform(path, matrix)

    def pose(self, q: Array, wheels: Array) -> Command:
        """The command that moves it to q (n,) with wheel angles (W,) in a page that shows it."""
        transforms = [[path, matrix.T.ravel().tolist()] for path, matrix in self._nodes(q, wheels)]
        return {"type": "pose", "transforms": transforms}

    def _nodes(self, q: Array, wheels: Array) -> Iterator[tuple[str, Array]]:
        return zip(self.paths, self.placements.relative(q, wheels), strict=True)

    def animations(self, frames: Keyframes, start: float) -> list[Command]:
        """MeshCat's animations: a clip for each moving joint. Times count from `start`."""
        poses = zip(frames.q, frames.wheels, strict=True)
        matrices = np.array([self.placements.relative(*pose) for pose in poses])
        times, distinct = page_times(frames.t - start)
        positions, quaternions = position_and_quaternion(matrices[distinct])
        animations = []
        for path, place, turn in zip(
            self.paths, positions.swapaxes(0, 1), quaternions.swapaxes(0, 1), strict=True
        ):
            animations += animation(path, times, {"position": place, "quaternion": turn})
        return animations

    def ghosts(self, path: str, q: Array, wheels: Array, texts: Sequence[str]) -> Command:
        """The command for transparent copies at q (G, n), with texts above them, if any; the page makes them
        from the robot's geometry."""
        matrices = np.array([self.placements.world(*at) for at in zip(q, wheels, strict=True)])
        poses = np.concatenate(position_and_quaternion(matrices), axis=-1)
        joints = [
            {"path": joint, "poses": packed(poses[:, i], np.float64)} for i, joint in enumerate(self.paths)
        ]
        return {"type": "ghosts", "path": path, "texts": list(texts), "joints": joints}


def _mixed(color: Sequence[float], tint: Rgb | None) -> Rgb:
    """A colour drawn towards a tint; dark colours stay dark."""
    red, green, blue = color
    if tint is not None:
        light = min(0.45 + 0.7 * (0.3 * red + 0.6 * green + 0.1 * blue), 1.0)
        red, green, blue = (0.25 * c + 0.75 * light * t for c, t in zip(color, tint, strict=True))
    return red, green, blue


@dataclass(frozen=True, eq=False)
class PageShape:
    """A three.js geometry (JSON without uuid), its colour and its placement in the geometry's frame."""

    geometry: dict[str, Any]
    color: Color
    matrix: Array


def shapes(geometry: pin.GeometryObject, off: float = OFF) -> list[PageShape]:
    """What to draw for a visual geometry, meshes off by at most that share of their size; nothing for kinds
    without a bounded surface."""
    red, green, blue, alpha = (float(c) for c in geometry.meshColor)
    color = (red, green, blue, alpha if alpha > 0.0 else 1.0)
    primitive = _primitive(geometry.geometry)
    if primitive is not None:
        data, matrix = primitive
        return [PageShape(data, color, matrix)]
    drawn = []
    for piece in mesh_pieces(geometry, off):
        own = color if piece.color is None or geometry.overrideMaterial else piece.color
        drawn.append(PageShape(triangles(piece.vertices, piece.faces), own, np.eye(4)))
    return drawn


def triangles(vertices: Array, faces: Indices) -> dict[str, Any]:
    short = len(vertices) <= 2**16
    kind, dtype = ("Uint16Array", np.uint16) if short else ("Uint32Array", np.uint32)
    position = {"itemSize": 3, "type": "Float32Array", "array": packed(vertices, np.float32)}
    index = {"type": kind, "array": packed(faces, dtype)}
    return {"type": "BufferGeometry", "data": {"attributes": {"position": position}, "index": index}}


def sphere(radius: float) -> dict[str, Any]:
    sides = _sides(radius)
    return {"type": "SphereGeometry", "radius": radius, "widthSegments": sides, "heightSegments": sides // 2}


def cylinder(radius: float, length: float) -> dict[str, Any]:
    """A cylinder along y, m."""
    ends = {"radiusTop": radius, "radiusBottom": radius}
    return {"type": "CylinderGeometry", **ends, "height": length, "radialSegments": _sides(radius)}


def _sides(radius: float) -> int:
    """Flat sides that look round: a bolt needs fewer than a wheel. Four of them touch the round one's box."""
    return int(np.clip(4 * round(1.2 + 22.0 * np.sqrt(radius)), 8, 48))


def _primitive(shape: pin.hppfcl.CollisionGeometry) -> tuple[dict[str, Any], Array] | None:
    if isinstance(shape, fcl.Box):
        width, height, depth = (2.0 * float(half) for half in shape.halfSide)
        return {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}, np.eye(4)
    if isinstance(shape, fcl.Sphere):
        return sphere(float(shape.radius)), np.eye(4)
    if isinstance(shape, fcl.Ellipsoid):
        return sphere(1.0), np.diag([*(float(radius) for radius in shape.radii), 1.0])
    if isinstance(shape, fcl.ConvexBase):
        return _convex(np.array(shape.points(), dtype=float)), np.eye(4)
    for kind, made in ((fcl.Cylinder, cylinder), (fcl.Cone, _cone), (fcl.Capsule, _capsule)):
        if isinstance(shape, kind):
            return made(float(shape.radius), 2.0 * float(shape.halfLength)), Y_TO_Z
    return None


def _cone(radius: float, length: float) -> dict[str, Any]:
    return {"type": "ConeGeometry", "radius": radius, "height": length, "radialSegments": _sides(radius)}


def _capsule(radius: float, length: float) -> dict[str, Any]:
    """A capsule along y: its outline turned about y."""
    sides = _sides(radius)
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, sides // 2 + 2)
    heights = radius * np.sin(angles) + np.where(angles < 0.0, -0.5 * length, 0.5 * length)
    outline = [{"x": float(x), "y": float(y)} for x, y in zip(radius * np.cos(angles), heights, strict=True)]
    return {"type": "LatheGeometry", "points": outline, "segments": sides}


def _convex(points: Array) -> dict[str, Any]:
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.sum(normals * hull.equations[:, :3], axis=1) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    vertices = corners.reshape(-1, 3)
    return triangles(vertices, np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3))
