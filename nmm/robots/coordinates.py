"""A robot's coordinates q and inputs u: their names, units and limits, and vectors of them by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.arrays import Array, Flags, Integers, scalar, unwritable, vector
from nmm.errors import InputError, expect_known
from nmm.platforms.base import Platform
from nmm.robots.followers import SLACK, Follower, Following
from nmm.robots.semantics import POSTURE, Named, Postures, Semantics

#: A limit this large is none, m or rad.
UNLIMITED = 1e5


class Coordinates:
    """What the model, the platform and the followers of a robot say of q and u."""

    name: str
    model: pin.Model
    platform: Platform
    followers: tuple[Follower, ...]
    semantics: Semantics
    parts: Any

    @property
    def locked(self) -> Mapping[str, float]:
        """The joints that loading fixed, because they were named or follow such a joint: where, m or rad."""
        return {} if self.parts is None else dict(self.parts.provenance.held)

    @property
    def postures(self) -> Postures:
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
    def following(self) -> Following:
        """The followers in numbers: columns, leaders, multipliers, offsets."""
        return Following(self.followers, self.q_names)

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
        """Lower and upper limit of each coordinate, (n, 2), m or rad; infinite where there is none.

        Those of a coordinate that others follow are narrowed to what these allow.
        """
        return unwritable(self._limits[0])

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
    def limited(self) -> Flags:
        """Whether each lower and upper limit of `q_limits` is one, (n, 2): finite and below 1e5 in size.

        URDF asks for two numbers at every sliding joint, so files write ±1e9 or the largest float for
        "none". No joint slides a hundred kilometres or turns 16 000 times.
        """
        return unwritable(np.isfinite(self.q_limits) & (np.abs(self.q_limits) < UNLIMITED))

    @cached_property
    def u_limits(self) -> Array:
        """Largest absolute value of each input, (n_u,): the platform's, then the joints' velocity limits.

        Those of a joint that others follow are narrowed to what these allow.
        """
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
            for column in range(platform.p):
                (rows,) = np.nonzero(G[:, column])
                if len(rows) == 1 and rows[0] >= 3 and G[rows[0], column] == 1.0:
                    moved[column] = rows[0]
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
        for one in self.followers:
            if one.joint == name:
                raise InputError(f"robot {self.name}: {name} follows {one.leader} ({one}): give {one.leader}")
        return index

    def input(self, name: str) -> int:
        """Index of an input in u; `InputError` lists the names, or says that it is locked."""
        self.expect_unlocked(name)
        expect_known("input", name, self.u_names, f"robot {self.name}")
        return self.u_names.index(name)

    def expect_unlocked(self, name: str) -> None:
        """`InputError` for a joint that was locked, and so is neither coordinate nor input."""
        if name in self.locked and name not in self.q_names:
            raise InputError(
                f"robot {self.name}: {name} is locked at {self.locked[name]:g} (by lock, or --lock), and so "
                "neither coordinate nor input: leave it out here, or do not lock it"
            )

    def q(self, values: Named | ArrayLike | None = None) -> Array:
        """A configuration: from a vector, taken as it is, or by name, {"posture": "home", "q1": 0.3}.

        What is not named is zero, and a follower that is not named is where its leader has it. Coordinates
        have the last word over a posture. A locked joint may be named where it is locked.
        """
        if values is None or isinstance(values, Mapping):
            if values and POSTURE in values and POSTURE not in self.q_names:
                values = self.postures.within(values)
            given = {
                self.coordinate(name): scalar(value, name)
                for name, value in (values or {}).items()
                if name in self.q_names or abs(self.locked.get(name, np.inf) - scalar(value, name)) > SLACK
            }
            q = np.zeros(self.n)
            q[list(given)] = list(given.values())
            q = self.following.placed(q)
            q[list(given)] = list(given.values())
            return q
        try:
            return vector(values, self.n, "q")
        except InputError as error:
            raise InputError(f"{error} (robot {self.name} has q = {', '.join(self.q_names)})") from None

    @property
    def rest(self) -> Array:
        """The configuration nearest to zero within the limits, (n,)."""
        lower, upper = self.q_limits.T
        return self.following.placed(np.clip(np.zeros(self.n), lower, upper))

    def outside(self, q: ArrayLike, limits: Array | None = None) -> list[str]:
        """The coordinates of q (n,) that are outside limits (n, 2), the robot's own when not given: name,
        value, and the limits."""
        q = self.q(q)
        limits = self.q_limits if limits is None else limits
        following = {one.joint for one in self.followers}  # their leaders' limits are theirs, too
        return [
            f"{name} = {value:g} {unit} (from {lower:g} to {upper:g})"
            for name, value, unit, (lower, upper) in zip(self.q_names, q, self.q_units, limits, strict=True)
            if name not in following and not lower - SLACK <= value <= upper + SLACK
        ]

    def check_limits(self, q: ArrayLike, *, come_back: bool = False) -> None:
        """`InputError` names every coordinate of q (n,) that is outside its limits, and what they are, and
        every follower that is not where its leader has it.

        come_back : something brings back what is outside, which then is no complaint
        """
        q = self.q(q)
        outside = [] if come_back else self.outside(q)
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
