"""A planar arm on a fixed base, of any lengths."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import nmm
from nmm.model.robots.robot import Robot

LIMITS = '<limit effort="9" velocity="9" lower="-7" upper="7"/>'


def planar_arm(folder: Path, *lengths: float, limited: bool = False) -> Robot:
    """A planar arm of so many links on a fixed base, joints q1, q2, ..., hand ee."""
    links, joints = ['<link name="base"/>'], []
    before, offset = "base", 0.0
    for k, length in enumerate(lengths, start=1):
        kind, limits = ("revolute", LIMITS) if limited else ("continuous", "")
        links.append(f'<link name="link{k}"/>')
        joints.append(
            f'<joint name="q{k}" type="{kind}"><parent link="{before}"/><child link="link{k}"/>'
            f'<origin xyz="{offset} 0 0"/><axis xyz="0 0 1"/>{limits}</joint>'
        )
        before, offset = f"link{k}", length
    joints.append(
        f'<joint name="end" type="fixed"><parent link="{before}"/><child link="ee"/>'
        f'<origin xyz="{offset} 0 0"/></joint>'
    )
    path = folder / "planar_arm.urdf"
    path.write_text(f'<robot name="planar_arm">{"".join([*links, *joints])}<link name="ee"/></robot>')
    return nmm.load(path, platform="fixed")


def link_lengths(robot: Robot) -> tuple[float, float]:
    """Of the two links of a planar arm, m."""
    at_zero = nmm.Configuration(robot, np.zeros(robot.n))
    points = [np.array(at_zero.placement(name).translation)[:2] for name in ("link1", "link2", "ee")]
    return float(np.linalg.norm(points[1] - points[0])), float(np.linalg.norm(points[2] - points[1]))
