"""What a robot is: Pinocchio models, a platform, and the names of coordinates and inputs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from nmm.arrays import scalar, vector
from nmm.errors import InputError, unknown
from nmm.platforms.base import Platform
from nmm.robots.followers import SLACK, Follower, Following
from nmm.robots.meshes import MeshesWhenAsked, Shapes

Array = NDArray[np.float64]


#: Stands for the robot's centre of mass where a function names a frame (`tasks.CenterOfMass`).
CENTER_OF_MASS = "<center of mass>"
#: A limit this large is none, m or rad.
UNLIMITED = 1e6


@dataclass(frozen=True, eq=False)
class Wheel:
    """A wheel that only rolls: not a coordinate (its angle follows from the motion), turned in playback.

    A wheel may hang on a swivel, an upright joint that is no coordinate either: a caster's, or that of a
    steered wheel whose angle follows from that of others (Ackermann).

    Attributes
    ----------
    joint : name of its joint in the display model
    center : (3,) wheel centre in the carrier's frame with the swivel at zero, m
    axis : (3,) unit spin axis in the carrier's frame with the swivel at zero, level
    radius : m
    carrier : name of the movable joint of `model` that carries it; "theta" for the root link's body
    swivel : name of the swivel's joint in the display model, or "" without
    pivot : (3,) a point of the swivel's axis in the carrier's frame, m
    roller : angle γ of its rollers, rad (see `Platform.roller`)
    """

    joint: str
    center: Array
    axis: Array
    radius: float
    carrier: str = "theta"
    swivel: str = ""
    pivot: Array = field(default_factory=lambda: np.zeros(3))
    roller: float = 0.0

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints in the display model: the swivel's, if there is one, and its own."""
        return (self.swivel, self.joint) if self.swivel else (self.joint,)

    @property
    def is_fixed(self) -> bool:
        """Whether it hangs on the root link's body, without swivel and rollers: it rolls one way only."""
        return self.carrier == "theta" and not self.swivel and self.roller == 0.0


@dataclass(frozen=True, eq=False)
class Robot:
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
    parts : what loading keeps for mounting and for reports (`nmm.robots.loading.provenance.Parts`)
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
    def q_names(self) -> tuple[str, ...]:
        """Names of the n coordinates: the platform's, then the arm's joints."""
        model = self.model
        names = [""] * model.nq
        for joint in range(1, model.njoints):
            names[model.joints[joint].idx_q] = model.names[joint]
        return tuple(names)

    @cached_property
    def u_names(self) -> tuple[str, ...]:
        """Names of the p + n_m inputs: the platform's, then the arm's joints that follow no other."""
        return self.platform.inputs + tuple(self.q_names[i] for i in self.arm_coordinates)

    @cached_property
    def following(self) -> Following:
        """The followers in numbers: columns, leaders, multipliers, offsets."""
        return Following(self.followers, self.q_names)

    @cached_property
    def arm_coordinates(self) -> NDArray[np.int64]:
        """Index of the coordinate each of the arm's inputs moves, (n_u - p,): input p + j is its rate."""
        moved: NDArray[np.int64] = self.following.independent[self.platform.n_p :]
        moved.flags.writeable = False
        return moved

    @cached_property
    def q_units(self) -> tuple[str, ...]:
        """Unit of each coordinate: m or rad."""
        model = self.model
        units = [""] * model.nq
        for joint in range(1, model.njoints):
            kind = model.joints[joint].shortname()
            units[model.joints[joint].idx_q] = "m" if "JointModelP" in kind else "rad"
        return tuple(units)

    @cached_property
    def u_units(self) -> tuple[str, ...]:
        """Unit of each input."""
        return self.platform.input_units + tuple(f"{self.q_units[i]}/s" for i in self.arm_coordinates)

    @cached_property
    def q_limits(self) -> Array:
        """Lower and upper limit of each coordinate, (n, 2), m or rad; infinite where there is none.

        Those of a coordinate that others follow are narrowed to what these allow.
        """
        limits = self._limits[0]
        limits.flags.writeable = False
        return limits

    @property
    def unheeded(self) -> tuple[Follower, ...]:
        """The followers whose own limits would leave the joint that they follow no room, and do not count."""
        return self._limits[1]

    @cached_property
    def _limits(self) -> tuple[Array, tuple[Follower, ...]]:
        limits = np.column_stack([self.model.lowerPositionLimit, self.model.upperPositionLimit])
        own = self.platform.coordinate_limits
        limits[: len(own), 0] = np.maximum(limits[: len(own), 0], own[:, 0])
        limits[: len(own), 1] = np.minimum(limits[: len(own), 1], own[:, 1])
        return self.following.narrowed(limits)

    @cached_property
    def limited(self) -> NDArray[np.bool_]:
        """Whether each lower and upper limit of `q_limits` is one, (n, 2): finite and below 1e6 in size.

        URDF asks for two numbers at every sliding joint, so files write ±1e9 or the largest float for
        "none". No joint slides a thousand kilometres or turns 160 000 times.
        """
        limited = np.isfinite(self.q_limits) & (np.abs(self.q_limits) < UNLIMITED)
        limited.flags.writeable = False
        return np.asarray(limited)

    @cached_property
    def u_limits(self) -> Array:
        """Largest absolute value of each input, (n_u,): the platform's, then the joints' velocity limits.

        Those of a joint that others follow are narrowed to what these allow.
        """
        own = np.array(self.model.velocityLimit)
        speeds = self.following.slowed(np.where(own > 0.0, own, np.inf))
        limits = np.concatenate([self._platform_limits(speeds), speeds[self.arm_coordinates]])
        limits.flags.writeable = False
        return limits

    def _platform_limits(self, speeds: Array) -> Array:
        """Those of the platform, and of its own joints where an input is one's rate (a steering rate)."""
        platform = self.platform
        limits = platform.input_limits
        if platform.n_p > 3:
            G = platform.G(np.zeros(platform.n_p))
            for column in range(platform.p):
                (rows,) = np.nonzero(G[:, column])
                if len(rows) == 1 and rows[0] >= 3 and G[rows[0], column] == 1.0:
                    limits[column] = min(limits[column], speeds[rows[0]])
        return limits

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
    def groups(self) -> Mapping[str, tuple[str, ...]]:
        """Inputs that are spoken of together: "platform", "arm" (all joints), and each arm by its name."""
        p = self.platform.p
        own = {arm: tuple(j for j in joints if j in self.u_names) for arm, joints in self.arms.items()}
        return {"platform": self.u_names[:p], "arm": self.u_names[p:], **own}

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.model.nq)

    @property
    def n_independent(self) -> int:
        """Number of coordinates that follow no other."""
        return len(self.following.independent)

    @property
    def n_u(self) -> int:
        """Number of inputs, p + n_m."""
        return self.platform.p + len(self.arm_coordinates)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames that a task may speak of, in the model's order."""
        seen = dict.fromkeys(frame.name for frame in self.model.frames)
        return tuple(name for name in seen if name != "universe")

    def frame_id(self, name: str) -> int:
        """Pinocchio's index of a frame; of the link's where a link and a joint share the name."""
        for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME):
            if self.model.existFrame(name, kind):
                return int(self.model.getFrameId(name, kind))
        if name == "universe" or not self.model.existFrame(name):
            raise InputError(unknown("frame", name, self.frames, f"robot {self.name}"))
        return int(self.model.getFrameId(name))

    def check_limits(self, q: ArrayLike) -> None:
        """`InputError` names every coordinate of q (n,) that is outside its limits, and what they are, and
        every follower that is not where its leader has it."""
        q = self.q(q)
        following = {one.joint for one in self.followers}  # their leaders' limits are theirs, too
        outside = [
            f"{name} = {value:g} {unit} (from {lower:g} to {upper:g})"
            for name, value, unit, (lower, upper) in zip(
                self.q_names, q, self.q_units, self.q_limits, strict=True
            )
            if name not in following and not lower - SLACK <= value <= upper + SLACK
        ]
        complaints = [f"outside its limits: {', '.join(outside)}"] if outside else []
        complaints += self._strays(q)
        problem = self.platform.problem(q[: self.platform.n_p])
        if problem is not None:
            complaints.append(problem)
        if complaints:
            raise InputError(f"{self.name}: {'; '.join(complaints)}")

    def check_followers(self, q: ArrayLike) -> None:
        """`InputError` names every follower in q (n,) that is not where its leader has it."""
        strays = self._strays(self.q(q))
        if strays:
            raise InputError(f"{self.name}: {'; '.join(strays)}")

    def _strays(self, q: Array) -> list[str]:
        placed = self.following.placed(q)
        return [
            f"{one.joint} is at {q[i]:g} {self.q_units[i]}; it follows {one.leader}, which has it at "
            f"{placed[i]:g} ({one})"
            for one, i in zip(self.followers, self.following.columns, strict=True)
            if not abs(q[i] - placed[i]) <= SLACK * max(1.0, abs(placed[i]))
        ]

    def coordinate(self, name: str) -> int:
        """Index of a coordinate in q; `InputError` lists the names."""
        if name not in self.q_names:
            raise InputError(unknown("coordinate", name, self.q_names, f"robot {self.name}"))
        return self.q_names.index(name)

    def independent(self, name: str) -> int:
        """Index of a coordinate that follows no other; `InputError` names the one that it follows."""
        index = self.coordinate(name)
        for one in self.followers:
            if one.joint == name:
                raise InputError(f"robot {self.name}: {name} follows {one.leader} ({one}): give {one.leader}")
        return index

    def input(self, name: str) -> int:
        """Index of an input in u; `InputError` lists the names."""
        if name not in self.u_names:
            raise InputError(unknown("input", name, self.u_names, f"robot {self.name}"))
        return self.u_names.index(name)

    def q(self, values: Mapping[str, float] | ArrayLike | None = None) -> Array:
        """A configuration: from a vector, taken as it is, or by name.

        What is not named is zero, and a follower that is not named is where its leader has it.
        """
        if values is None or isinstance(values, Mapping):
            given = {self.coordinate(name): scalar(value, name) for name, value in (values or {}).items()}
            q = np.zeros(self.n)
            q[list(given)] = list(given.values())
            q = self.following.placed(q)
            q[list(given)] = list(given.values())
            return q
        try:
            return vector(values, self.n, "q")
        except InputError as error:
            raise InputError(f"{error} (robot {self.name} has q = {', '.join(self.q_names)})") from None

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

    @property
    def rest(self) -> Array:
        """The configuration nearest to zero within the limits, (n,)."""
        lower, upper = self.q_limits.T
        return self.following.placed(np.clip(np.zeros(self.n), lower, upper))

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
