"""A car with an arm and a gripper as a reader wrote it: no command or scenario of ours names it."""

from __future__ import annotations

from pathlib import Path

from urdf_parts import joint, link, robot, shape, write

WHEEL = shape('<cylinder radius="0.15" length="0.06"/>', more='<origin rpy="1.5708 0 0"/>')
ARM = ("pan", "lift", "bend", "tilt", "roll")
FINGERS = ("left_finger_joint", "right_finger_joint")


def cart(path: Path, *, mimic: bool = False, speed: float = 6.0) -> Path:
    """Its file. mimic: whether the right finger follows the left one; speed: of the wheels behind, rad/s."""

    def placed(name: str, parent: str, child: str, kind: str, xyz: str, body: str = "") -> str:
        return joint(name, parent, child, kind, body, f'<origin xyz="{xyz}"/>')

    def about(axis: str, lower: float, upper: float, velocity: float) -> str:
        ends = f'lower="{lower}" upper="{upper}" ' if lower < upper else ""
        return f'<axis xyz="{axis}"/><limit {ends}velocity="{velocity}" effort="50"/>'

    parts = [link("base_link", shape('<box size="1.0 0.5 0.25"/>', more='<origin xyz="0.35 0 0.3"/>'))]
    for side, y in (("left", 0.3), ("right", -0.3)):
        behind, ahead, knuckle = f"rear_{side}_wheel", f"front_{side}_wheel", f"front_{side}_knuckle"
        spin = about("0 1 0", 0, 0, speed)
        parts += [
            *(link(behind, WHEEL), link(knuckle), link(ahead, WHEEL)),
            placed(f"{behind}_joint", "base_link", behind, "continuous", f"0 {y} 0.15", spin),
            placed(
                f"front_{side}_steer_joint",
                *("base_link", knuckle, "revolute", f"0.7 {y} 0.15", about("0 0 1", -0.7, 0.7, 1.2)),
            ),
            placed(f"{ahead}_joint", knuckle, ahead, "continuous", "0 0 0", about("0 1 0", 0, 0, 8.0)),
        ]
    above, links = "base_link", ("turret", "upper_arm", "forearm", "hand", "palm")
    places = ("0.5 0 0.425", "0 0 0.1", "0 0 0.4", "0 0 0.35", "0 0 0.1")
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1")
    for name, below, xyz, axis, end in zip(ARM, links, places, axes, (2.8, 1.8, 2.6, 1.9, 3), strict=True):
        parts += [link(below), placed(name, above, below, "revolute", xyz, about(axis, -end, end, 1.5))]
        above = below
    for side, y in (("left", 1), ("right", -1)):
        follows = f'<mimic joint="{FINGERS[0]}"/>' if mimic and side == "right" else ""
        slide = about(f"0 {y} 0", 0, 0.04, 0.1) + follows
        finger = f"{side}_finger"
        parts += [
            link(finger),
            placed(f"{finger}_joint", "palm", finger, "prismatic", f"0 {0.02 * y} 0.04", slide),
        ]
    parts += [link("grasp"), placed("grasp_joint", "palm", "grasp", "fixed", "0 0 0.1")]
    return write(path, robot(*parts, attributes='name="cart"'))


SCENARIO = """\
robot: {source}
q0: {{lift: 0.6, bend: 0.9, tilt: 0.4{start}}}
duration: {duration}
dt: 0.02
task:
  - {{kind: position, frame: grasp, axes: xyz, gain: 1,
     reference: {{kind: line, start: [1.2643, 0, 0.8152], end: [{end}, 0, 0.8152], duration: 10}}}}
{more}
resolver: {{kind: pg, alpha: 1}}
"""


def scenario(
    folder: Path, more: str = "", *, start: str = "", duration: float = 1.0, speed: float = 0.3
) -> Path:
    """A scenario that leads the cart's grasp along a line; `more`: keys of it."""
    source = cart(folder / "cart.urdf")
    text = SCENARIO.format(source=source, start=start, more=more, duration=duration, end=1.2643 + 10 * speed)
    return write(folder / "cart.yaml", text)
