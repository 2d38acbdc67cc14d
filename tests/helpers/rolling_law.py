"""URDF texts of bases on wheels, and the law of rolling without slip on them by Pinocchio's own reader."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]

UP = "0 0 1"
LEFT = "0 1 0"
ARM = """
<link name="turret"/><link name="hand"/>
<joint name="pan" type="revolute"><parent link="base_link"/><child link="turret"/>
 <origin xyz="0.1 0 0.5"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="2" effort="9"/></joint>
<joint name="lift" type="revolute"><parent link="turret"/><child link="hand"/>
 <origin xyz="0 0 0.1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="2" effort="9"/></joint>
"""


def turns(
    name: str,
    parent: str,
    at: str,
    axis: str,
    ends: tuple[float, float] | None = None,
    kind: str = "revolute",
    rpy: str = "0 0 0",
    body: str = "",
) -> str:
    """A joint and the link NAME_link below it; without end where `ends` (rad or m) are not given."""
    kind = "continuous" if ends is None else kind
    limit = "" if ends is None else f'<limit lower="{ends[0]}" upper="{ends[1]}" velocity="2" effort="9"/>'
    return (
        f'<link name="{name}_link">{body}</link><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{name}_link"/><origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def slides(name: str, parent: str, at: str, ends: tuple[float, float] = (-0.01, 0.01)) -> str:
    return turns(name, parent, at, UP, ends, kind="prismatic")


def tyre(radius: float = 0.1, beside: float = 0.0) -> str:
    """A cylinder about y, its middle `beside` the joint, m."""
    return (
        f'<visual><origin xyz="0 {beside} 0" rpy="{0.5 * math.pi!r} 0 0"/><geometry>'
        f'<cylinder radius="{radius}" length="0.04"/></geometry></visual>'
    )


def wheel(name: str, parent: str, at: str, axis: str = LEFT, radius: float = 0.1, rpy: str = "0 0 0") -> str:
    return turns(name, parent, at, axis, rpy=rpy, body=tyre(radius))


def base(*parts: str, name: str = "r", arm: str = ARM) -> str:
    return f'<robot name="{name}"><link name="base_link"/>{"".join(parts)}{arm}</robot>'


class Rolling:
    """A text's robot on a plane: its root's pose is (x, y, theta), its twist (ahead, left, turn) on the
    root's own axes. Joints that are not named stand at zero."""

    def __init__(self, text: str) -> None:
        self.model = pin.buildModelFromXML(text, pin.JointModelPlanar())
        self.data = self.model.createData()

    def sign(self, joint: str) -> float:
        """1 where an upright joint's axis points up, -1 where it points down."""
        return float(np.sign(self._turning(joint, {})[2]))

    def _turning(self, joint: str, angles: Mapping[str, float]) -> Array:
        """A joint's axis in the root link's frame."""
        self._place(angles)
        jacobian = self._jacobian(joint)
        return np.array(jacobian[3:, self._column(joint)])

    def _place(self, angles: Mapping[str, float]) -> None:
        q = pin.neutral(self.model)
        for name, angle in angles.items():
            joint = self.model.joints[self.model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                [angle] if joint.nq == 1 else [math.cos(angle), math.sin(angle)]
            )
        pin.computeJointJacobians(self.model, self.data, q)

    def _jacobian(self, joint: str) -> Array:
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return np.array(pin.getJointJacobian(self.model, self.data, self.model.getJointId(joint), frame))

    def _column(self, joint: str) -> int:
        return int(self.model.joints[self.model.getJointId(joint)].idx_v)

    def row(self, wheel: str, angles: Mapping[str, float], pivots: Iterable[str] = ()) -> Array:
        """(3 + k,) What the root's twist and the pivots' rates add to the speed of the wheel's centre along
        its axis."""
        axis = self._turning(wheel, angles)
        columns = [0, 1, 2, *(self._column(pivot) for pivot in pivots)]
        return np.array(axis @ self._jacobian(wheel)[:3][:, columns])

    def centre(self, wheel: str) -> complex:
        self._place({})
        x, y, _ = self.data.oMi[self.model.getJointId(wheel)].translation
        return complex(x, y)

    def pointed(self, wheel: str, pivot: str, twist: Array) -> float:
        """The angle within (-90, 90] degrees at which the wheel rolls without slip in a twist: Newton's
        method from the direction in which its pivot moves."""
        self._place({})
        x, y, _ = self.data.oMi[self.model.getJointId(pivot)].translation
        moves = complex(twist[0] - twist[2] * y, twist[1] + twist[2] * x)
        axis = self._turning(wheel, {})
        angle = math.remainder(cmath.phase(moves) - math.atan2(-axis[0], axis[1]), math.pi) * self.sign(pivot)

        def slip(at: float) -> float:
            return float(self.row(wheel, {pivot: at}) @ twist)

        for _ in range(20):
            slope = (slip(angle + 1e-6) - slip(angle - 1e-6)) / 2e-6
            angle -= slip(angle) / slope if slope else 0.0
        return angle

    def ends(self, joint: str) -> tuple[float, float]:
        """Limits, rad; infinite for a continuous joint."""
        found = self.model.joints[self.model.getJointId(joint)]
        if found.nq == 2:
            return -math.inf, math.inf
        return float(self.model.lowerPositionLimit[found.idx_q]), float(
            self.model.upperPositionLimit[found.idx_q]
        )
