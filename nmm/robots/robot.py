"""What a robot is: Pinocchio models, a platform, and the names of coordinates and inputs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.doors import door
from nmm.errors import InputError, unknown
from nmm.kernels.kinematics import Joints
from nmm.platforms.base import Platform
from nmm.robots.coordinates import Coordinates
from nmm.robots.followers import Follower
from nmm.robots.joint_table import joint_table, own_axes
from nmm.robots.meshes import MeshesWhenAsked, Shapes
from nmm.robots.semantics import Semantics
from nmm.robots.wheel import Wheel

#: Stands for the robot's centre of mass where a function names a frame (`tasks.CenterOfMass`).
CENTER_OF_MASS = "<center of mass>"


@dataclass(frozen=True, eq=False)
class Robot(Coordinates):
    """A manipulator on a wheeled platform. Made by `nmm.load`; nothing in it changes afterwards.

    Attributes
    ----------
    name : the robot's name
    model : kinematics: joints x, y, theta, then the arm, in Pinocchio's order; nq = nv = n
    collision_model : collision shapes, on `model`; their meshes are read when it is first asked for
    display_model : as `model`, with the wheels as joints
    visual_model : visual shapes, on `display_model`; as for collisions
    platform : states G(qp)
    wheels : the wheels that playback turns
    source : the file, the bundled name, or "pin.Model"
    arguments : the xacro arguments that the file was read with
    notes : what loading did to the file, a sentence each
    arms : the joints of each arm by the arm's name, when several were mounted or one was named
    followers : coordinates that follow another one, which follows nobody; they have no input of their own
    semantics : what its SRDF says
    parts : what loading keeps for mounting and for reports (`nmm.robots.loading.provenance.Parts`)

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r", arguments={"d": 0.5})
    >>> robot.u_names, robot.n, robot.n_u
    (('v', 'omega', 'q1', 'q2'), 5, 4)
    >>> q = robot.q({"theta": np.pi, "q1": 0.5})
    >>> robot.S(q).round(3)
    array([[-1.,  0.,  0.,  0.],
           [ 0.,  0.,  0.,  0.],
           [ 0.,  1.,  0.,  0.],
           [ 0.,  0.,  1.,  0.],
           [ 0.,  0.,  0.,  1.]])
    """

    name: str
    model: pin.Model = field(repr=False)
    collision_model: pin.GeometryModel = field(repr=False)
    display_model: pin.Model = field(repr=False)
    visual_model: pin.GeometryModel = field(repr=False)
    platform: Platform
    wheels: tuple[Wheel, ...] = ()
    source: str = ""
    arguments: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    arms: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    followers: tuple[Follower, ...] = ()
    semantics: Semantics = field(default_factory=Semantics)
    parts: Any = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.model.nq != self.model.nv:
            raise InputError(
                f"{self.name}: expected one number per joint, got nq {self.model.nq}, nv {self.model.nv}"
            )
        shared = [name for name in self.q_names[self.platform.n_p :] if name in self.platform.inputs]
        if shared:
            raise InputError(
                f"{self.name}: joints have the names of inputs of the {self.platform.name} platform: "
                f"{', '.join(shared)}"
            )
        head = self.q_names[: self.platform.n_p]
        if head != self.platform.coordinates:
            raise InputError(
                f"{self.name}: the {self.platform.name} platform expects the first coordinates to be "
                f"{', '.join(self.platform.coordinates)}, the model has {', '.join(head)}"
            )
        for one in self.followers:
            if one.joint in head:
                raise InputError(f"{self.name}: {one}: the {self.platform.name} platform moves {one.joint}")
        try:
            self.following  # noqa: B018  # whether there are such coordinates is seen when it is made
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from None

    @property
    def shapes(self) -> Shapes:
        """Its shapes without asking for their meshes: names, places, colours, pairs.

        With `replace(robot, **robot.shapes._asdict(), ...)` they stay as they are: it asks for what it lacks.
        """
        return Shapes(vars(self)["visual_model"], vars(self)["collision_model"])

    @cached_property
    def fingerprint(self) -> str:
        """A digest of coordinates, inputs, geometry and platform: the same for robots that move alike."""
        model, platform = self.model, self.platform
        numbers = [placement.homogeneous.ravel() for placement in model.jointPlacements]
        numbers += [frame.placement.homogeneous.ravel() for frame in model.frames] + [platform.parameters]
        names = [*self.q_names, *self.u_names, platform.name, *(frame.name for frame in model.frames)]
        names += map(str, self.followers)
        # Rounded: another machine's last digit is no other robot.
        text = "\n".join([*names, *(f"{number:.6f}" for number in np.concatenate(numbers) + 0.0)])
        return hashlib.sha256(text.replace("-0.000000", "0.000000").encode()).hexdigest()[:16]

    @cached_property
    def joint_axes(self) -> list[pin.SE3]:
        """See `nmm.robots.joint_table.own_axes`."""
        return own_axes(self.model)

    @cached_property
    def joints(self) -> Joints:
        """The joints of `model` as compiled kinematics read them."""
        return joint_table(self.model, self.joint_axes)

    @cached_property
    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """Inputs that are spoken of together: "platform", "arm" (all joints), each arm by its name, and the
        SRDF's groups."""
        p = self.platform.p
        own = {arm: tuple(j for j in joints if j in self.u_names) for arm, joints in self.arms.items()}
        return {"platform": self.u_names[:p], "arm": self.u_names[p:], **self.semantics.groups, **own}

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames that a task may speak of, in the model's order."""
        seen = dict.fromkeys(frame.name for frame in self.model.frames)
        return tuple(name for name in seen if name != "universe")

    def frame_id(self, name: str) -> int:
        """Pinocchio's index of a frame; of the link's where a link and a joint share the name."""
        found = self._frame_ids.get(name)
        if found is None:
            found = self._frame_ids[name] = self._found_frame(name)
        return found

    @cached_property
    def _frame_ids(self) -> dict[str, int]:
        return {}

    def _found_frame(self, name: str) -> int:
        for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME):
            if self.model.existFrame(name, kind):
                return int(self.model.getFrameId(name, kind))
        if name == "universe" or not self.model.existFrame(name):
            raise InputError(unknown("frame", name, self.frames, f"robot {self.name}"))
        return int(self.model.getFrameId(name))

    @cached_property
    def joint_reaches(self) -> Array:
        """How far each joint of `model` can be from the first of its arm, (njoints,), m; 0 for no arm's.

        An upper bound: the lengths from joint to joint, added up, and what sliding joints travel within
        their limits; infinite where there is none.
        """
        model, sums = self.model, np.zeros(self.model.njoints)
        for joint in range(1, model.njoints):
            index, parent = model.joints[joint].idx_q, int(model.parents[joint])
            if index < self.platform.n_p:
                continue
            if parent > 0 and model.joints[parent].idx_q >= self.platform.n_p:
                sums[joint] = sums[parent] + np.linalg.norm(model.jointPlacements[joint].translation)
            if self.q_units[index] == "m":
                sums[joint] += np.abs(self.q_limits[index]).max() if self.limited[index].all() else np.inf
        return sums

    @cached_property
    def reach(self) -> float:
        """How far the frames of an arm can be from its first joint at most, m: the robot's natural length.

        1 for a robot without arms; what lies beyond a sliding joint without limits does not count.
        """
        ends = [
            self.joint_reaches[frame.parentJoint] + float(np.linalg.norm(frame.placement.translation))
            for frame in self.model.frames
            if frame.parentJoint > 0 and self.model.joints[frame.parentJoint].idx_q >= self.platform.n_p
        ]
        return max((end for end in ends if np.isfinite(end)), default=0.0) or 1.0

    def _repr_html_(self) -> str:
        """In a notebook: the page that shows it, with a slider for each coordinate."""
        page: str = door("nmm.playback.inline:of_robot")(self)
        return page

    def S(self, q: ArrayLike) -> Array:
        """S(q), shape (n, n_u): q_dot = S(q) u (paper, eqs. 2 and 3).

        S = blkdiag(G(qp), C), with C the identity where no joint follows another; a follower's row is its
        leader's, times its multiplier.
        """
        n_p, p, following = self.platform.n_p, self.platform.p, self.following
        S = np.zeros((self.n, self.n_u))
        S[:n_p, :p] = self.platform.G(self.q(q)[:n_p])
        S[self.arm_coordinates, p + np.arange(len(self.arm_coordinates))] = 1.0
        S[following.columns] = following.multipliers[:, np.newaxis] * S[following.leaders]
        return S


# Set here, where the dataclass does not take them for defaults.
Robot.collision_model = MeshesWhenAsked("collision_model")
Robot.visual_model = MeshesWhenAsked("visual_model")
