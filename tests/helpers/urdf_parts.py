"""URDF text for tests, written part by part; and random trees of it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
AXIS = '<axis xyz="0 0 1"/>'


def link(name: str, body: str = "") -> str:
    return f'<link name="{name}">{body}</link>'


def joint(
    name: str = "j",
    parent: str = "a",
    child: str = "b",
    kind: str = "revolute",
    body: str = AXIS + LIMIT,
    origin: str = '<origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/>',
) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{origin}{body}</joint>'


def robot(*parts: str, attributes: str = 'name="r"') -> str:
    return f"<robot {attributes}>" + "\n".join(parts) + "</robot>"


def shape(geometry: str, tag: str = "visual", more: str = "") -> str:
    return f"<{tag}><geometry>{geometry}</geometry>{more}</{tag}>"


def inertial(mass: float = 1.0, xyz: str = "0 0 0") -> str:
    moments = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    return f'<inertial><origin xyz="{xyz}"/><mass value="{mass}"/>{moments}</inertial>'


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def random_tree(rng: np.random.Generator, size: int) -> str:
    """A tree of `size` joints of all kinds under `base`, obliquely placed, with masses and shapes."""
    kinds = ["revolute", "continuous", "prismatic", "fixed"]
    parts = [link("base", inertial(2.0, "0.1 0 0.2") + shape('<box size="0.3 0.2 0.1"/>', "collision"))]
    for i in range(size):
        axis = rng.normal(size=3) if i % 2 else np.eye(3)[rng.integers(3)]
        body = f'<axis xyz="{numbers(axis / np.linalg.norm(axis))}"/>'
        body += f'<limit lower="{-1 - i}" upper="{2 + i}" effort="{3 + i}" velocity="{4 + i}"/>'
        body += f'<dynamics damping="{0.1 * (i + 1)}" friction="{0.2 * (i + 1)}"/>'
        origin = f'<origin xyz="{numbers(rng.normal(size=3))}" rpy="{numbers(rng.uniform(-3, 3, 3))}"/>'
        parent = "base" if i == 0 else f"link_{rng.integers(max(0, i - 3), i)}"
        # Names in an order that is not the file's: Pinocchio sorts.
        name = f"joint_{(7 * i + 3) % size:02d}_{i}"
        parts.append(joint(name, parent, f"link_{i}", kinds[(i + 1) % 4], body, origin))
        solid = shape(f'<sphere radius="{0.05 * (i + 1)}"/>', "collision", '<origin xyz="0.1 0.2 0.3"/>')
        parts.append(
            link(f"link_{i}", inertial(0.5 + i, "0.1 0.2 -0.1") + solid + shape('<box size="1 2 3"/>'))
        )
    return robot(*parts, attributes='name="tree"')


def vehicle(pivot: str, x: float, up: bool) -> str:
    """Two wheels, a pivot at x with a wheel or a trailer's two on it, a joint that mimics it, an arm's."""
    wheel = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'
    lower, upper, sign, half = (-0.3, 0.5, 1, 0.5) if up else (-0.5, 0.3, -1, -0.5)
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="2"/>'
    axis, still = (
        f'<axis xyz="0 0 {sign}"/>',
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/>',
    )
    sides = (("left", 0.3), ("right", -0.3))
    parts = [
        link("base"),
        joint(pivot, "base", "column", body=axis + limit, origin=f'<origin xyz="{x} 0 0.1"/>'),
    ]
    parts += [link("column"), link("flag"), link("arm")]
    for name, y in sides:
        at = f'<origin xyz="0 {y} 0.1"/>'
        parts += [
            joint(f"{name}_wheel", "base", f"{name}_tyre", "continuous", wheel, at),
            link(f"{name}_tyre"),
        ]
    below = [("only", "0 0 0")] if x > 0.0 else [(name, f"-0.5 {y} 0") for name, y in sides]
    for name, xyz in below:
        at = f'<origin xyz="{xyz}"/>'
        parts += [
            joint(f"{name}_far_wheel", "column", f"{name}_far", "continuous", wheel, at),
            link(f"{name}_far"),
        ]
    follows = f'{still}<mimic joint="{pivot}" multiplier="{half}" offset="0.1"/>'
    parts += [joint("flag_joint", "base", "flag", body=follows), joint("q1", "base", "arm", body=still)]
    return robot(*parts)
