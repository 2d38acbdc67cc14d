"""The words of what is found in a robot's file and in loading it: an example of each code."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from places import ROOT

from nmm.base.errors import RobotError
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import WORDS as FILE
from nmm.base.findings.robot_file import refusal
from nmm.base.findings.robot_loading import WORDS as LOADING

#: By code: values, where, and the sentence.
EXAMPLES: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "file_empty": ({}, {}, "the file is empty"),
    "file_unreadable": ({"reason": "Permission denied"}, {}, "cannot be read (Permission denied)"),
    "not_text": ({}, {"line": 2}, "not UTF-8 text"),
    "not_xml": (
        {"reason": "mismatched tag"},
        {"file": "part.xacro", "line": 3},
        "in part.xacro:3: not well-formed XML: mismatched tag",
    ),
    "doctype": ({}, {"line": 1}, "holds a DOCTYPE, which is refused (entities are not expanded)"),
    "nested_too_deep": ({"most": 200}, {"line": 9}, "elements stand more than 200 deep in one another"),
    "not_robot": (
        {"got": "sdf"},
        {"line": 1},
        "expected <robot> (URDF) or <mujoco> (MJCF) as the root element, got <sdf>",
    ),
    "found_nearby": (
        {"count": 3, "name": "package://p/m.stl", "place": "/robots/m.stl"},
        {},
        "package://p/m.stl leads nowhere, and was found near the file, at /robots/m.stl; so were 2 others",
    ),
    "xacro_left_over": (
        {"element": "xacro:grey"},
        {"line": 2},
        "<xacro:grey/> is left over from xacro: left out",
    ),
    "leader_unknown": (
        {"leader": "i"},
        {"joint": "k", "line": 2},
        "joint 'k': follows 'i', which is no joint: it moves by itself, with its own input",
    ),
    "faults_spared": (
        {"count": 3, "first": "joint 'k': <limit> has no effort"},
        {},
        "3 faults that kinematics does not feel, first: joint 'k': <limit> has no effort (all: nmm check)",
    ),
    "only_macros": (
        {"name": "arm.xacro", "macros": {"xacro:arm": "length", "hand": ""}},
        {},
        (
            "holds no robot, only macros: xacro:arm (length); hand (no parameters); write a .xacro "
            "file that includes it and calls one: <xacro:include filename='arm.xacro'/> <xacro:arm "
            ".../>"
        ),
    ),
    "macro_parameters_missing": (
        {"macro": "arm", "missing": ["length", "mass"], "name": "arm.xacro"},
        {},
        "holds no robot but one macro, arm, whose parameters length, mass have no default: -a length=VALUE "
        "-a mass=VALUE",
    ),
    "mjcf_unread": (
        {"what": "<replicate>"},
        {"line": 3},
        "<replicate> is not understood, so nothing is read",
    ),
    "mjcf_included_twice": ({}, {"file": "a.xml"}, "in a.xml: included twice"),
    "mjcf_several_trees": (
        {"names": ["a", "b"]},
        {},
        "expected one robot, found 2 bodies of the world that move: a, b",
    ),
    "mjcf_left_out": (
        {
            "names": ["body table", "shape ellipsoid"],
            "lines": {"body table": 3, "shape ellipsoid": "a.xml:5"},
        },
        {"line": 3},
        "left out of the MJCF file: body table (line 3), shape ellipsoid (a.xml:5)",
    ),
    "mjcf_noted": (
        {"why": "tendons couple no joints", "names": ["<fixed>"], "lines": {"<fixed>": 7}},
        {"line": 7},
        "MJCF: <fixed> (line 7): tendons couple no joints",
    ),
    "mjcf_keyframe": (
        {"name": "home", "size": 9, "got": 7},
        {"line": 4},
        "keyframe 'home' has 7 numbers as qpos, the robot has 9: left out",
    ),
    "mjcf_speeds": (
        {"limits": {"wheel": 10.0}},
        {"line": 4},
        "velocities are limited by what actuators may ask for: wheel 10 (rad/s, m/s)",
    ),
    "mjcf_efforts": (
        {"limits": {"q1": 5.0}},
        {"line": 4},
        "efforts are limited by what actuators give: q1 5 (Nm, N)",
    ),
    "mjcf_controls": (
        {"ranges": {"q1": [-1.0, 0.5]}},
        {"line": 4},
        "actuators ask for less than the joints' limits, which are kept: q1 from -1 to 0.5",
    ),
    "xacro_failed": ({"reason": "division by zero"}, {}, "xacro: division by zero"),
    "xacro_untrusted": (
        {"what": ".upper of a str"},
        {"line": 3},
        "xacro: .upper of a str: expected arithmetic, xacro's functions, the robot's own files; if you trust "
        "the author: --trust (trust=True)",
    ),
    "xacro_argument_missing": (
        {"name": "l1"},
        {},
        "xacro argument 'l1' has no default and was not given a value",
    ),
    "beyond_bound": (
        {"what": "links", "most": 10_000},
        {},
        "more than 10,000 links: no robot needs as many",
    ),
    "xacro_endless": (
        {},
        {},
        "xacro: files or macros too deep in one another (does one include or call itself?)",
    ),
    "xacro_warned": (
        {"text": "warning: redefining global symbol: pi"},
        {},
        "xacro warning: redefining global symbol: pi",
    ),
    "package_missing": (
        {"package": "p", "by": "package://p", "searched": ["/a", "/b"]},
        {},
        (
            "package://p: package 'p' not found (give its folder in package_dirs, --package-dir); "
            "looked in /a, /b"
        ),
    ),
    "refused": (
        {"text": "platform car expects a steering joint"},
        {},
        "platform car expects a steering joint",
    ),
    "library_failed": (
        {"error": "ValueError", "reason": "no such thing"},
        {},
        "cannot be loaded: ValueError: no such thing",
    ),
    "version_unknown": ({"got": "2.0"}, {"line": 1}, "<robot> version: expected 1.0, 1.1 or 1.2, got '2.0'"),
    "no_links": ({}, {}, "no links (in MJCF: no bodies)"),
    "name_missing": ({"kind": "link"}, {"line": 4}, "a link without a name"),
    "name_twice": ({"kind": "link", "name": "c"}, {"line": 4}, "two links named 'c'"),
    "name_unknown": (
        {"kind": "parent link", "got": "uper", "available": ["base", "upper"]},
        {"line": 4, "joint": "elbow"},
        ("joint 'elbow': unknown parent link 'uper' (did you mean 'upper'?); available: base, upper"),
    ),
    "two_parents": ({"name": "c", "parents": ["a", "b"]}, {"line": 4}, "link 'c' has two parents: 'a', 'b'"),
    "cycle": ({"links": ["a", "b", "a"]}, {}, "the links form a cycle: a -> b -> a"),
    "several_roots": ({"roots": ["a", "b"]}, {}, "expected one root link, found two: a, b"),
    "mimic_cycle": (
        {"joints": ["j", "k", "j"]},
        {"line": 4, "joint": "j"},
        "joint 'j': <mimic> follows itself: j -> k -> j",
    ),
    "platform_twice": ({}, {"line": 4, "part": "robot"}, "robot: a second <nmm>, expected one"),
    "element_missing": (
        {"element": "inertial", "missing": "mass"},
        {"line": 4, "link": "a"},
        "link 'a': <inertial> has no <mass>",
    ),
    "attribute_missing": (
        {"element": "box", "attribute": "size"},
        {"line": 4, "link": "a", "part": "visual"},
        "link 'a', visual: <box> has no size",
    ),
    "not_numbers": (
        {"element": "axis", "attribute": "xyz", "count": 3, "got": "0 0 z"},
        {"line": 4, "joint": "j"},
        "joint 'j': <axis> xyz: expected 3 finite numbers, got '0 0 z'",
    ),
    "below_minimum": (
        {"element": "limit", "attribute": "effort", "minimum": 0.0, "got": -1.5},
        {"line": 4, "joint": "j"},
        "joint 'j': <limit> effort: expected 0 or more, got -1.5",
    ),
    "negative_length": (
        {"element": "sphere", "attribute": "radius", "got": "-1"},
        {"line": 4, "link": "a", "part": "collision"},
        "link 'a', collision: <sphere> radius: expected lengths of 0 or more (m), got '-1'",
    ),
    "colour_beyond": (
        {"got": "255 0 0 1"},
        {"line": 4, "part": "robot"},
        "robot: <color> rgba: expected numbers from 0 to 1, got '255 0 0 1'",
    ),
    "shape_missing": (
        {"available": ["box", "sphere"]},
        {"line": 4, "link": "a", "part": "visual"},
        "link 'a', visual: no shape (expected <geometry> with one of box, sphere)",
    ),
    "mesh_missing": (
        {"mesh": "m.stl", "cause": "file", "shape": "refused"},
        {"line": 4},
        "mesh 'm.stl': no such file: refused unless missing_meshes='skip' (--missing-meshes skip)",
    ),
    "mesh_unreadable": (
        {"mesh": "/m.stl", "reason": "no triangles"},
        {"link": "a"},
        "link 'a': mesh /m.stl cannot be read: no triangles",
    ),
    "mesh_format_unknown": (
        {"mesh": "m.step", "available": [".obj", ".stl"]},
        {"line": 4, "link": "a", "part": "visual"},
        "link 'a', visual: mesh 'm.step': unknown format, expected .obj, .stl",
    ),
    "joint_type_missing": (
        {"available": ["revolute", "fixed"]},
        {"line": 4, "joint": "j"},
        "joint 'j': no type, expected one of revolute, fixed",
    ),
    "joint_helical": (
        {"kind": "screw", "available": ["revolute", "fixed"]},
        {"line": 4, "joint": "j"},
        ("joint 'j': a screw joint is refused: it turns and slides at once; expected one of revolute, fixed"),
    ),
    "base_inside_tree": (
        {"kind": "planar"},
        {"line": 4, "joint": "j"},
        (
            "joint 'j': a planar joint is refused inside the tree: it stands for the platform's x, y "
            "and theta only where it is the one movable joint on the root link's body"
        ),
    ),
    "base_tilted": (
        {"axis": [0.0, 1.0, 0.5]},
        {"line": 4, "joint": "j"},
        "joint 'j': <axis> of a planar joint: expected it upright, 0 0 1, got 0 1 0.5",
    ),
    "axis_zero": ({"got": "0 0 0"}, {"line": 4, "joint": "j"}, "joint 'j': <axis> xyz is zero: '0 0 0'"),
    "limit_missing": (
        {"kind": "revolute"},
        {"line": 4, "joint": "j"},
        "joint 'j': a revolute joint needs a <limit>, this one has none",
    ),
    "limits_crossed": (
        {"lower": 2.0, "upper": -2.0},
        {"line": 4, "joint": "j"},
        "joint 'j': <limit> lower 2 is above upper -2",
    ),
    "dynamics_empty": (
        {},
        {"line": 4, "joint": "j"},
        "joint 'j': <dynamics> has neither damping nor friction",
    ),
    "mass_large": ({"mass": 5000.0}, {"line": 4, "link": "a"}, "link 'a': a mass of 5000 kg: is that meant?"),
    "mass_missing": ({}, {"line": 4, "link": "a"}, "link 'a': no mass, but moments of inertia"),
    "inertia_missing": (
        {"mass": 2.0},
        {"line": 4, "link": "a"},
        "link 'a': a mass of 2 kg, but no moments of inertia",
    ),
    "inertia_indefinite": (
        {"moments": [-1.0, 1.0, 2.0]},
        {"line": 4, "link": "a"},
        "link 'a': inertia is not positive definite: principal moments -1, 1, 2 kg m^2",
    ),
    "inertia_impossible": (
        {"moments": [1.0, 1.0, 3.0]},
        {"line": 4, "link": "a"},
        (
            "link 'a': no body has this inertia: of the principal moments 1, 1, 3 kg m^2 the largest "
            "is above the sum of the others"
        ),
    ),
    "body_without_mass": (
        {"moved_by": "j", "inertial": False},
        {"line": 4, "link": "a"},
        (
            "link 'a': moves with joint 'j' and has no <inertial>, nor has any link fixed to it: "
            "dynamics and centre of mass leave it out"
        ),
    ),
    "velocity_unlimited": (
        {},
        {"line": 4, "joint": "j"},
        "joint 'j': no <limit>, so no limit of its velocity",
    ),
    "velocity_zero": (
        {},
        {"line": 4, "joint": "j"},
        "joint 'j': <limit> velocity is 0, which is taken as no limit",
    ),
    "joint_held": (
        {"value": 0.0},
        {"line": 4, "joint": "j"},
        "joint 'j': <limit> lets it stand at 0 only (both ends are 0 unless given)",
    ),
    "limits_large": (
        {"lower": -100.0, "upper": 230.0},
        {"line": 4, "joint": "j"},
        "joint 'j': <limit> from -100 to 230 rad: degrees?",
    ),
    "rpy_large": (
        {"rpy": [90.0, 0.0, 0.0]},
        {"line": 4, "link": "a", "part": "visual"},
        "link 'a', visual: <origin> rpy 90 0 0 rad: degrees?",
    ),
    "name_shared": (
        {},
        {"line": 4, "joint": "j"},
        "joint 'j': a link has that name, too: as a frame, it means the link",
    ),
    "root_replaced": (
        {"name": "root_joint", "kind": "FreeFlyer"},
        {},
        "root joint root_joint (FreeFlyer) replaced by x, y, theta",
    ),
    "continuous_joints": ({"names": ["a", "b"]}, {}, "continuous joints as one unbounded angle each: a, b"),
    "joint_added": (
        {"name": "steering"},
        {},
        (
            "steering is no joint of the file: the angle of a wheel midway between those that steer, "
            "which follow it (Ackermann)"
        ),
    ),
    "joints_reversed": (
        {"names": ["steer"]},
        {},
        "axes that point down turned upwards, since a platform's angles count to the left: steer; angles and "
        "limits have the other sign",
    ),
    "calibrated": (
        {"numbers": {"track": [0.5, 0.56], "offset.steering": [0.0, -0.02]}},
        {},
        "not as its file says: track 0.56 (file: 0.5), offset.steering -0.02 (file: 0)",
    ),
    "reference_moved": (
        {"at": [-0.25, 0.0, 0.0], "yaw": 1.5},
        {},
        "the platform's reference point is at (-0.25, 0, 0) m in the root link, turned by 1.5 rad",
    ),
    "joints_locked": ({"values": {"head": 0.3, "torso": 0.0}}, {}, "locked joints: head at 0.3, torso at 0"),
    "mimics_locked": (
        {"values": {"finger": ["thumb", -0.25]}},
        {},
        "locked with the joint that they follow: finger at -0.25 (follows thumb)",
    ),
    "mimic_joints": (
        {"names": ["k = -0.5 j"]},
        {"arm": "ur5"},
        "ur5: joints that follow others, without an input: k = -0.5 j",
    ),
    "mimics_of_ground": (
        {"names": ["right_wheel"]},
        {},
        "turned by the ground, not by the joint that they follow: right_wheel",
    ),
    "wheels_left_out": (
        {"names": ["left_wheel", "right_wheel"]},
        {},
        "wheels that only roll, left out of q: left_wheel, right_wheel",
    ),
    "swivels_left_out": (
        {"names": ["caster"]},
        {},
        "joints that steer them or swivel, left out of q: caster",
    ),
    "wheels_held": ({"names": ["left_wheel"]}, {}, "wheels of a fixed base, which stand still: left_wheel"),
    "not_a_wheel": (
        {"name": "spare_wheel", "why": "axis_not_level"},
        {},
        "spare_wheel stays a coordinate in spite of its name: its axis is not level",
    ),
    "no_wheel": (
        {"name": "spare_wheel", "why": "joint_between", "between": "lift"},
        {},
        (
            "joint 'spare_wheel' is no wheel: another joint is between it and the root link (lift); "
            "lock that to make it one"
        ),
    ),
    "radius_unknown": (
        {"names": ["left_wheel", "right_wheel"]},
        {},
        "nothing tells the radius of wheels left_wheel, right_wheel: they stand still in playback, and limit "
        "no speed; give it, --wheels right_wheel=METRES,... (wheels={'right_wheel': ...})",
    ),
    "platform_recognized": (
        {"platform": "skid_steer", "why": "several_axles", "names": ["fl", "fr", "rl", "rr"]},
        {},
        "platform skid_steer by its wheels: fl, fr, rl, rr stand on several axles and do not steer, so that "
        'they slide in turns; with rollers: --platform mecanum (platform="mecanum")',
    ),
    "platform_unclear": (
        {
            "why": "not_parallel",
            "names": ["left", "right"],
            "commands": ["--platform omnidirectional", "--platform unicycle"],
        },
        {},
        "the wheels do not tell the platform: --platform omnidirectional or --platform unicycle? wheels that "
        "neither steer nor swivel are not parallel: left, right",
    ),
    "wheels_fixed": (
        {"names": ["left_wheel"]},
        {},
        "links that are called wheels do not turn in the file (left_wheel): its root is taken for a "
        "unicycle, --platform for another",
    ),
    "no_wheels": (
        {},
        {},
        "no wheels in the file: its root link is taken for a unicycle; --platform for another, --platform "
        "fixed for an arm that stands",
    ),
    "wheels_by_shape": ({"names": ["j1", "j2"]}, {}, "wheels by their shapes, not their names: j1, j2"),
    "steering_held": ({"names": ["left_hub"]}, {}, "they steer, and stand still at zero: left_hub"),
    "undercarriage_held": (
        {"values": {"left_spring": 0.0, "right_spring": 0.005}},
        {},
        "between the base and its wheels, standing still: left_spring at 0, right_spring at 0.005; --lock "
        "NAME=VALUE for another place",
    ),
    "tyre_unclear": (
        {"name": "left_wheel", "middles": [0.03, 0.0]},
        {},
        "the shapes of wheel 'left_wheel' disagree on the middle of its tyre, 30, 0 mm along its axis from "
        "the joint: the first counts",
    ),
    "no_arm": ({}, {}, "no arm: the platform is all that moves"),
    "nothing_moves": ({}, {}, "nothing moves"),
    "collision_pairs": ({"count": 10}, {}, "10 collision pairs: none within a body or across one joint"),
    "shapes_left_out": (
        {"names": ["package://p/m.stl"]},
        {},
        "shapes left out, their meshes are missing: package://p/m.stl",
    ),
    "turned_twice": (
        {},
        {"line": 4, "joint": "j"},
        "joint 'j': <origin> has both rpy and quat_xyzw, expected one of them",
    ),
    "quaternion_zero": (
        {},
        {"line": 4, "joint": "j"},
        "joint 'j': <origin> quat_xyzw is zero: no rotation has it",
    ),
    "element_unknown": (
        {"element": "limt", "inside": "joint", "near": "limit", "count": 3},
        {"line": 4},
        "<limt> in <joint> (3 times, first in line 4) is not known and does not count: did you mean limit?",
    ),
    "attribute_unknown": (
        {"element": "axis", "attribute": "rpy", "near": "", "count": 1},
        {"line": 4},
        "<axis> rpy (line 4) is not known and does not count",
    ),
    "element_unread": (
        {"element": "loop_joint", "inside": "robot", "why": "the loop stays open", "count": 2},
        {},
        "<loop_joint> (2 times) is not read: the loop stays open",
    ),
    "attribute_unread": (
        {"element": "limit", "attribute": "jerk", "why": "jerk is not limited", "count": 1},
        {"srdf": "a.srdf"},
        "SRDF a.srdf: <limit> jerk is not read: jerk is not limited",
    ),
    "element_again": (
        {"element": "limit", "inside": "joint", "count": 1},
        {"line": 4},
        "a further <limit> in one <joint> (line 4) does not count: the first does",
    ),
    "soft_limits": (
        {"limits": {"j": [-1.5, 2.0]}, "count": 1},
        {"line": 4},
        "soft limits of <safety_controller> (line 4) are not kept: j: [-1.5, 2]; they are where given as "
        "limits of position (Limits(position=...))",
    ),
    "limits_of_continuous": (
        {"names": ["j", "k"], "count": 2},
        {"line": 4},
        "<limit> lower and upper (2 times, first in line 4) do not count at continuous joints: j, k",
    ),
    "accelerations_of_file": (
        {"limits": {"j": 3.0, "k": 0.25}},
        {},
        "limits of acceleration in the file, which only Limits(acceleration=...) keeps, in scenarios limits: "
        "acceleration: j: 3, k: 0.25",
    ),
    "passive_held": (
        {"values": {"j": 0.0}},
        {"srdf": "a.srdf"},
        "SRDF a.srdf: joints without a motor have no input and are held: j at 0 (lock for another value)",
    ),
    "groups_without_inputs": (
        {"names": ["hand"]},
        {"srdf": "a.srdf"},
        "SRDF a.srdf: groups that move by no input: hand",
    ),
    "srdf_names_unknown": (
        {"names": ["lnk", "jnt"]},
        {"srdf": "a.srdf"},
        "SRDF a.srdf: no such links, joints or groups: lnk, jnt",
    ),
    "virtual_joint_unused": (
        {"name": "odom", "child": "hand"},
        {"srdf": "a.srdf"},
        "SRDF a.srdf: virtual joint odom does not count: hand is not the root link",
    ),
    "motion_model_differs": (
        {"name": "odom", "model": "holonomic", "platform": "unicycle"},
        {"srdf": "a.srdf"},
        "SRDF a.srdf: virtual joint odom has motion model holonomic, unlike platform unicycle",
    ),
    "posture_of_base": (
        {"posture": "home", "names": ["px", "py"]},
        {"srdf": "a.srdf"},
        "SRDF a.srdf: posture home: in place of px, py are x, y, theta: left out",
    ),
    "names_taken": (
        {"names": {"x": "x_joint", "v": "v_joint"}},
        {},
        "renamed, since the platform's coordinates or inputs have these names: x is x_joint, v is v_joint",
    ),
    "base_of_joints": (
        {"names": ["px", "py", "rz"], "platform": "omnidirectional", "limits": {}},
        {},
        (
            "px, py, rz move the whole robot without limits: a base of joints, in whose place is "
            "platform omnidirectional; platform fixed keeps them as coordinates"
        ),
    ),
    "gantry": (
        {"names": ["along", "across"]},
        {},
        "along, across slide all else and nothing turns it: a gantry, on platform fixed; --platform NAME "
        '(platform="NAME") puts it on another',
    ),
    "arm_mounted": (
        {"name": "ur5", "key": "ur5_2", "frame": "top", "base": "cart", "prefix": "ur5_2_"},
        {},
        "ur5 mounted as ur5_2 at top of cart, its names with the prefix ur5_2_",
    ),
    "mimic_limits_ignored": (
        {"mimic": "k = -j", "name": "k", "leader": "j", "lower": 0.0, "upper": 1.0},
        {},
        "k = -j: its limits, from 0 to 1, leave j no room and do not count",
    ),
    "slides_long": (
        {"rooms": {"root_x": 40.0, "root_y": 60.0}},
        {},
        "slides longer than an arm's: root_x (40 m), root_y (60 m); if they stand for a base that moves, "
        "hold them, --lock root_x=0 (lock={'root_x': 0})",
    ),
    "wheels_slide": (
        {"platform": "unicycle", "speeds": {"left": 0.2}, "several_axles": False},
        {},
        (
            "wheels slide sideways under platform unicycle: left (0.2 m/s for an input of 1); is its "
            "reference point on their axle? (axle, --axle X,Y)"
        ),
    ),
    "hitch_unused": (
        {"name": "hitch_1"},
        {},
        'hitch_1 carries wheels and is called a hitch: --platform tractor (platform="tractor") has its angle '
        "for a coordinate",
    ),
    "wheel_unnamed": (
        {"name": "left"},
        {},
        (
            "joint 'left' turns without end about a level axis, with nothing below it: if it is a "
            "wheel, say so with the others, --wheels left,... (wheels=['left', ...]); its name holds "
            'no "wheel"'
        ),
    ),
    "ground_uneven": (
        {"heights": {"left": -0.1, "caster": -0.108}, "near": 0.005},
        {},
        (
            "the wheels do not touch one level ground: left at z = -0.1 m, caster at z = -0.108 m; "
            "expected within 5 mm of each other. Heights or radii are wrong, or the robot stands "
            "tilted"
        ),
    ),
    "footprint_off_ground": (
        {"frame": "base_footprint", "off": -0.05},
        {},
        ("frame 'base_footprint' is 0.05 m below the ground that the wheels touch: a footprint is on it"),
    ),
    "platform_misfit": (
        {"platform": "car", "reason": "cart: platform car expects a steering joint"},
        {},
        "given by hand, and not what its file holds: cart: platform car expects a steering joint",
    ),
    "platform_length_differs": (
        {"platform": "car", "name": "wheelbase", "given": 0.5, "measured": 0.6},
        {},
        "platform car: wheelbase is 0.5 m as given, and 0.6 m in the file",
    ),
    "taken_for_casters": (
        {"names": ["left_turn", "right_turn"]},
        {},
        "each turns a wheel about an upright axis through it and is taken for a caster: left_turn, "
        "right_turn; if they steer: --steer left_turn,right_turn (steer=['left_turn', 'right_turn'])",
    ),
    "wheel_radius_differs": (
        {"name": "left", "given": 50.8, "measured": 0.0508},
        {},
        "radius of wheel 'left' is 50.8 m as given, and 0.0508 m in the file",
    ),
    "steering_too_narrow": (
        {"platform": "unicycle", "name": "steer", "lower": -45.0, "upper": 45.0},
        {},
        (
            "platform unicycle turns on the spot, for which the file's wheels would have to steer to "
            "90 degrees; steer ends at -45 and 45 degrees: platform car?"
        ),
    ),
    "moves_sideways": (
        {"platform": "omnidirectional", "wheels": "left at (0, 0.3) m, radius 0.1 m"},
        {},
        (
            "platform omnidirectional moves sideways, which needs three wheels with rollers or more; "
            "the file's main body stands on left at (0, 0.3) m, radius 0.1 m"
        ),
    ),
    "srdf_unused": (
        {"reason": {"text": "not UTF-8 text"}},
        {"srdf": "arm.srdf"},
        "SRDF arm.srdf: not used: not UTF-8 text",
    ),
    "not_srdf": ({"got": "robot"}, {}, "expected an SRDF (groups, states, pairs of links), this is a URDF"),
    "state_not_numbers": (
        {"name": "elbow", "got": "a b"},
        {"line": 4},
        "joint elbow: expected numbers, got 'a b'",
    ),
    "posture_joints_unknown": (
        {"posture": "home", "names": ["j", "k"]},
        {"srdf": "arm.srdf"},
        "SRDF arm.srdf: posture home: no such joints: j, k",
    ),
    "posture_not_one_number": (
        {"posture": "home", "name": "j", "count": 2},
        {"srdf": "arm.srdf"},
        "SRDF arm.srdf: posture home: j: expected one number, got 2: left out",
    ),
    "posture_locked": (
        {"posture": "home", "name": "j", "locked": 0.0, "wanted": 0.4},
        {"srdf": "arm.srdf"},
        "SRDF arm.srdf: posture home: j is locked at 0, not at 0.4",
    ),
    "posture_follows": (
        {"posture": "home", "name": "k", "leader": "j", "mimic": "k = -j", "wanted": 0.4},
        {"srdf": "arm.srdf"},
        "SRDF arm.srdf: posture home: k follows j (k = -j), not at 0.4",
    ),
    "posture_beyond": (
        {"posture": "up", "beyond": {"j": [99.0, -1.0, 1.0]}},
        {"srdf": "arm.srdf"},
        "SRDF arm.srdf: posture up is outside limits: j = 99 (from -1 to 1)",
    ),
}


def test_every_code_has_an_example() -> None:
    assert EXAMPLES.keys() == FILE.keys() | LOADING.keys()


@pytest.mark.parametrize("code", EXAMPLES)
def test_the_words_of_a_code(code: str) -> None:
    values, where, sentence = EXAMPLES[code]
    finding = Finding(code, values, where)
    assert str(finding) == sentence
    assert Finding.from_json(json.loads(json.dumps(finding.as_json()))) == finding


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"cause": "package", "package": "p"}, "package 'p' not found (give its folder in package_dirs, "
         "--package-dir)"),
        ({"cause": "file_in_package", "package": "p"}, "no such file in the package"),
        ({"cause": "scheme", "scheme": "https"}, "cannot read from https://"),
        ({"cause": "file", "shape": "left_out"}, "no such file; its shape is left out"),
    ],
)  # fmt: skip
def test_why_a_mesh_is_missing(given: dict[str, str], words: str) -> None:
    assert str(Finding("mesh_missing", {"mesh": "m", **given})) == f"mesh 'm': {words}"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"why": "not_turning"}, "it does not turn"),
        ({"why": "joint_below"}, "another joint is below it"),
        ({"why": "platforms_own"}, "it is the platform's own"),
        ({"why": "not_on_root"}, "another joint is between it and the root link"),
        (
            {"why": "swivel_carries_more", "swivel": "s", "other": "o"},
            "s, on which it would swivel, carries o too",
        ),
    ],
)
def test_why_a_joint_is_no_wheel(given: dict[str, str], words: str) -> None:
    assert str(Finding("no_wheel", {"name": "j", **given})) == f"joint 'j' is no wheel: {words}"


def test_other_words_of_the_same_codes() -> None:
    assert str(Finding("body_without_mass", {"moved_by": "j", "inertial": True})).startswith(
        "moves with joint 'j' and has no mass, nor"
    )
    slide = {"platform": "unicycle", "speeds": {"left": 0.2}, "several_axles": True}
    assert "skid_steer" in str(Finding("wheels_slide", slide))
    assert "--axle X,Y,Z,YAW" in str(Finding("wheels_slide", {**slide, "roll": "aside"}))
    assert "omnidirectional" in str(Finding("wheels_slide", {**slide, "roll": "apart"}))
    base = {"names": ["px"], "platform": "fixed"}
    assert str(Finding("base_of_joints", base)).endswith("a base of joints, coordinates like others")
    base = {"names": ["px", "rz"], "platform": "omnidirectional", "limits": {"px": [-2.0, 3.0]}}
    assert str(Finding("base_of_joints", base)) == (
        "px, rz move the whole robot: a base of joints, in whose place is platform omnidirectional, without "
        "their limits (px from -2 to 3); platform fixed keeps them as coordinates"
    )
    assert str(Finding("footprint_off_ground", {"frame": "f", "off": 0.05})).startswith(
        "frame 'f' is 0.05 m above the ground"
    )
    assert str(Finding("not_numbers", {"element": "mass", "attribute": "value", "count": 1, "got": "x"})) == (
        "<mass> value: expected a finite number, got 'x'"
    )


@pytest.mark.parametrize("why", ["axes_meet", "rollers", "driven_so", "hitched", "steered", "all_steered"])
def test_why_it_is_that_platform(why: str) -> None:
    sentence = str(Finding("platform_recognized", {"platform": "car", "why": why, "names": ["j"]}))
    assert sentence.startswith("platform car by its wheels: ")
    assert re.search(r"\bj\b", sentence)


UNCLEAR = ["on_swivels", "several_axles", "steered_otherwise", "size_unknown", "rollers_in_line"]


@pytest.mark.parametrize("why", UNCLEAR)
def test_why_it_is_no_platform(why: str) -> None:
    values = {"why": why, "names": ["j"], "commands": ["--platform car", "--platform unicycle"]}
    sentence = str(Finding("platform_unclear", values))
    assert sentence.startswith("the wheels do not tell the platform: --platform car or --platform unicycle? ")
    assert sentence.endswith(": j")


def test_lists_of_names_are_short() -> None:
    """A robot of 300 joints: ten of them, and how many more there are."""
    names = [f"joint_{i}_of_the_left_hand" for i in range(300)]
    for code in ("continuous_joints", "mimic_joints", "wheels_left_out", "shapes_left_out"):
        sentence = str(Finding(code, {"names": names}))
        assert sentence.endswith("joint_6_of_the_left_hand and 293 more")
        assert len(sentence) <= 300
    locked = str(Finding("joints_locked", {"values": dict.fromkeys(names, 0.0)}))
    assert locked.endswith("more")
    assert len(locked) <= 300


def test_folders_that_were_searched_are_named_in_full() -> None:
    """Paths of which the end is cut off look alike."""
    root = "/" + "deep/" * 40
    searched = [f"{root}{i}" for i in range(20)]
    found = Finding("package_missing", {"package": "pk", "by": "$(find pk)", "searched": searched})
    assert str(found).endswith(f"looked in {', '.join(searched)}")


def test_a_refusal_names_the_file_and_what_was_found_with_its_lines() -> None:
    found = [Finding("no_links"), Finding("axis_zero", {"got": "0 0 0"}, {"line": 4, "joint": "j"})]
    error = refusal("r.urdf", *found)
    assert (error.where, error.findings) == ("r.urdf", tuple(found))
    assert (
        str(error) == "r.urdf: no links (in MJCF: no bodies); line 4: joint 'j': <axis> xyz is zero: '0 0 0'"
    )
    assert "line" not in str(refusal("r.xacro", *found, lines=False))
    assert str(refusal("r.urdf", *found * 10)).endswith("and 8 more")
    outer = error.at("srdf")
    assert isinstance(outer, RobotError)
    assert (outer.where, outer.findings) == ("srdf: r.urdf", error.findings)


def test_every_code_is_documented() -> None:
    page = (ROOT / "docs/api/findings.md").read_text(encoding="utf-8")
    told = page.partition("## Of a robot")[2]
    assert [code for code in EXAMPLES if f"`{code}`" not in told] == []
