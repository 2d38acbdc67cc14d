"""What of a robot a drawing shows: its platform's outline, its wheels, its heading and its arm.

Everything comes from the robot's own models: the outline from the shapes that the platform carries,
the arm's lines from the placements of its joints. No robot is known by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.figures.hulls import hull
from nmm.figures.solids import Solid, body_wheels, neutral_outline, platform_shapes, tyre, wheel_points
from nmm.figures.views import View
from nmm.playback.placements import Placements
from nmm.playback.rolling import Rolling
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot

#: A joint that is not farther beside its link's axis than this stands on a column, m.
_COLUMN = 0.01


@dataclass(frozen=True, eq=False)
class Pose:
    """A robot's drawing at one configuration, in world axes, m.

    Attributes
    ----------
    body, wheels : (k, 3) points of each convex shape of the platform, and of each wheel
    main : (k, 3) those of the root link's body, or of all where it has no shape
    heading : (3, 3) a triangle on the platform that points ahead
    links : (2, 3) the ends of each line of the arm
    joints : (k, 3) the arm's joints
    tip : (k, 3) the ends of the arm
    """

    body: list[Array]
    wheels: list[Array]
    main: Array
    heading: Array
    links: list[Array]
    joints: Array
    tip: Array
    _outlines: dict[View, tuple[list[Array], list[Array]]] = field(default_factory=dict, repr=False)

    def bodies(self, view: View) -> list[Array]:
        """The platform's shapes as outlines (k, 2) as they are seen in a view."""
        return self._seen(view)[0]

    def tyres(self, view: View) -> list[Array]:
        """The wheels as such outlines."""
        return self._seen(view)[1]

    def _seen(self, view: View) -> tuple[list[Array], list[Array]]:
        if view not in self._outlines:
            bodies, wheels = ([hull(view.of(one)) for one in shapes] for shapes in (self.body, self.wheels))
            self._outlines[view] = bodies, wheels
        return self._outlines[view]

    def points(self) -> Array:
        """All points, (k, 3), for the limits of the axes."""
        return np.vstack([*self.body, *self.wheels, self.heading, *self.links, self.joints, self.tip])


class Silhouette:
    """The drawing of `robot`; `at(q)` places it.

    Parameters
    ----------
    robot : the robot
    frame : the frame at which the arm ends; the outermost frame of each branch when not given
    """

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        self.robot = robot
        model = robot.model
        self._anchors = _anchors(robot)
        own = [joint for joint in range(1, model.njoints) if model.joints[joint].idx_q < robot.platform.n_p]
        #: The platform's main joint: the last of x, y, theta; the world itself under a fixed base.
        self._root = next((joint for joint in own if model.joints[joint].idx_q == 2), 0)
        self._arm = [joint for joint in range(1, model.njoints) if joint not in own]
        self._body = platform_shapes(robot, own or [self._root])
        self._rolling, self._placements = Rolling(robot), Placements(robot)
        # How casters stand follows from the way that they have come, which a configuration does not tell.
        self._wheels = [
            Solid(robot.display_model.getJointId(wheel.joint), wheel_points(robot, wheel))
            for wheel in robot.wheels
            if not wheel.swivel or wheel.swivel in self._rolling.steered
        ]
        if not self._body:
            tyres = [tyre(wheel.radius, wheel.axis) + wheel.center for wheel in body_wheels(robot)]
            self._body = [Solid(self._root, neutral_outline(tyres))]
        self._heading = _heading_mark(self._body, self._root) if own else np.zeros((0, 3))
        self._tips = _tips(robot, self._arm, frame)
        self._feet = _feet(robot, self._arm)

    def at(self, q: Array) -> Pose:
        """The drawing at configuration q, (n,)."""
        configuration = Configuration(self.robot, q)
        places: dict[int, tuple[Array, Array]] = {}

        def world(joint: int, points: Array) -> Array:
            if joint not in places:
                places[joint] = self._place(configuration, joint)
            R, p = places[joint]
            return points @ R.T + p

        origin = np.zeros((1, 3))
        joints = {joint: world(joint, origin)[0] for joint in self._arm}
        parents = {joint: int(self.robot.model.parents[joint]) for joint in self._arm}
        links = [
            np.array([joints[parents[joint]], joints[joint]])
            for joint in self._arm
            if parents[joint] in joints
        ]
        tips = [(joint, world(joint, point[None])[0]) for joint, point in self._tips]
        links += [np.array([joints[joint], tip]) for joint, tip in tips if joint in joints]
        links += [
            np.array([world(solid.joint, solid.points)[0], joints[joint]]) for joint, solid in self._feet
        ]
        body = [world(solid.joint, solid.points) for solid in self._body]
        of_root = [
            points for solid, points in zip(self._body, body, strict=True) if solid.joint == self._root
        ]
        return Pose(
            body=body,
            main=np.vstack(of_root or body),
            wheels=self._wheels_at(q),
            heading=world(self._root, self._heading),
            links=links,
            joints=np.array(list(joints.values())).reshape(-1, 3),
            tip=np.array([tip for _, tip in tips]).reshape(-1, 3),
        )

    def _wheels_at(self, q: Array) -> list[Array]:
        """Points (k, 3) of each wheel in the world, steered as it is at q."""
        if not self._wheels:
            return []
        places = self._placements.world(q, self._rolling.settled(q))
        found = [(places[wheel.joint - 1], wheel.points) for wheel in self._wheels]
        return [points @ place[:3, :3].T + place[:3, 3] for place, points in found]

    def _place(self, configuration: Configuration, joint: int) -> tuple[Array, Array]:
        """Rotation and position of a joint's frame in the world."""
        if joint == 0:
            return np.eye(3), np.zeros(3)
        name, offset = self._anchors[joint]
        placement = configuration.placement(name) * offset
        return np.array(placement.rotation), np.array(placement.translation)


def _anchors(robot: Robot) -> dict[int, tuple[str, Any]]:
    """For each joint a frame that it carries, and the joint's placement seen from that frame."""
    anchors: dict[int, tuple[str, Any]] = {}
    for name in robot.frames:
        frame = robot.model.frames[robot.frame_id(name)]
        anchors.setdefault(int(frame.parentJoint), (name, frame.placement.inverse()))
    return anchors


def _heading_mark(body: list[Solid], root: int) -> Array:
    """A triangle on the rear half of the platform, where no arm hides it, that points along its x axis."""
    points = np.vstack([solid.points for solid in body if solid.joint == root] or [body[0].points])
    low, high = points.min(axis=0), points.max(axis=0)
    length, width = high[0] - low[0], high[1] - low[1]
    middle = 0.5 * (low[1] + high[1])
    back = low[0] + 0.16 * length
    return np.array(
        [
            [back + 0.28 * length, middle, high[2]],
            [back, middle + 0.18 * width, high[2]],
            [back, middle - 0.18 * width, high[2]],
        ]
    )


def _tips(robot: Robot, arm: Sequence[int], frame: str | None) -> list[tuple[int, Array]]:
    """Where the arm's lines end: joint and point in the joint's frame."""
    model = robot.model
    if frame is not None:
        wanted = model.frames[robot.frame_id(frame)]
        found = [(int(wanted.parentJoint), np.array(wanted.placement.translation))]
        leaves = [joint for joint in _leaves(robot, arm) if joint != found[0][0]]
    else:
        found, leaves = [], _leaves(robot, arm)
    for leaf in leaves:
        carried = [frame.placement.translation for frame in model.frames if frame.parentJoint == leaf]
        outermost = max(carried, key=np.linalg.norm, default=np.zeros(3))
        if np.linalg.norm(outermost) > 1e-6:
            found.append((leaf, np.array(outermost)))
    return found


def _feet(robot: Robot, arm: Sequence[int]) -> list[tuple[int, Solid]]:
    """Where the column stands that carries an arm's first joint: the origin of the link below it, where the
    joint turns or slides along the line from there."""
    model, found = robot.model, []
    for joint in arm:
        name = model.names[joint]
        if model.parents[joint] in arm or not model.existFrame(name, pin.FrameType.JOINT):
            continue
        below = model.frames[model.frames[model.getFrameId(name, pin.FrameType.JOINT)].parentFrame]
        foot = np.array(below.placement.translation)
        column = model.jointPlacements[joint].translation - foot
        along = _motion(robot, joint)
        offset = float(np.linalg.norm(np.cross(column, along)))
        high = float(np.linalg.norm(column)) > _COLUMN
        if below.parentJoint == model.parents[joint] and high and offset < _COLUMN:
            found.append((joint, Solid(int(model.parents[joint]), foot[np.newaxis])))
    return found


def _motion(robot: Robot, joint: int) -> Array:
    """The direction (3,) about or along which a joint moves, in its parent's frame."""
    kind, model = robot.model.joints[joint], robot.model
    data = kind.createData()
    kind.calc(data, np.zeros(model.nq))
    screw = np.array(data.S, dtype=np.float64).reshape(6)
    return np.asarray(model.jointPlacements[joint].rotation @ (screw[3:] if screw[3:].any() else screw[:3]))


def _leaves(robot: Robot, arm: Sequence[int]) -> list[int]:
    parents = {int(robot.model.parents[joint]) for joint in arm}
    return [joint for joint in arm if joint not in parents]
