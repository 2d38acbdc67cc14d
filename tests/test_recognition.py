"""Which platform a file's wheels allow, against rolling without slip by Pinocchio's own reader of the file."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from findings import codes, of_code
from rolling_law import LEFT, UP, Rolling, base, slides, turns, tyre, wheel
from urdf_parts import write

import nmm

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
    slack : sideways speed for an input of 1, m/s
    """

    text: str
    kind: str
    fixed: tuple[str, ...] = ()
    steered: Mapping[str, str] = field(default_factory=dict)
    lengths: Mapping[str, float] = field(default_factory=dict)
    measured_as: str = ""
    stand: tuple[str, ...] = ()
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
        wheel(names.format(name), "base_link", f"{x} {y} 0.1", axis, **more) for name, (x, y) in CORNERS.items()
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
    "".join(
        wheel(f"{side}_wheel_{k}", "base_link", f"{x} {y} 0.1") for k, x in enumerate((-0.3, 0.0, 0.3))
    )
    + "".join(
        wheel(f"{side}_{end}_idler_wheel", "base_link", f"{x} {y} 0.2")
        for end, x in (("front", 0.5), ("rear", -0.5))
    )
    for side, y in (("left", 0.25), ("right", -0.25))
)
CABIN = turns("steering_wheel", "base_link", "0.4 0.2 0.9", "-0.6 0 0.8", body=tyre(0.15))
CLIMBING = "".join(wheel(f"{side}_climbing_wheel", "base_link", f"0.3 {y} 0.18") for side, y in (("left", 0.2), ("right", -0.2)))
SWIVELS = "".join(
    turns(f"caster_{side}", "base_link", f"-0.3 {y} 0.1", UP)
    + wheel(f"caster_{side}_wheel", f"caster_{side}_link", "-0.04 0 -0.05", radius=0.05)
    for side, y in (("left", 0.15), ("right", -0.15))
)
POLISHER = turns("flip", "hand_link", "0.2 0 0", UP, (-1.0, 1.0)).replace('parent link="hand_link"', 'parent link="hand"') + wheel(
    "polishing_wheel", "flip_link", "0.1 0 0", radius=0.03
)
TURRET = turns("camera_turret", "base_link", "0 0 0.4", UP, (-1.0, 1.0)) + (
    turns("camera_tilt", "camera_turret_link", "0 0 0.1", LEFT, (-0.5, 0.5))
    + wheel("focus_wheel", "camera_turret_link", "0.1 0 0", radius=0.02)
)

CASES = {
    # Springs, rockers, bogies and shocks stand still; what is below them are the wheels.
    "sprung": Case(
        base(SPRUNG), "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4}, "differential",
        ("left_suspension", "right_suspension"),
    ),
    "sprung, with casters": Case(base(SPRUNG, SWIVELS), "unicycle", DRIVE),
    "rockers": Case(
        base(ROCKERS), "skid_steer",
        lengths={"radius": 0.1, "length": 0.6, "width": 0.5}, stand=("left_rocker", "right_rocker"),
        fixed=tuple(f"{end}_{side}_wheel" for end in ("front", "rear") for side in ("left", "right")),
    ),
    "rockers and bogies": Case(
        base(BOGIES), "skid_steer", lengths={"radius": 0.1, "length": 0.8, "width": 0.5},
        stand=tuple(f"{side}_{part}" for side in ("left", "right") for part in ("rocker", "bogie")),
        fixed=tuple(f"{end}_{side}_wheel" for end in ("front", "middle", "rear") for side in ("left", "right")),
    ),
    "shocks above what steers": Case(
        base(pair(y=0.3), SHOCKS), "car", DRIVE, fronts("{}_knuckle"), {"wheelbase": 0.8},
        stand=("left_shock", "right_shock"),
    ),
    # Digits of real files.
    "3.14 about x": Case(
        base(
            wheel("left_wheel", "base_link", "0 0.2 0.1"),
            wheel("right_wheel", "base_link", "0 -0.2 0.1", "0 -1 0", rpy="3.14 0 0"),
        ),
        "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4}, "differential", slack=5e-3,
    ),
    "3.14 about z": Case(
        base(
            wheel("left_wheel", "base_link", "0 0.2 0.1"),
            wheel("right_wheel", "base_link", "0 -0.2 0.1", LEFT, rpy="0 0 3.14"),
        ),
        "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4}, "differential", slack=5e-3,
    ),
    "a pair that is 3 mm from even": Case(
        base(
            wheel("left_wheel", "base_link", "0.0015 0.2015 0.1"),
            wheel("right_wheel", "base_link", "-0.0015 -0.2 0.1"),
        ),
        "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4015}, "differential", slack=5e-3,
    ),
    # Cars, whatever their joints are called, wherever their root is.
    "a car from its middle": Case(
        base(pair(-0.5, 0.3, "rear_{}_wheel"), front(0.5, 0.3)), "car",
        ("rear_left_wheel", "rear_right_wheel"), fronts(), {"wheelbase": 1.0},
    ),
    "a car whose hubs steer": Case(
        base(pair(0.0, 0.3), front(1.0, 0.3, "front_{}_hub")), "car", DRIVE, fronts("front_{}_hub"),
        {"wheelbase": 1.0},
    ),
    "a tricycle whose column is called nothing": Case(
        base(pair(-0.2, 0.3), steered(0.4, 0.0, "j7", "nose_wheel")), "car", DRIVE, {"nose_wheel": "j7"},
        {"wheelbase": 0.6},
    ),
    "a tricycle whose column points down": Case(
        base(pair(0.0, 0.3), steered(0.7, 0.0, "fork", "nose_wheel", (-0.5, 0.5), upright="0 0 -1")), "car",
        DRIVE, {"nose_wheel": "fork"}, {"wheelbase": 0.7},
    ),
    "kingpins that lean": Case(
        base(
            pair(0.0, 0.3),
            steered(0.9, 0.25, "left_pin", "front_left_wheel", upright="0 -0.1 0.995", at="0 0 0"),
            steered(0.9, -0.25, "right_pin", "front_right_wheel", upright="0 0.1 0.995", at="0 0 0"),
        ),
        "car", DRIVE, fronts("{}_pin"), {"wheelbase": 0.9}, slack=5e-3,
    ),
    "a car with a steering wheel in its cabin": Case(
        base(pair(0.0, 0.3), front(0.9, 0.3), CABIN), "car", DRIVE, fronts(), {"wheelbase": 0.9}
    ),
    "columns that are given": Case(
        base(pair(0.0, 0.3), front(0.9, 0.3, "{}_column", ends=None)), "car", DRIVE, fronts("{}_column"),
        {"wheelbase": 0.9}, options={"steer": ["left_column", "right_column"]},
    ),
    "the same, not given": Case(
        base(pair(0.0, 0.3), front(0.9, 0.3, "{}_column", ends=None)), "unicycle", DRIVE
    ),
    "a tricycle steered behind": Case(
        base(pair(0.0, 0.3), steered(-0.8, 0.0, "tail_pivot", "tail_wheel")), "wheeled", DRIVE,
        {"tail_wheel": "tail_pivot"},
    ),
    "a pair steered behind": Case(
        base(pair(0.0, 0.3), front(-0.8, 0.3, "rear_{}_pivot")), "wheeled", DRIVE,
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
        base(casters("caster_joint_{}")), "mecanum", all_corners(),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.4},
        options={"lock": {"caster_joint_*": 0.0}, "platform": "mecanum"},
    ),
    "modules of a swerve drive": Case(base(casters("{}_module")), "omnidirectional", (), on_pivots("{}_module")),
    "driven casters": Case(
        base(casters("{}_rotation", trail=0.03)), "omnidirectional", (), on_pivots("{}_rotation")
    ),
    "a base on a turning joint, on balls of two": Case(
        module(2), "omnidirectional", (), dict.fromkeys(("left_drive_wheel", "right_drive_wheel"), "base_roll_joint"),
        stand=("passive_wheel_0", "passive_wheel_1"),
    ),
    "a base on a turning joint, on balls of three": Case(
        module(3), "omnidirectional", (), dict.fromkeys(("left_drive_wheel", "right_drive_wheel"), "base_roll_joint"),
        stand=("passive_wheel_0", "passive_wheel_1", "passive_wheel_2"),
    ),
    "three wheels whose axes meet": Case(base(around(3)), "omnidirectional", ("wheel_0", "wheel_1", "wheel_2")),
    "four whose axes meet": Case(base(around(4)), "omnidirectional", tuple(f"wheel_{k}" for k in range(4))),
    "omni wheels with rollers": Case(
        base(around(3), *(rim(f"wheel_{k}", 0.045, 0.5 * math.pi) for k in range(3))), "omnidirectional",
        ("wheel_0", "wheel_1", "wheel_2"), stand=rollers(("wheel_0", "wheel_1", "wheel_2")),
    ),
    "mecanum wheels with rollers": Case(
        base(corners(), *(rim(name, 0.09, 0.25 * math.pi) for name in all_corners())), "mecanum", all_corners(),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.4}, stand=rollers(all_corners()),
    ),
    "mecanum by name": Case(
        base(corners("{}_mecanum_wheel")), "mecanum", all_corners("{}_mecanum_wheel"),
        lengths={"radius": 0.1, "length": 0.5, "width": 0.4},
    ),
    "mecanum by friction": Case(marked(base(corners()), FREE_ASIDE), "mecanum", all_corners()),
    "mecanum by a plugin": Case(
        marked(
            base(corners()),
            '<gazebo><plugin name="drive" filename="libgazebo_ros_mecanum_drive.so"/></gazebo>',
        ),
        "mecanum", all_corners(),
    ),
    # Several axles.
    "corners": Case(
        base(corners("{}")), "skid_steer", all_corners("{}"), lengths={"radius": 0.1, "length": 0.5, "width": 0.4}
    ),
    "corners whose tyres are outside": Case(
        base(
            *(
                turns(f"{name}_wheel", "base_link", f"{x} {y} 0.1", LEFT, body=tyre(beside=math.copysign(0.05, y)))
                for name, (x, y) in CORNERS.items()
            )
        ),
        "skid_steer", all_corners(), lengths={"radius": 0.1, "length": 0.5, "width": 0.5},
    ),
    "tracks with idlers": Case(
        base(TRACKS), "skid_steer", tuple(f"{side}_wheel_{k}" for side in ("left", "right") for k in range(3)),
        lengths={"radius": 0.1, "length": 0.6, "width": 0.5},
    ),
    # One axle.
    "no wheel by name": Case(
        base(wheel("j1", "base_link", "0 0.2 0.1"), wheel("j2", "base_link", "0 -0.2 0.1", "0 -1 0")),
        "unicycle", ("j1", "j2"), {}, {"radius": 0.1, "track": 0.4}, "differential",
    ),
    "tyres beside their joints": Case(
        base(
            *(
                turns(f"{side}_wheel", "base_link", f"0 {way * 0.25} 0.1", LEFT, body=tyre(beside=0.03 * way))
                for side, way in (("left", 1), ("right", -1))
            )
        ),
        "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.56}, "differential",
    ),
    "casters without swivels": Case(
        base(
            pair(),
            *(wheel(f"{end}_caster", "base_link", f"{x} 0 0.05", radius=0.05) for end, x in (("front", 0.3), ("rear", -0.3))),
        ),
        "unicycle", DRIVE,
    ),
    "the root off the axle": Case(
        base(pair(-0.3)), "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4}, "differential"
    ),
    "along y, left at -x": Case(
        base(
            wheel("left_wheel", "base_link", "-0.2 0 0.1", "-1 0 0"),
            wheel("right_wheel", "base_link", "0.2 0 0.1", "-1 0 0"),
        ),
        "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4}, "differential",
    ),
    "along y, left at +x": Case(
        base(
            wheel("left_wheel", "base_link", "0.2 0.1 0.1", "1 0 0"),
            wheel("right_wheel", "base_link", "-0.2 0.1 0.1", "1 0 0"),
        ),
        "unicycle", DRIVE, {}, {"radius": 0.1, "track": 0.4}, "differential",
    ),
    "along y, by axle": Case(
        base(
            wheel("left_wheel", "base_link", "-0.2 0.1 0.1", "-1 0 0"),
            wheel("right_wheel", "base_link", "0.2 0.1 0.1", "-1 0 0"),
        ),
        "unicycle", DRIVE, options={"axle": [0.0, 0.1, 0.0, 0.5 * math.pi]},
    ),
    "a wheel at the arm's end": Case(
        base(pair(), POLISHER), "unicycle", DRIVE
    ),
    "a turret with a camera and a wheel": Case(base(pair(), TURRET), "unicycle", DRIVE),
    "wheels off the ground": Case(base(pair(), CLIMBING), "unicycle", DRIVE),
    "swivels behind": Case(base(pair(), SWIVELS), "unicycle", DRIVE),
}  # fmt: skip


def loaded(tmp_path: Path, case: Case, **more: Any) -> nmm.Robot:
    return nmm.load(write(tmp_path / "robot.urdf", case.text), **{**case.options, **more})


def twists(robot: nmm.Robot, q: np.ndarray) -> np.ndarray:
    """(3, p) The twists of the file's root link, on its own axes, for inputs of 1."""
    data, found = robot.model.createData(), []
    frame = robot.model.getFrameId("base_link", pin.FrameType.BODY)
    for u in np.eye(robot.n_u)[: robot.platform.p]:
        pin.forwardKinematics(robot.model, data, q, robot.S(q) @ u)
        motion = pin.getFrameVelocity(robot.model, data, frame, pin.ReferenceFrame.LOCAL)
        assert abs(motion.linear[2]) < 1e-12 and abs(motion.angular[:2]).max() < 1e-12
        found.append([*motion.linear[:2], motion.angular[2]])
    return np.array(found).T


def postures(robot: nmm.Robot, case: Case, law: Rolling) -> list[np.ndarray]:
    """At rest and at two angles of what steers, turned in the world; of several steered wheels such that all
    roll about one point."""
    found = [robot.q({"x": 0.3, "theta": 0.4})]
    own = [name for name in robot.q_names[3 : robot.platform.n_p]]
    if len(own) > 1:
        middle = np.mean([0.0 if not case.fixed else law.centre(name) for name in case.fixed or ("",)])
        for turn in (0.3, -0.2):
            twist = np.array([1.0 + turn * complex(middle).imag, -turn * complex(middle).real, turn])
            angles = {
                pivot: law.pointed(name, pivot, twist) * law.sign(pivot)
                for name, pivot in case.steered.items()
            }
            found.append(robot.q({"theta": -1.0, **angles}))
    elif own:
        found += [robot.q({"theta": -1.0, own[0]: angle}) for angle in (0.3, -0.2)]
    return found


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_platform_is_what_the_wheels_allow(tmp_path: Path, case: Case) -> None:
    robot, law = loaded(tmp_path, case), Rolling(case.text)
    assert robot.platform.name == case.kind
    assert {wheel.joint for wheel in robot.wheels} >= {*case.fixed, *case.steered}
    names = {str(name) for name in robot.display_model.names}
    assert not {*case.stand} & (names | {*robot.q_names})
    arm = {"pan", "lift"} | ({"flip", "polishing_wheel"} if "flip" in case.text else set())
    arm |= {"camera_turret", "camera_tilt", "focus_wheel"} if "turret_link" in case.text else set()
    arm |= {"steering_wheel"} if "cabin" in case.text or 'name="steering_wheel"' in case.text else set()
    assert {*robot.q_names[robot.platform.n_p :]} == arm
    shown = loaded(tmp_path, case, platform=case.measured_as) if case.measured_as else robot
    lengths = shown.platform.lengths
    assert {name: lengths[name] for name in case.lengths} == pytest.approx(dict(case.lengths), abs=1e-9)
    for q in postures(robot, case, law):
        follows(robot, q, case, law)


def follows(robot: nmm.Robot, q: np.ndarray, case: Case, law: Rolling) -> None:
    """The law of the kind, at q."""
    moves, platform = twists(robot, q), robot.platform
    fixed = np.array([law.row(name, {}) for name in case.fixed]).reshape(-1, 3)
    if case.kind in ("omnidirectional", "mecanum"):
        assert np.linalg.matrix_rank(moves) == 3
        if case.fixed and case.kind == "omnidirectional":
            # Without rollers it could turn in place at most; their own turns tell every motion.
            along = [np.cross([0, 0, 1.0], [*row[:2], 0.0])[:2] for row in fixed]
            rows = [
                [*way, way @ [-law.centre(name).imag, law.centre(name).real]]
                for name, way in zip(case.fixed, along, strict=True)
            ]
            assert np.linalg.matrix_rank(fixed, tol=1e-6) == 2
            assert np.linalg.matrix_rank(rows, tol=1e-6) == 3
        for name, pivot in case.steered.items():
            for twist in moves.T:
                trails = abs(law.row(name, {}, [pivot])[3]) > 1e-6
                angle = 0.0 if trails else law.pointed(name, pivot, twist)
                assert trails or abs(law.row(name, {pivot: angle}) @ twist) < 1e-9
                assert np.ptp(law.ends(pivot)) > math.pi
        return
    if case.kind == "skid_steer":
        # Without slip they roll straight ahead at most.
        assert np.linalg.matrix_rank(fixed, tol=1e-6) == 2
        straight = moves @ np.ones(platform.p)
        assert np.abs(fixed @ straight).max() < case.slack and np.linalg.norm(straight) > 1e-3
        return
    own = [name for name in robot.q_names[3 : platform.n_p] if law.model.existJointName(name)]
    rates = robot.S(q)[3 : platform.n_p, : platform.p]
    rates = np.array([rate * law.sign(name) for name, rate in zip(own, rates, strict=False)])
    rates = rates.reshape(len(own), platform.p)
    angles = {name: float(q[robot.coordinate(name)]) * law.sign(name) for name in own}
    rows = [law.row(name, {}, own) for name in case.fixed]
    fastest = moves[:, np.abs(moves).max(axis=0).argmax()]
    for name, pivot in case.steered.items():
        at = angles if pivot in own else {pivot: law.pointed(name, pivot, fastest)}
        lower, upper = law.ends(pivot)
        assert lower <= at[pivot] <= upper
        rows.append(law.row(name, at, own))
    sideways = np.array(rows) @ np.vstack([moves, rates])
    assert np.abs(sideways).max() < case.slack
    if case.slack == 1e-9:
        # The body's motions, and the ways in which the point about which all roll can be moved.
        free = 3 - np.linalg.matrix_rank(np.array(rows)[:, :3], tol=1e-6)
        ways = 2 - (np.linalg.matrix_rank(fixed, tol=1e-6) if len(fixed) else 0)
        assert platform.p == free + min(len({*case.steered.values()}), ways)
    if case.kind == "car" and not own:  # the angle of a wheel midway (Ackermann)
        steer = q[robot.coordinate("steer")]
        if steer:
            ways = [
                law.row(name, {pivot: law.pointed(name, pivot, fastest)}) for name, pivot in case.steered.items()
            ]
            middle = np.mean([-row[1] / row[0] for row in ways])
            assert middle == pytest.approx(1.0 / math.tan(steer), rel=max(case.slack, 1e-9))
