"""A planar arm on a fixed base, of any lengths."""

from __future__ import annotations

from pathlib import Path

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
