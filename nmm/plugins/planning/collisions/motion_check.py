"""Whether configurations and motions keep a scene's distances, with obstacles that stand: for planners."""

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import checked_by_caller, compiled
from nmm.base.kernels.record_layout import BLOCKS, Blocks, Memory, views
from nmm.base.kernels.signatures import float64, int64
from nmm.model.collisions.queries import Queries
from nmm.model.collisions.scene import Scene
from nmm.model.collisions.separation import ConvexShapes
from nmm.model.robots.joint_table import as_row
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.legs_check import MARGIN, MovedShapes, first_blocked, too_near

#: The direction that separates a pair before the first look.
UP = (0.0, 0.0, 1.0)


@compiled
def _too_near(blocks: Blocks, q: Array) -> int:
    return too_near(views(MovedShapes, blocks.integers, blocks.floats, 0), q)


_FLAT = float64[::1]
_NEAR = int64(BLOCKS, _FLAT)
_BLOCKED = int64(*BLOCKS.types, _FLAT, float64[:, ::1], int64, _FLAT)


class MotionCheck:
    """Looks at configurations and legs (`nmm.plugins.planning.collisions.legs_check`) of a robot at t = 0, s.

    Parameters
    ----------
    scene : whose distances are kept; None for nothing to keep off
    beside : a record that lies in memory after `MovedShapes`
    """

    def __init__(self, robot: Robot, scene: Scene | None, beside: tuple[Any, ...] = ()) -> None:
        self.scene = scene
        memory = Memory()
        memory.add(moved_shapes(robot, scene))
        if beside:
            memory.add(beside)
        self.blocks = memory.blocks()
        self._shapes = views(MovedShapes, *self.blocks, 0)
        self._near = checked_by_caller(_too_near, _NEAR)
        self._blocked = checked_by_caller(first_blocked, _BLOCKED)

    def keep(self, configurations: Array) -> None:
        """Keep the scene's distance, or what these (K, n) have where that is less."""
        if self.scene is None:
            return
        queries, distances = self.scene.queries, self._shapes.kept
        pairs = range(len(distances))
        least = np.min([queries.distances(0.0, q, pairs) for q in configurations], axis=0)
        distances[:] = np.clip(least - 4.0 * MARGIN, 0.0, self.scene.distance)

    def widen(self, configurations: Array, margin: float) -> None:
        """Keep so much more than the scene's distance, m, or as much as these (K, n) have."""
        if self.scene is not None and margin > 0.0:
            pairs = range(len(self.kept))
            least = np.min([self.scene.queries.distances(0.0, q, pairs) for q in configurations], axis=0)
            self.kept[:] = np.clip(least - 4.0 * MARGIN, self.kept, self.scene.distance + margin)

    @property
    def kept(self) -> Array:
        """The distance that each pair keeps, (P,), m."""
        return self._shapes.kept

    @property
    def levers(self) -> Array:
        """How far a unit of each number of a leg can move the two of a pair to each other, (P, 3 + n), m."""
        return self._shapes.levers

    def forget(self) -> None:
        """Forget what separated pairs last, which bounds begin with."""
        self._shapes.shapes.between[:] = UP

    @property
    def pairs(self) -> Integers:
        """The shapes of each pair, (P, 2), obstacles second."""
        return self._shapes.shapes.pairs

    def too_near(self, q: Array) -> int:
        """The number of a pair that is nearer than its distance at q (n,), or -1."""
        return int(self._near(self.blocks, q))

    def blocked(self, q: Array, legs: Array) -> int:
        """The number of a pair that comes too near on legs (L, 3 + n) from q (n,), which is free, or -1."""
        return int(self._blocked(*self.blocks, q, legs, len(legs), np.empty_like(q)))


def moved_shapes(robot: Robot, scene: Scene | None) -> MovedShapes:
    """The record of a scene with obstacles where they are at t = 0."""
    shapes = pin.GeometryModel() if scene is None else scene.queries.shapes
    queries = Queries(robot, shapes, (), 0.0, 0.0) if scene is None else scene.queries
    queries.place(0.0, robot.rest)
    objects, old, turned = queries.shapes.geometryObjects, queries.scene, robot.joint_axes
    own = len(objects) - (0 if scene is None else len(scene.obstacles))
    discs = [shape.geometry.radius if isinstance(shape.geometry, coal.Cylinder) else 0.0 for shape in objects]
    convex = ConvexShapes(
        boxes=old.boxes,
        planes=old.planes,
        first_corner=old.first_corner,
        corners=old.corners,
        rounding=old.rounding,
        disc=np.array(discs),
        pairs=old.pairs,
        between=np.tile(UP, (len(old.pairs), 1)).reshape(-1, 3),
    )
    carrier = np.array(
        [shape.parentJoint if i < own else 0 for i, shape in enumerate(objects)], dtype=np.int64
    )
    levers, stems = pair_levers(robot, own, carrier, objects, old.boxes, old.pairs)
    return MovedShapes(
        shapes=convex,
        joints=robot.joints,
        mimic_joints=robot.following.table.ravel(),
        planar=np.array(int(robot.platform.n_p >= 3), dtype=np.int64),
        carrier=carrier,
        place=np.array(
            [as_row(turned[i].inverse() * shape.placement) for i, shape in zip(carrier, objects, strict=True)]
        ).reshape(-1, 12),
        levers=levers,
        stems=stems,
        kept=np.full(len(old.pairs), 0.0 if scene is None else scene.distance),
        drift=np.zeros(len(old.pairs)),
        until=np.zeros(len(old.pairs)),
        places=np.zeros((len(objects), 12)),
        sensed=old.sensed,
    )


def pair_levers(
    robot: Robot, own: int, carrier: Integers, objects: Any, boxes: Array, pairs: Integers
) -> Array:
    """`levers` and `stems` (2, P, 3 + n) of `MovedShapes`. What a joint moves is no farther from it than the
    lengths between joints, and the travel of sliding ones, together."""
    model, n = robot.model, robot.n
    lengths = np.array([float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements])
    travel = np.zeros(model.njoints)
    for joint in range(1, model.njoints):
        c = model.joints[joint].idx_v
        if robot.q_units[c] == "m" and c >= robot.platform.n_p:
            travel[joint] = float(np.abs(robot.q_limits[c]).max())
    # How far a shape reaches from each joint's origin on its way to the root.
    far: list[dict[int, float]] = []
    for i in range(own):
        reached, joint, so_far = {}, int(carrier[i]), 0.0
        so_far = float(np.linalg.norm(objects[i].placement.act(boxes[i, :3]))) + boxes[i, 6]
        while True:
            reached[joint] = so_far
            if joint == 0:
                break
            so_far += lengths[joint] + travel[joint]
            joint = int(model.parents[joint])
        far.append(reached)
    result = np.zeros((2, len(pairs), 3 + n))
    result[1] = np.inf
    for k, (i, j) in enumerate(pairs):
        for mover, other in ((i, j), (j, i)):
            if mover >= own:
                continue
            for joint, lever in far[mover].items():
                if joint == 0 or (other < own and joint in far[other]):
                    continue
                c, slides = 3 + model.joints[joint].idx_v, robot.q_units[model.joints[joint].idx_v] == "m"
                result[0, k, c] = 1.0 if slides else lever
                if other < own and not slides:
                    shared = next(
                        ancestor for ancestor in far[mover] if ancestor in far[other] and ancestor != joint
                    )
                    result[1, k, c] = far[other][shared] + _between(model, joint, shared, lengths, travel)
    if robot.platform.n_p >= 3:
        result[:, :, :3] = result[:, :, 3:6]
        result[:, :, 3:6] = 0.0
    return result


def _between(model: pin.Model, joint: int, ancestor: int, lengths: Array, travel: Array) -> float:
    """How far a joint's origin can be from an ancestor's, m."""
    distance = 0.0
    while joint != ancestor:
        distance += float(lengths[joint] + travel[joint])
        joint = int(model.parents[joint])
    return distance
