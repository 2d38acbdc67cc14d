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

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect, few, no_such
from nmm.base.findings import Finding
from nmm.base.kernels.kinematics import Joints
from nmm.base.lazy_call import lazy_call
from nmm.model.platforms.base import Platform
from nmm.model.robots.coordinates import Coordinates
from nmm.model.robots.joint_table import joint_table, own_axes
from nmm.model.robots.meshes import MeshesWhenAsked, Shapes
from nmm.model.robots.mimic_joints import MimicJoint
from nmm.model.robots.readings import Readings
from nmm.model.robots.semantics import Semantics
from nmm.model.robots.wheel import Wheel

#: Stands for the robot's centre of mass where a function names a frame (`tasks.CenterOfMass`).
CENTER_OF_MASS = "<center of mass>"


@dataclass(frozen=True, eq=False)
class Robot(Coordinates, Readings):
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
    followers : the mimic joints, each by an independent coordinate; they have no input of their own
    semantics : what its SRDF says
    nominal : what its file says of the numbers that were changed (`nmm.with_numbers`), by name
    corrections : by steered or arm joint, ratio (1) and offset: coordinate = ratio * reading + offset
    origins : by joint or frame, how it is placed in its axes as the file has them: x, y, z, roll, pitch, yaw
    unmoved : where the file has what `origins` moves (`nmm.model.robots.origins.Unmoved`)
    parts : what loading keeps for mounting and for reports (`nmm.model.robots.loading.provenance.Parts`)

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
    notes: tuple[Finding, ...] = ()
    arms: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    mimic_joints: tuple[MimicJoint, ...] = ()
    semantics: Semantics = field(default_factory=Semantics)
    nominal: Mapping[str, float] = field(default_factory=dict)
    corrections: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    origins: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    unmoved: Any = field(default=None, repr=False)
    parts: Any = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        sizes = self.model.nq, self.model.nv
        expect(sizes[0] == sizes[1], self.name, "one number per joint, nq = nv", sizes)
        shared = [name for name in self.q_names[self.platform.n_p :] if name in self.platform.inputs]
        if shared:
            what = f"joints have the names of inputs of the {self.platform.name} platform: {few(shared)}"
            raise InputError(what, where=self.name)
        head = self.q_names[: self.platform.n_p]
        expected = f"{', '.join(self.platform.coordinates)} as the first coordinates"
        where = f"{self.name}: platform {self.platform.name}"
        expect(head == self.platform.coordinates, where, expected, head)
        for mimic in self.mimic_joints:
            if mimic.joint in head:
                what = f"the {self.platform.name} platform moves {mimic.joint}"
                raise InputError(what, where=f"{self.name}: {mimic}", got=mimic.joint)
        try:
            self.following  # noqa: B018  # whether there are such coordinates is seen when it is made
        except InputError as error:
            raise error.at(self.name) from None

    @property
    def shapes(self) -> Shapes:
        """Its shapes, whose meshes may be unread: names, places, colours, pairs. They stay unread with
        `replace(robot, **robot.shapes._asdict(), ...)`, which else asks for what it lacks."""
        return Shapes(vars(self)["visual_model"], vars(self)["collision_model"])

    @cached_property
    def fingerprint(self) -> str:
        """A digest of coordinates, inputs, geometry and platform: the same for robots that move alike."""
        model, platform = self.model, self.platform
        numbers = [placement.homogeneous.ravel() for placement in model.jointPlacements]
        numbers += [frame.placement.homogeneous.ravel() for frame in model.frames] + [platform.parameters]
        names = [*self.q_names, *self.u_names, platform.name, *(frame.name for frame in model.frames)]
        names += map(str, self.mimic_joints)
        # Rounded: another machine's last digit is no other robot.
        text = "\n".join([*names, *(f"{number:.6f}" for number in np.concatenate(numbers) + 0.0)])
        return hashlib.sha256(text.replace("-0.000000", "0.000000").encode()).hexdigest()[:16]

    @cached_property
    def joint_axes(self) -> list[pin.SE3]:
        """See `nmm.model.robots.joint_table.own_axes`."""
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
        index = self._frame_ids.get(name)
        if index is None:
            if name == "universe" or not self.model.existFrame(name):
                raise no_such("frame", name, self.frames, f"robot {self.name}")
            index = self._frame_ids[name] = frame_index(self.model, name)
        return index

    @cached_property
    def _frame_ids(self) -> dict[str, int]:
        return {}

    @cached_property
    def joint_reaches(self) -> Array:
        """How far each joint of `model` can be from the first of its arm, (njoints,), m; 0 for no arm's. An
        upper bound: the lengths between joints and the travel of sliding ones (infinite if unlimited)."""
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
        """How far an arm's frames can be from its first joint at most, m: the robot's natural length; 1
        without arms. What lies beyond a sliding joint without limits does not count."""
        ends = [
            self.joint_reaches[frame.parentJoint] + float(np.linalg.norm(frame.placement.translation))
            for frame in self.model.frames
            if frame.parentJoint > 0 and self.model.joints[frame.parentJoint].idx_q >= self.platform.n_p
        ]
        return max((end for end in ends if np.isfinite(end)), default=0.0) or 1.0

    def q_from(
        self, joints: Mapping[str, float], base: ArrayLike | None = None, near: ArrayLike | None = None
    ) -> Array:
        """The configuration (n,) that sensors tell, m and rad.

        Parameters
        ----------
        joints : absolute encoders by the names of the file's joints, in any order, with the file's signs. A
            car's steered wheels say its steering angle; a mimic joint is where its leader puts it, and says
            where this is if its own encoder is missing; wheels that only roll are not looked at
        base : x, y, theta of the platform, by a localisation; none on a fixed base
        near : a configuration (n,): theta and angles without limits are taken nearest to it, by full turns

        Raises
        ------
        InputError : a joint without measurement, an unknown one, a number that is not finite, a joint that is
            measured more than 0.01 rad or m from where it is locked; a missing base

        Examples
        --------
        >>> robot = nmm.load("unicycle_2r")
        >>> robot.q_from({"q2": 0.5, "q1": 0.1}, base=(1, 2, 0.3), near=[0, 0, 6, 0, 0]).round(3)
        array([1.   , 2.   , 6.583, 0.1  , 0.5  ])
        """
        q: Array = self._encoders.q(joints, base, near)
        return q

    def odometry(self, q: ArrayLike, encoders: Mapping[str, float], **options: Any) -> Any:
        """A platform's pose by its wheels' encoders, from q (n,) on (`nmm.Odometry`).

        Parameters
        ----------
        q : where the robot stands, m and rad
        encoders : readings there, rad and m, by name: wheels that count (`robot.wheels`; a trailer's do not),
            or the platform's inputs for what counts these (v: the way), and joints as in `q_from`
        slip : the share of a wheel's turning that moves the platform, 1 by default: a number, or by name
        spread : variance of a wheel's turning for each radian that it turns, rad²/rad; 0 by default
        covariance : of x, y, theta (3, 3) at first; zero by default
        fastest : turning rate of a wheel (rad/s; of an input its own unit) beyond which `update` refuses a
            reading whose time it is given: a number, or by name; the file's limit by default
        wrapped : True, or names, for wheels that are read within one turn, (-π, π] or [0, 2π): no step may be
            more than half a turn, and `update` refuses those that could be; False for counters that count
            turns; by default as the readings show, with a warning where a turn ended
        t : when the readings were taken, s; without it the first `update` checks none against `fastest`

        Raises
        ------
        InputError : counters that do not determine all inputs, by name; a joint without measurement; a fixed
            base
        """
        return lazy_call("nmm.plugins.robot.odometry:Odometry")(self, q, encoders, **options)

    def wheel_speeds(self, u: ArrayLike, q: ArrayLike | None = None) -> dict[str, float]:
        """Speeds of the wheels that inputs u determine, (p,) or (n_u,), by joint, rad/s, with the joints' own
        signs; at q (n,), zero by default, which matters where the platform has joints (steering). Casters and
        further trailers' wheels have histories, and are not among them.

        Examples
        --------
        >>> nmm.load("differential_base", platform="unicycle").wheel_speeds([0.5, 0.0])
        {'left_wheel_joint': 5.0, 'right_wheel_joint': 5.0}
        """
        by_joint: dict[str, float] = lazy_call("nmm.plugins.robot.odometry:wheel_speeds")(self, u, q)
        return by_joint

    def platform_inputs(self, speeds: Mapping[str, float], q: ArrayLike | None = None) -> Array:
        """The platform's inputs (p,) for speeds of wheels, rad/s by joint, the nearest where they contradict
        each other. An input may be given by its name: a car's steering_rate, which fixed wheels do not show.

        Raises
        ------
        InputError : wheels that do not determine all inputs; an unknown name

        Examples
        --------
        >>> robot = nmm.load("differential_base", platform="unicycle")
        >>> robot.platform_inputs({"left_wheel_joint": 4.0, "right_wheel_joint": 6.0}).round(3)
        array([0.5, 0.5])
        """
        u: Array = lazy_call("nmm.plugins.robot.odometry:platform_inputs")(self, speeds, q)
        return u

    def _repr_html_(self) -> str:
        """In a notebook: the page that shows it, with a slider for each coordinate."""
        page: str = lazy_call("nmm.plugins.live.viewer:of_robot")(self)
        return page

    def S(self, q: ArrayLike) -> Array:
        """S(q), (n, n_u): q_dot = S(q) u (paper, eqs. 2 and 3). S = blkdiag(G(qp), C), C the identity but for
        mimic joints: their rows are their leaders', times the multiplier."""
        n_p, p, following = self.platform.n_p, self.platform.p, self.following
        S = np.zeros((self.n, self.n_u))
        S[:n_p, :p] = self.platform.G(self.q(q)[:n_p])
        S[self.arm_coordinates, p + np.arange(len(self.arm_coordinates))] = 1.0
        S[following.columns] = following.multipliers[:, np.newaxis] * S[following.leaders]
        return S


def frame_index(model: pin.Model, name: str) -> int:
    """Pinocchio's index of a frame of that name, which there is: of a link's before a joint's."""
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    kind = next((kind for kind in kinds if model.existFrame(name, kind)), None)
    return int(model.getFrameId(name) if kind is None else model.getFrameId(name, kind))


# Set here, where the dataclass does not take them for defaults.
Robot.collision_model = MeshesWhenAsked("collision_model")
Robot.visual_model = MeshesWhenAsked("visual_model")
