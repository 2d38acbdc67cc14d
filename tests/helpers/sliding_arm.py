"""An arm that slides along x and turns about z, for tests of limits that are none."""

from __future__ import annotations

from pathlib import Path

from urdf_parts import joint, link, robot, write


def sliding(folder: Path, lower: float, upper: float) -> Path:
    """A file of joints "slide", with these limits, m, and "turn", which carries "tip" 0.5 m further on."""
    limits = f'<limit lower="{lower!r}" upper="{upper!r}" effort="1" velocity="1"/>'
    turned = '<axis xyz="0 0 1"/><limit lower="-3" upper="1e9" effort="1" velocity="1"/>'
    text = robot(
        *(link(name) for name in ("base", "carriage", "arm", "tip")),
        joint("slide", "base", "carriage", "prismatic", f'<axis xyz="1 0 0"/>{limits}', origin=""),
        joint("turn", "carriage", "arm", "revolute", turned, origin=""),
        joint("end", "arm", "tip", "fixed", "", origin='<origin xyz="0.5 0 0"/>'),
    )
    return write(folder / "sliding.urdf", text)
