"""Robots' files, one for each way in which wheels hang on a base, and what each of them is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rolling_law import LEFT, UP, base, slides, turns, tyre, wheel

NARROW = (-0.6, 0.6)
CORNERS = {"fl": (0.25, 0.2), "fr": (0.25, -0.2), "rl": (-0.25, 0.2), "rr": (-0.25, -0.2)}


@dataclass(frozen=True)
class Case:
    """What is in a file, and what it is.

    kind : the platform
    fixed : wheels on the base that neither steer nor slide
    steered : by wheel, its pivot; casters, which constrain nothing, are not among them
    lengths : what its numbers say, m, of the platform or of `measured_as`
    stand : joints that are neither coordinates nor wheels
    arm : coordinates besides the platform's and "pan", "lift"
    slack : sideways speed for an input of 1, m/s
    """

    text: str
    kind: str
    fixed: tuple[str, ...] = ()
    steered: Mapping[str, str] = field(default_factory=dict)
    lengths: Mapping[str, float] = field(default_factory=dict)
    measured_as: str = ""
    stand: tuple[str, ...] = ()
    arm: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    slack: float = 1e-9


def pair(x: float = 0.0, y: float = 0.2, names: str = "{}_wheel", **more: Any) -> str:
    """Two wheels that roll along x."""
    parent = more.pop("parent", "base_link")
    return "".join(
        wheel(names.format(side), parent, f"{x} {way * y} 0.1", **more)
        for side, way in (("left", 1), ("right", -1))
    )


DRIVE = ("left_wheel", "right_wheel")


def steered(
    x: float, y: float, pivot: str, name: str, ends: tuple[float, float] | None = NARROW, **more: Any
) -> str:
    """A wheel below an upright joint."""
    parent, at = more.pop("parent", "base_link"), more.pop("at", "0 0 0")
    return turns(pivot, parent, f"{x} {y} 0.1", more.pop("upright", UP), ends) + wheel(
        name, f"{pivot}_link", at, **more
    )


def front(x: float, y: float = 0.2, pivots: str = "{}_steer", **more: Any) -> str:
    return "".join(
        steered(x, way * y, pivots.format(side), f"front_{side}_wheel", **more)
        for side, way in (("left", 1), ("right", -1))
    )


def fronts(pivots: str = "{}_steer") -> dict[str, str]:
    return {f"front_{side}_wheel": pivots.format(side) for side in ("left", "right")}


def corners(names: str = "{}_wheel", axis: str = LEFT, **more: Any) -> str:
    return "".join(
        wheel(names.format(name), "base_link", f"{x} {y} 0.1", axis, **more)
        for name, (x, y) in CORNERS.items()
    )


def all_corners(names: str = "{}_wheel") -> tuple[str, ...]:
    return tuple(names.format(name) for name in CORNERS)


def casters(names: str = "{}_pivot", ends: tuple[float, float] | None = None, trail: float = 0.0) -> str:
    return "".join(
        steered(x, y, names.format(name), f"{name}_wheel", ends, at=f"{-trail} 0 0")
        for name, (x, y) in CORNERS.items()
    )


def on_pivots(names: str = "{}_pivot") -> dict[str, str]:
    return {f"{name}_wheel": names.format(name) for name in CORNERS}


def ball(name: str, at: str, joints: int) -> str:
    """Joints about x, y and z, each right below the one before."""
    parent, text = "roll_link", ""
    for k, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")[:joints]):
        text += turns(f"{name}_{k}", parent, at if k == 0 else "0 0 0", axis)
        parent = f"{name}_{k}_link"
    return text


def module(joints: int) -> str:
    """Two driven wheels behind an upright joint through the base's middle, and balls that carry the rest."""
    below = "".join(
        wheel(f"{side}_drive_wheel", "roll_link", f"-0.11 {y} 0.04", radius=0.04)
        for side, y in (("left", 0.13), ("right", -0.13))
    )
    turning = (
        '<link name="roll_link"/><joint name="base_roll_joint" type="continuous"><parent link="base_link"/>'
        '<child link="roll_link"/><axis xyz="0 0 1"/></joint>'
    )
    return base(turning, below, ball("passive_wheel", "0.15 0 0.03", joints))


def around(count: int, radius: float = 0.2, names: str = "wheel_{}", more: str = "") -> str:
    """Wheels whose axes meet in the middle."""
    text = ""
    for k in range(count):
        angle = 2.0 * math.pi * k / count
        name = names.format(k)
        at = f"{radius * math.cos(angle)!r} {radius * math.sin(angle)!r} 0.05"
        text += wheel(name, "base_link", at, LEFT, 0.05, rpy=f"0 0 {angle + 0.5 * math.pi!r}")
        text += more.replace("WHEEL", name)
    return text


def rim(name: str, radius: float, aslant: float, count: int = 8) -> str:
    """Rollers around a wheel that turns about y, at `aslant` to its axis, rad; pi/2 for an omni wheel's."""
    text = ""
    for k in range(count):
        angle = 2.0 * math.pi * k / count
        x, z = math.cos(angle), math.sin(angle)
        tangent = np.array([-z, 0.0, x])
        axis = math.cos(aslant) * np.array([0.0, 1.0, 0.0]) + math.sin(aslant) * tangent
        at = f"{radius * x!r} 0 {radius * z!r}"
        text += turns(f"{name}_roller_{k}", f"{name}_link", at, " ".join(map(repr, map(float, axis))))
    return text


def rollers(names: tuple[str, ...], count: int = 8) -> tuple[str, ...]:
    return tuple(f"{name}_roller_{k}" for name in names for k in range(count))


def marked(text: str, more: str) -> str:
    return text.replace("</robot>", f"{more}</robot>")


FREE_ASIDE = "".join(
    f'<gazebo reference="{name}_wheel_link"><mu1>1.0</mu1><mu2>0.0</mu2></gazebo>' for name in CORNERS
)
ROCKERS = "".join(
    turns(f"{side}_rocker", "base_link", f"0 {y} 0.2", LEFT, (-0.3, 0.3))
    + "".join(
        wheel(f"{end}_{side}_wheel", f"{side}_rocker_link", f"{x} {0.05 if y > 0 else -0.05} -0.1")
        for end, x in (("front", 0.3), ("rear", -0.3))
    )
    for side, y in (("left", 0.2), ("right", -0.2))
)
BOGIES = "".join(
    turns(f"{side}_rocker", "base_link", f"0 {y} 0.3", LEFT, (-0.5, 0.5))
    + wheel(f"front_{side}_wheel", f"{side}_rocker_link", "0.4 0 -0.2")
    + turns(f"{side}_bogie", f"{side}_rocker_link", "-0.2 0 -0.1", LEFT, (-0.5, 0.5))
    + wheel(f"middle_{side}_wheel", f"{side}_bogie_link", "0.2 0 -0.1")
    + wheel(f"rear_{side}_wheel", f"{side}_bogie_link", "-0.2 0 -0.1")
    for side, y in (("left", 0.25), ("right", -0.25))
)
SHOCKS = "".join(
    slides(f"{side}_shock", "base_link", f"0.8 {y} 0.1")
    + turns(f"{side}_knuckle", f"{side}_shock_link", "0 0 0", UP, NARROW)
    + wheel(f"front_{side}_wheel", f"{side}_knuckle_link", "0 0 0")
    for side, y in (("left", 0.3), ("right", -0.3))
)
SPRUNG = "".join(
    slides(f"{side}_suspension", "base_link", f"0 {y} 0.1", (-0.005, 0.005))
    + wheel(f"{side}_wheel", f"{side}_suspension_link", "0 0 0")
    for side, y in (("left", 0.2), ("right", -0.2))
)
TRACKS = "".join(
    "".join(wheel(f"{side}_wheel_{k}", "base_link", f"{x} {y} 0.1") for k, x in enumerate((-0.3, 0.0, 0.3)))
    + "".join(
        wheel(f"{side}_{end}_idler_wheel", "base_link", f"{x} {y} 0.2")
        for end, x in (("front", 0.5), ("rear", -0.5))
    )
    for side, y in (("left", 0.25), ("right", -0.25))
)
CABIN = turns("steering_wheel", "base_link", "0.4 0.2 0.9", "-0.6 0 0.8", body=tyre(0.15))
CLIMBING = "".join(
    wheel(f"{side}_climbing_wheel", "base_link", f"0.3 {y} 0.18")
    for side, y in (("left", 0.2), ("right", -0.2))
)
SWIVELS = "".join(
    turns(f"caster_{side}", "base_link", f"-0.3 {y} 0.1", UP)
    + wheel(f"caster_{side}_wheel", f"caster_{side}_link", "-0.04 0 -0.05", radius=0.05)
    for side, y in (("left", 0.15), ("right", -0.15))
)
POLISHER = turns("flip", "hand_link", "0.2 0 0", UP, (-1.0, 1.0)).replace(
    'parent link="hand_link"', 'parent link="hand"'
) + wheel("polishing_wheel", "flip_link", "0.1 0 0", radius=0.03)
TURRET = turns("camera_turret", "base_link", "0 0 0.4", UP, (-1.0, 1.0)) + (
    turns("camera_tilt", "camera_turret_link", "0 0 0.1", LEFT, (-0.5, 0.5))
    + wheel("focus_wheel", "camera_turret_link", "0.1 0 0", radius=0.02)
)

HINGES = "".join(
    turns(f"{side}_steering_hinge", "base_link", f"0.16 {y} 0.1", UP, NARROW, body=tyre())
    for side, y in (("left", 0.3), ("right", -0.3))
)
LEGS = "".join(
    turns(f"{side}_hip", "base_link", f"0 {y} 0.6", LEFT, (-1.0, 1.0))
    + turns(f"{side}_knee", f"{side}_hip_link", "0 0 -0.25", LEFT, (-1.0, 1.0))
    + wheel(f"{side}_wheel", f"{side}_knee_link", "0 0 -0.25")
    for side, y in (("left", 0.2), ("right", -0.2))
)
DROPS = "".join(
    slides(f"wheel_drop_{side}", "base_link", f"0 {y} 0.1", (0.0, 0.03))
    + wheel(f"{side}_wheel", f"wheel_drop_{side}_link", "0 0 0")
    for side, y in (("left", 0.2), ("right", -0.2))
)
ROVER = "".join(
    turns(f"{side}_rocker", "base_link", f"0 {y} 0.3", LEFT, (-0.5, 0.5))
    + turns(f"front_{side}_corner", f"{side}_rocker_link", "0.4 0 -0.2", UP, (-1.0, 1.0))
    + wheel(f"front_{side}_wheel", f"front_{side}_corner_link", "0 0 0")
    + turns(f"{side}_bogie", f"{side}_rocker_link", "-0.2 0 -0.1", LEFT, (-0.5, 0.5))
    + wheel(f"middle_{side}_wheel", f"{side}_bogie_link", "0.2 0 -0.1")
    + turns(f"rear_{side}_corner", f"{side}_bogie_link", "-0.2 0 -0.1", UP, (-1.0, 1.0))
    + wheel(f"rear_{side}_wheel", f"rear_{side}_corner_link", "0 0 0")
    for side, y in (("left", 0.25), ("right", -0.25))
)
TWINS = "".join(
    turns(f"{name}_caster_rotation", "base_link", f"{x} {y} 0.1", UP)
    + "".join(
        wheel(f"{name}_caster_{side}_wheel", f"{name}_caster_rotation_link", f"0 {beside} 0")
        for side, beside in (("l", 0.05), ("r", -0.05))
    )
    for name, (x, y) in CORNERS.items()
)
OMNI_ARMS = "".join(
    turns(
        f"arm_{k}",
        "base_link",
        f"{0.15 * math.cos(angle)!r} {0.15 * math.sin(angle)!r} 0.05",
        LEFT,
        (-0.1, 0.1),
        rpy=f"0 0 {angle + 0.5 * math.pi!r}",
    )
    + wheel(f"wheel_{k}", f"arm_{k}_link", "0 -0.05 0", radius=0.05)
    for k, angle in enumerate((0.0, 2 * math.pi / 3, 4 * math.pi / 3))
)

CASES = {
    # Springs, rockers, bogies and shocks stand still; what is below them are the wheels.
    "sprung": Case(
        base(SPRUNG),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
        ("left_suspension", "right_suspension"),
    ),
    "with camber": Case(
        base(
            wheel("left_wheel", "base_link", "0 0.2 0.1", rpy="-0.05 0 0"),
            wheel("right_wheel", "base_link", "0 -0.2 0.1", rpy="0.05 0 0"),
        ),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
    ),
    "sprung, with casters": Case(base(SPRUNG, SWIVELS), "unicycle", DRIVE),
    "rockers": Case(
        base(ROCKERS),
        "skid_steer",
        lengths={"radius": 0.1, "length": 0.6, "width": 0.5},
        stand=("left_rocker", "right_rocker"),
        fixed=tuple(f"{end}_{side}_wheel" for end in ("front", "rear") for side in ("left", "right")),
    ),
    "rockers and bogies": Case(
        base(BOGIES),
        "skid_steer",
        lengths={"radius": 0.1, "length": 0.8, "width": 0.5},
        stand=tuple(f"{side}_{part}" for side in ("left", "right") for part in ("rocker", "bogie")),
        fixed=tuple(
            f"{end}_{side}_wheel" for end in ("front", "middle", "rear") for side in ("left", "right")
        ),
    ),
    "shocks above what steers": Case(
        base(pair(y=0.3), SHOCKS),
        "car",
        DRIVE,
        fronts("{}_knuckle"),
        {"wheelbase": 0.8},
        stand=("left_shock", "right_shock"),
    ),
    "legs": Case(
        base(LEGS),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
        tuple(f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee")),
    ),
    "wheel drops": Case(
        base(DROPS, wheel("front_caster", "base_link", "0.12 0 0.02", radius=0.02)),
        "unicycle",
        DRIVE,
        stand=("wheel_drop_left", "wheel_drop_right"),
    ),
    "a rover's corners steer": Case(
        base(ROVER),
        "wheeled",
        ("middle_left_wheel", "middle_right_wheel"),
        {
            f"{end}_{side}_wheel": f"{end}_{side}_corner"
            for end in ("front", "rear")
            for side in ("left", "right")
        },
        stand=tuple(f"{side}_{part}" for side in ("left", "right") for part in ("rocker", "bogie")),
    ),
    # Digits of real files.
    "3.14 about x": Case(
        base(
            wheel("left_wheel", "base_link", "0 0.2 0.1"),
            wheel("right_wheel", "base_link", "0 -0.2 0.1", "0 -1 0", rpy="3.14 0 0"),
        ),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
        slack=5e-3,
    ),
    "3.14 about z": Case(
        base(
            wheel("left_wheel", "base_link", "0 0.2 0.1"),
            wheel("right_wheel", "base_link", "0 -0.2 0.1", LEFT, rpy="0 0 3.14"),
        ),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
        slack=5e-3,
    ),
    "a pair that is 3 mm from even": Case(
        base(
            wheel("left_wheel", "base_link", "0.0015 0.2015 0.1"),
            wheel("right_wheel", "base_link", "-0.0015 -0.2 0.1"),
        ),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4015},
        "differential",
        slack=5e-3,
    ),
    # Cars, whatever their joints are called, wherever their root is.
    "a car from its middle": Case(
        base(pair(-0.5, 0.3, "rear_{}_wheel"), front(0.5, 0.3)),
        "car",
        ("rear_left_wheel", "rear_right_wheel"),
        fronts(),
        {"wheelbase": 1.0},
    ),
    "a car whose hubs steer": Case(
        base(pair(0.0, 0.3), front(1.0, 0.3, "front_{}_hub")),
        "car",
        DRIVE,
        fronts("front_{}_hub"),
        {"wheelbase": 1.0},
    ),
    "a car whose front tyres do not roll": Case(
        base(pair(-0.16, 0.3), HINGES),
        "car",
        DRIVE,
        lengths={"wheelbase": 0.32},
        stand=("left_steering_hinge", "right_steering_hinge"),
    ),
    "springs below what steers": Case(
        base(
            pair(0.0, 0.3),
            *(
                turns(f"{side}_knuckle", "base_link", f"0.9 {y} 0.1", UP, NARROW)
                + slides(f"{side}_spring", f"{side}_knuckle_link", "0 0 0")
                + wheel(f"front_{side}_wheel", f"{side}_spring_link", "0 0 0")
                for side, y in (("left", 0.3), ("right", -0.3))
            ),
        ),
        "car",
        DRIVE,
        fronts("{}_knuckle"),
        {"wheelbase": 0.9},
        stand=("left_spring", "right_spring"),
    ),
    "kingpins inside the tyres": Case(
        base(
            pair(0.0, 0.3),
            steered(0.9, 0.25, "left_pin", "front_left_wheel", at="0 0.05 0"),
            steered(0.9, -0.25, "right_pin", "front_right_wheel", at="0 -0.05 0"),
        ),
        "car",
        DRIVE,
        fronts("{}_pin"),
        {"wheelbase": 0.9},
    ),
    "a bicycle from its middle": Case(
        base(wheel("rear_wheel", "base_link", "-0.5 0 0.1"), steered(0.5, 0.0, "fork", "front_wheel")),
        "car",
        ("rear_wheel",),
        {"front_wheel": "fork"},
        {"wheelbase": 1.0},
    ),
    "a tricycle whose column is called nothing": Case(
        base(pair(-0.2, 0.3), steered(0.4, 0.0, "j7", "nose_wheel")),
        "car",
        DRIVE,
        {"nose_wheel": "j7"},
        {"wheelbase": 0.6},
    ),
    "a tricycle whose column points down": Case(
        base(pair(0.0, 0.3), steered(0.7, 0.0, "fork", "nose_wheel", (-0.5, 0.5), upright="0 0 -1")),
        "car",
        DRIVE,
        {"nose_wheel": "fork"},
        {"wheelbase": 0.7},
    ),
    "kingpins that lean": Case(
        base(
            pair(0.0, 0.3),
            steered(0.9, 0.25, "left_pin", "front_left_wheel", upright="0 -0.1 0.995", at="0 0 0"),
            steered(0.9, -0.25, "right_pin", "front_right_wheel", upright="0 0.1 0.995", at="0 0 0"),
        ),
        "car",
        DRIVE,
        fronts("{}_pin"),
        {"wheelbase": 0.9},
        slack=5e-3,
    ),
    "a car with a steering wheel in its cabin": Case(
        base(pair(0.0, 0.3), front(0.9, 0.3), CABIN),
        "car",
        DRIVE,
        fronts(),
        {"wheelbase": 0.9},
        arm=("steering_wheel",),
    ),
    "columns that are given": Case(
        base(pair(0.0, 0.3), front(0.9, 0.3, "{}_column", ends=None)),
        "car",
        DRIVE,
        fronts("{}_column"),
        {"wheelbase": 0.9},
        options={"steer": ["left_column", "right_column"]},
    ),
    "the same, not given": Case(
        base(pair(0.0, 0.3), front(0.9, 0.3, "{}_column", ends=None)), "unicycle", DRIVE
    ),
    "a tricycle steered behind": Case(
        base(pair(0.0, 0.3), steered(-0.8, 0.0, "tail_pivot", "tail_wheel")),
        "wheeled",
        DRIVE,
        {"tail_wheel": "tail_pivot"},
    ),
    "a pair steered behind": Case(
        base(pair(0.0, 0.3), front(-0.8, 0.3, "rear_{}_pivot")),
        "wheeled",
        DRIVE,
        fronts("rear_{}_pivot"),
    ),
    "four wheels steered a little": Case(
        base(casters("{}_steer", (-0.5, 0.5))), "wheeled", (), on_pivots("{}_steer")
    ),
    # Bases that go every way.
    "wheels on pivots called casters": Case(
        base(casters("caster_joint_{}")), "omnidirectional", (), on_pivots("caster_joint_{}")
    ),
    "the same, held": Case(
        base(casters("caster_joint_{}")),
        "mecanum",
        all_corners(),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.4},
        options={"lock": {"caster_joint_*": 0.0}, "platform": "mecanum"},
    ),
    "modules of a swerve drive": Case(
        base(casters("{}_module")), "omnidirectional", (), on_pivots("{}_module")
    ),
    "two wheels to each pivot": Case(
        base(TWINS),
        "omnidirectional",
        (),
        {f"{name}_caster_{side}_wheel": f"{name}_caster_rotation" for name in CORNERS for side in ("l", "r")},
    ),
    "two diagonal modules and casters": Case(
        base(
            steered(0.4, 0.2, "a_steer", "a_wheel", (-1.6, 1.6)),
            steered(-0.4, -0.2, "b_steer", "b_wheel", (-1.6, 1.6)),
            SWIVELS,
        ),
        "omnidirectional",
        (),
        {"a_wheel": "a_steer", "b_wheel": "b_steer"},
    ),
    "modules, one of them 15 mm beside": Case(
        base(
            *(
                steered(x, y, f"{name}_wheel_j1", f"{name}_wheel_j2", (-3.14, 3.14), at=f"{trail} 0 0")
                for name, x, y, trail in (
                    ("B", -0.2, 0.0, 0.0),
                    ("L", 0.1, 0.2, 0.0),
                    ("R", 0.1, -0.2, -0.015),
                )
            )
        ),
        "omnidirectional",
        (),
        {f"{name}_wheel_j2": f"{name}_wheel_j1" for name in "BLR"},
    ),
    "omni wheels on arms that give": Case(
        base(OMNI_ARMS),
        "omnidirectional",
        ("wheel_0", "wheel_1", "wheel_2"),
        stand=("arm_0", "arm_1", "arm_2"),
    ),
    "driven casters": Case(
        base(casters("{}_rotation", trail=0.03)), "omnidirectional", (), on_pivots("{}_rotation")
    ),
    "a base on a turning joint, on balls of two": Case(
        module(2),
        "omnidirectional",
        (),
        dict.fromkeys(("left_drive_wheel", "right_drive_wheel"), "base_roll_joint"),
        stand=("passive_wheel_0", "passive_wheel_1"),
    ),
    "a base on a turning joint, on balls of three": Case(
        module(3),
        "omnidirectional",
        (),
        dict.fromkeys(("left_drive_wheel", "right_drive_wheel"), "base_roll_joint"),
        stand=("passive_wheel_0", "passive_wheel_1", "passive_wheel_2"),
    ),
    "three wheels whose axes meet": Case(
        base(around(3)), "omnidirectional", ("wheel_0", "wheel_1", "wheel_2")
    ),
    "four whose axes meet": Case(base(around(4)), "omnidirectional", tuple(f"wheel_{k}" for k in range(4))),
    "omni wheels with rollers": Case(
        base(around(3), *(rim(f"wheel_{k}", 0.045, 0.5 * math.pi) for k in range(3))),
        "omnidirectional",
        ("wheel_0", "wheel_1", "wheel_2"),
        stand=rollers(("wheel_0", "wheel_1", "wheel_2")),
    ),
    "mecanum wheels with rollers": Case(
        base(corners(), *(rim(name, 0.09, 0.25 * math.pi) for name in all_corners())),
        "mecanum",
        all_corners(),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.4},
        stand=rollers(all_corners()),
    ),
    "mecanum by name": Case(
        base(corners("{}_mecanum_wheel")),
        "mecanum",
        all_corners("{}_mecanum_wheel"),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.4},
    ),
    "mecanum by friction": Case(marked(base(corners()), FREE_ASIDE), "mecanum", all_corners()),
    "mecanum by a plugin": Case(
        marked(
            base(corners()),
            '<gazebo><plugin name="drive" filename="libgazebo_ros_mecanum_drive.so"/></gazebo>',
        ),
        "mecanum",
        all_corners(),
    ),
    # Several axles.
    "corners": Case(
        base(corners("{}")),
        "skid_steer",
        all_corners("{}"),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.4},
    ),
    "corners whose tyres are outside": Case(
        base(
            *(
                turns(
                    f"{name}_wheel",
                    "base_link",
                    f"{x} {y} 0.1",
                    LEFT,
                    body=tyre(beside=math.copysign(0.05, y)),
                )
                for name, (x, y) in CORNERS.items()
            )
        ),
        "skid_steer",
        all_corners(),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.5},
    ),
    "tracks with idlers": Case(
        base(TRACKS),
        "skid_steer",
        tuple(f"{side}_wheel_{k}" for side in ("left", "right") for k in range(3)),
        lengths={"radius": 0.1, "length": 0.6, "width": 0.5},
    ),
    # One axle.
    "no wheel by name": Case(
        base(wheel("j1", "base_link", "0 0.2 0.1"), wheel("j2", "base_link", "0 -0.2 0.1", "0 -1 0")),
        "unicycle",
        ("j1", "j2"),
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
    ),
    "tyres beside their joints": Case(
        base(
            *(
                turns(f"{side}_wheel", "base_link", f"0 {way * 0.25} 0.1", LEFT, body=tyre(beside=0.03 * way))
                for side, way in (("left", 1), ("right", -1))
            )
        ),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.56},
        "differential",
    ),
    "casters without swivels": Case(
        base(
            pair(),
            *(
                wheel(f"{end}_caster", "base_link", f"{x} 0 0.05", radius=0.05)
                for end, x in (("front", 0.3), ("rear", -0.3))
            ),
        ),
        "unicycle",
        DRIVE,
    ),
    "the root off the axle": Case(
        base(pair(-0.3)), "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4}, "differential"
    ),
    "along y, left at -x": Case(
        base(
            wheel("left_wheel", "base_link", "-0.2 0 0.1", "-1 0 0"),
            wheel("right_wheel", "base_link", "0.2 0 0.1", "-1 0 0"),
        ),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
    ),
    "along y, left at +x": Case(
        base(
            wheel("left_wheel", "base_link", "0.2 0.1 0.1", "1 0 0"),
            wheel("right_wheel", "base_link", "-0.2 0.1 0.1", "1 0 0"),
        ),
        "unicycle",
        DRIVE,
        {},
        {"radius": 0.1, "track": 0.4},
        "differential",
    ),
    "along y, by axle": Case(
        base(
            wheel("left_wheel", "base_link", "-0.2 0.1 0.1", "-1 0 0"),
            wheel("right_wheel", "base_link", "0.2 0.1 0.1", "-1 0 0"),
        ),
        "unicycle",
        DRIVE,
        options={"axle": [0.0, 0.1, 0.0, 0.5 * math.pi]},
    ),
    "a wheel at the arm's end": Case(
        base(pair(), POLISHER), "unicycle", DRIVE, arm=("flip", "polishing_wheel")
    ),
    "a turret with a camera and a wheel": Case(
        base(pair(), TURRET), "unicycle", DRIVE, arm=("camera_turret", "camera_tilt", "focus_wheel")
    ),
    "wheels off the ground": Case(base(pair(), CLIMBING), "unicycle", DRIVE),
    "swivels behind": Case(base(pair(), SWIVELS), "unicycle", DRIVE),
}
