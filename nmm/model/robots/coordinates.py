"""A robot's coordinates q and inputs u: their names, units and limits, and vectors of them by name."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Flags, Integers, scalar, unwritable, vector
from nmm.base.errors import InputError, expect_known, few
from nmm.base.text_format import apart
from nmm.model.platforms.base import Platform
from nmm.model.robots.mimic_joints import SLACK, MimicJoint, MimicJoints
from nmm.model.robots.semantics import POSTURE, Named, NamedPostures, Semantics

#: A limit this large is none, m or rad.
UNLIMITED = 1e5


class Coordinates:
    """What the model, the platform and the mimic joints of a robot say of q and u."""

    name: str
    model: pin.Model
    platform: Platform
    mimic_joints: tuple[MimicJoint, ...]
    semantics: Semantics
    parts: Any

    @property
    def locked(self) -> Mapping[str, float]:
        """Where (m or rad) loading fixed joints that were named, or that follow such a joint."""
        return {} if self.parts is None else dict(self.parts.provenance.held)

    @property
    def renamed(self) -> Mapping[str, str]:
        """The names of joints and links that have another name in the file, by that name (`load`)."""
        return {} if self.parts is None else dict(self.parts.provenance.renamed)

    @property
    def postures(self) -> NamedPostures:
        """The SRDF's named postures: the coordinates that each sets, m and rad; `q` takes them by name."""
        return self.semantics.postures

    @cached_property
    def _joints(self) -> list[int]:
        """Pinocchio's joints in the order of the coordinates."""
        joints = self.model.joints
        return sorted(range(1, self.model.njoints), key=lambda joint: int(joints[joint].idx_q))

    @cached_property
    def q_names(self) -> tuple[str, ...]:
        """Names of the n coordinates: the platform's, then the arm's joints."""
        return tuple(self.model.names[joint] for joint in self._joints)

    @cached_property
    def u_names(self) -> tuple[str, ...]:
        """Names of the p + n_m inputs: the platform's, then the arm's joints that follow no other."""
        return self.platform.inputs + tuple(self.q_names[i] for i in self.arm_coordinates)

    @cached_property
    def following(self) -> MimicJoints:
        """The mimic joints in numbers."""
        return MimicJoints(self.mimic_joints, self.q_names)

    @cached_property
    def arm_coordinates(self) -> Integers:
        """Index of the coordinate each of the arm's inputs moves, (n_u - p,): input p + j is its rate."""
        return unwritable(self.following.independent[self.platform.n_p :])

    @cached_property
    def q_units(self) -> tuple[str, ...]:
        """Unit of each coordinate: m or rad."""
        kinds = [self.model.joints[joint].shortname() for joint in self._joints]
        return tuple("m" if "JointModelP" in kind else "rad" for kind in kinds)

    @cached_property
    def u_units(self) -> tuple[str, ...]:
        """Unit of each input."""
        return self.platform.input_units + tuple(f"{self.q_units[i]}/s" for i in self.arm_coordinates)

    @cached_property
    def q_limits(self) -> Array:
        """Limits (n, 2) of the coordinates, m or rad, narrowed by those of mimic joints; infinite without."""
        return unwritable(self._limits[0])

    @property
    def unheeded(self) -> tuple[MimicJoint, ...]:
        """The mimic joints whose limits are ignored: they would leave their leader no room."""
        return self._limits[1]

    @cached_property
    def _limits(self) -> tuple[Array, tuple[MimicJoint, ...]]:
        limits = np.column_stack([self.model.lowerPositionLimit, self.model.upperPositionLimit])
        own = self.platform.coordinate_limits
        limits[: len(own), 0] = np.maximum(limits[: len(own), 0], own[:, 0])
        limits[: len(own), 1] = np.minimum(limits[: len(own), 1], own[:, 1])
        return self.following.narrowed(limits)

    @cached_property
    def limited(self) -> Flags:
        """Whether each lower and upper limit of `q_limits` is one, (n, 2): finite and below 1e5 in size."""
        # URDF asks for two numbers at every sliding joint: files write ±1e9 or the largest float for "none".
        return unwritable(np.isfinite(self.q_limits) & (np.abs(self.q_limits) < UNLIMITED))

    @cached_property
    def endless(self) -> Flags:
        """Whether each coordinate is an angle without limits, (n,), which sensors may tell in (-π, π]."""
        kinds = [self.model.joints[joint].shortname() for joint in self._joints]
        screws = np.array(["JointModelH" in kind for kind in kinds], dtype=bool)
        turns = (np.array(self.q_units) == "rad") & ~self.limited.any(axis=1) & ~screws
        turns[2 : min(3, self.platform.n_p)] = True  # θ, whatever the file says of it
        return unwritable(turns)

    @cached_property
    def continuous(self) -> Flags:
        """Whether a full turn of each independent coordinate leads to the same posture, (n,): θ, joints that
        the file calls continuous, others without limits. A joint that would not come round with it makes its
        leader none."""
        flags = self.endless.copy()
        for mimic, f, leader in zip(
            self.mimic_joints, self.following.columns, self.following.leaders, strict=True
        ):
            comes_round = not mimic.multiplier or (self.endless[f] and float(mimic.multiplier).is_integer())
            flags[leader] &= comes_round
        flags[self.following.columns] = False
        return unwritable(flags)

    def turns(self, limits: Array | None = None) -> Array:
        """What a full turn of each coordinate, or of the one that it follows, turns it by, (n,): 1 of
        continuous ones, the multiplier of joints that follow these, 0 of others. A joint within limits (n, 2)
        makes none."""
        free = self.continuous.copy()
        if limits is not None:
            free[self.platform.n_p :] &= ~np.isfinite(limits[self.platform.n_p :]).any(axis=1)
        turns = free.astype(np.float64)
        following = self.following
        turns[following.columns] = following.multipliers * turns[following.leaders]
        return turns

    def short_way(self, off: Array) -> Array:
        """Differences of configurations (..., n) by the short way round: of continuous ones in [-π, π]."""
        full = 2.0 * np.pi
        return np.asarray(off - full * self.turns() * np.round(off[..., self.own_or_leader] / full))

    @cached_property
    def own_or_leader(self) -> Integers:
        """Each coordinate's own index or, of a mimic joint, its leader's, (n,)."""
        indices = np.arange(self.n)
        indices[self.following.columns] = self.following.leaders
        return unwritable(indices)

    @cached_property
    def u_limits(self) -> Array:
        """Largest |u| (n_u,): the platform's, then the joints' velocity limits, narrowed by mimic joints'."""
        own = np.array(self.model.velocityLimit)
        speeds = self.following.slowed(np.where(own > 0.0, own, np.inf))
        moved = self.rate_coordinates
        own = np.concatenate([self.platform.input_limits, np.full(len(self.arm_coordinates), np.inf)])
        return unwritable(np.minimum(own, np.where(moved < 0, np.inf, speeds[moved])))

    @cached_property
    def rate_coordinates(self) -> Integers:
        """The coordinate whose rate each input is, (n_u,): a joint, a steering angle; -1: none's."""
        platform = self.platform
        moved = np.full(self.n_u, -1, dtype=np.int64)
        moved[platform.p :] = self.arm_coordinates
        if platform.n_p > 3:
            G = platform.G(np.zeros(platform.n_p))
            (alone,) = np.nonzero((np.count_nonzero(G, axis=0) == 1) & (G[3:] == 1.0).any(axis=0))
            moved[alone] = 3 + G[3:, alone].argmax(axis=0)
        return unwritable(moved)

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

    def coordinate(self, name: str) -> int:
        """Index of a coordinate in q; `InputError` lists the names, or says that it is locked."""
        self.expect_unlocked(name)
        expect_known("coordinate", name, self.q_names, f"robot {self.name}")
        return self.q_names.index(name)

    def independent(self, name: str) -> int:
        """Index of a coordinate that follows no other; `InputError` names the one that it follows."""
        index = self.coordinate(name)
        for mimic in self.mimic_joints:
            if mimic.joint == name:
                what = f"{name} follows {mimic.leader} ({mimic}): give {mimic.leader}"
                raise InputError(what, where=f"robot {self.name}", got=name)
        return index

    def input(self, name: str) -> int:
        """Index of an input in u; `InputError` lists the names, or says that it is locked."""
        self.expect_unlocked(name)
        expect_known("input", name, self.u_names, f"robot {self.name}")
        return self.u_names.index(name)

    def expect_unlocked(self, name: str) -> None:
        """`InputError` for a joint that was locked, and so is neither coordinate nor input."""
        if name in self.locked and name not in self.q_names:
            what = (
                f"{name} is locked at {self.locked[name]:g} (by lock, or --lock), and so neither coordinate "
                "nor input: leave it out here, or do not lock it"
            )
            raise InputError(what, where=f"robot {self.name}", got=name)

    def q(self, values: Named | ArrayLike | None = None) -> Array:
        """A configuration from a vector, taken as it is, or by name: {"posture": "home", "q1": 0.3}.

        Coordinates override postures. What is not named is zero or, for a mimic joint, follows its leader; a
        locked joint may be named at its locked value."""
        if values is None or isinstance(values, Mapping):
            if values and POSTURE in values and POSTURE not in self.q_names:
                values = self.postures.within(values)
            entries = {
                self.coordinate(name): scalar(value, name)
                for name, value in (values or {}).items()
                if name in self.q_names or abs(self.locked.get(name, np.inf) - scalar(value, name)) > SLACK
            }
            columns, numbers = [*entries], [*entries.values()]
            q = np.zeros(self.n)
            q[columns] = numbers
            q = self.following.placed(q)
            q[columns] = numbers
            return q
        try:
            return vector(values, self.n, "q")
        except InputError as error:
            raise error.placed("q", what=f"robot {self.name} has q = {few(self.q_names)}") from None

    @property
    def rest(self) -> Array:
        """The configuration within the limits nearest to zero, or to where the file has it at first, (n,)."""
        lower, upper = self.q_limits.T
        return self.following.placed(np.clip(self.q(self.semantics.start), lower, upper))

    def outside(self, q: ArrayLike, limits: Array | None = None) -> dict[str, str]:
        """The coordinates of q (n,) outside limits (n, 2), by default the robot's: by name, in words."""
        q = self.q(q)
        limits = self.q_limits if limits is None else limits
        following = {mimic.joint for mimic in self.mimic_joints}  # their leaders' limits are theirs, too
        return {
            name: "{0} = {2} {1} (from {3} to {4})".format(name, unit, *apart(value, lower, upper, digits=6))
            for name, value, unit, (lower, upper) in zip(self.q_names, q, self.q_units, limits, strict=True)
            if name not in following and not lower - SLACK <= value <= upper + SLACK
        }

    def check_limits(self, q: ArrayLike, *, come_back: bool = False) -> None:
        """`InputError` for coordinates of q (n,) outside their limits, unless something lets them come back,
        and for mimic joints that are not where their leader puts them; `got` has their values by name."""
        q = self.q(q)
        outside = {} if come_back else self.outside(q)
        problem = self.platform.problem(q[: self.platform.n_p])
        complaints = [f"outside its limits: {few([*outside.values()])}"] if outside else []
        self._refuse(q, complaints, [*outside], [] if problem is None else [problem])

    def check_followers(self, q: ArrayLike) -> None:
        """`InputError` for mimic joints in q (n,) that are not where their leader puts them."""
        self._refuse(self.q(q), [], [], [])

    def _refuse(self, q: Array, complaints: list[str], names: list[str], more: list[str]) -> None:
        strays = self._strays(q)
        if complaints := [*complaints, *strays.values(), *more]:
            got = {name: float(q[self.q_names.index(name)]) for name in (*names, *strays)}
            raise InputError("; ".join(complaints), where=self.name, got=got)

    def _strays(self, q: Array) -> dict[str, str]:
        """The mimic joints that are not where their leader puts them, by name, in words."""
        placed = self.following.placed(q)
        return {
            mimic.joint: f"{mimic.joint} is at {q[i]:g} {self.q_units[i]}; it follows {mimic.leader}, which "
            f"has it at {placed[i]:g} ({mimic})"
            for mimic, i in zip(self.mimic_joints, self.following.columns, strict=True)
            if not abs(q[i] - placed[i]) <= SLACK * max(1.0, abs(placed[i]))
        }
