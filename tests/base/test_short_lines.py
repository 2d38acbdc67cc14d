"""No line of `nmm info` and `nmm check` has over 300 characters, whatever the file holds."""

from __future__ import annotations

from pathlib import Path

import pytest
from urdf_parts import AXIS, LIMIT, joint, link, robot, shape, write

from nmm.base.bundled import bundled_robots
from nmm.base.errors import few
from nmm.base.text_format import folded
from nmm.cli.exit_status import status_of

SHARE = "package://example-robot-data/robots/"
#: With many mimic joints, many missing meshes, wheels that are none, long lists of postures' joints.
STRANGERS = (
    "pr2_description/urdf/pr2.urdf",
    "romeo_description/urdf/romeo_laas_small.urdf",
    "simple_humanoid_description/urdf/simple_humanoid.urdf",
    "panda_description/urdf/panda.urdf",
)
SPIN = '<axis xyz="0 1 0"/>'
LONG = '<axis xyz="1 0 0"/><limit lower="-20" upper="20"/>'


def named(kind: str, i: int, length: int = 90) -> str:
    return f"{kind}_{i:03d}_".ljust(length, "n")


def chain(
    kind: str, body: str, *, length: int = 90, star: bool = False, part: str = "", count: int = 40
) -> str:
    """`count` joints with long names, one after the other or all on the base."""
    parts = [link("base")]
    for i in range(count):
        above = "base" if star or i == 0 else named("link", i - 1, length)
        parts.append(
            joint(named("wheel" if star else "joint", i, length), above, named("link", i, length), kind, body)
        )
        parts.append(link(named("link", i, length), part.replace("MESH", named("mesh", i, 200))))
    return robot(*parts)


ADVERSARIAL = {
    "mimics": chain("revolute", AXIS + LIMIT + f'<mimic joint="{named("joint", 0)}"/>'),
    "continuous": chain("continuous", AXIS, count=60),
    "wheels": chain("continuous", SPIN, star=True),
    "slides": chain("prismatic", LONG, count=60),
    "meshes": chain("revolute", AXIS + LIMIT, part=shape('<mesh filename="package://p/MESH.stl"/>')),
    "types": chain("turning", AXIS + LIMIT),
    "endless names": chain("revolute", AXIS + LIMIT, length=400, count=20),
    "roots": robot(*(link(named("link", i)) for i in range(300))),
    "macros": robot(
        *(f'<xacro:macro name="{named("m", i)}" params="a b"/>' for i in range(30)),
        attributes='name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"',
    ),
    "parameters": robot(
        f'<xacro:macro name="m" params="{" ".join(named("p", i) for i in range(300))}"/>',
        attributes='name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"',
    ),
    "trees": "<mujoco><worldbody>"
    + "".join(f'<body name="{named("b", i)}"><joint/></body>' for i in range(300))
    + "</worldbody></mujoco>",
}


def longest(capsys: pytest.CaptureFixture[str]) -> int:
    told = capsys.readouterr()
    return max(map(len, f"{told.out}\n{told.err}".splitlines()))


@pytest.mark.parametrize("command", ["info", "check"])
@pytest.mark.parametrize("name", [*bundled_robots(), *(SHARE + name for name in STRANGERS)])
def test_lines_about_a_robot_are_short(name: str, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of([command, name]) in (0, 2)
    assert longest(capsys) <= 300


@pytest.mark.parametrize("command", ["info", "check"])
@pytest.mark.parametrize("case", ADVERSARIAL)
def test_lines_about_long_names_are_short(
    case: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = ADVERSARIAL[case]
    path = write(tmp_path / ("r.xml" if "<mujoco" in text else "r.urdf"), text)
    status_of([command, str(path)])
    assert longest(capsys) <= 300


def test_a_list_has_ten_names_or_fewer_long_ones() -> None:
    names = [f"joint_{i}" for i in range(30)]
    assert few(names) == f"{', '.join(names[:10])} and 20 more"
    long = [named("joint", i, 60) for i in range(30)]
    assert few(long) == f"{', '.join(long[:3])} and 27 more"
    assert few(["a" * 100]) == "a" * 69 + "…"


def test_a_long_line_is_told_in_several() -> None:
    assert folded("  a line  as it is ") == ["  a line  as it is "]
    line = " ".join(f"word-{i}" for i in range(100))
    parts = folded(line)
    assert max(map(len, parts)) <= 300
    assert " ".join(part.strip() for part in parts) == line
    assert max(map(len, folded("a" * 1000))) <= 300
