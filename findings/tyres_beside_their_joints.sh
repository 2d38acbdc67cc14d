#!/usr/bin/env bash
# The distance between the wheels is not the distance between the wheels' joints, and the collision shape can
# be no wheel.
#
# Expected: a wheel's joint is in the middle of its tyre, so the track of a robot is the distance of its two
# wheel joints.
#
# What happens, measured in the files that three makers publish: Upkie's joints are 92 mm further apart than
# its tyres. Stretch SE3's are 25 mm further apart. Stretch RE1 has its tyres on the joints; its collision
# shape is a cuboid 82 mm wide, of another radius. Vega's drive joints are 79 mm nearer to each other than its
# tyres, which stand on the steering pivots.
#
# For users: odometry by the joints' distance turns a quarter too little on Upkie. Measure the shapes, of the
# visual part where the collision shape is a cuboid, or give the track by hand. Versions: upkie-description
# 2.2.0, hello-robot-stretch-urdf 0.1.2, dexmate-urdf 0.8.4.
#
# Output:
#   Upkie, collision:       joints 396.8 mm apart, tyres 304.8; radius  50.0, width  40.0
#   Stretch RE1, visual:    joints 340.7 mm apart, tyres 340.7; radius  50.8, width  80.0
#   Stretch RE1, collision: joints 340.7 mm apart, tyres 260.7; radius  71.8, width  82.0
#   Stretch SE3, visual:    joints 340.7 mm apart, tyres 315.3; radius  50.8, width  80.0
#   Stretch SE3, collision: joints 340.7 mm apart, tyres 260.7; radius  71.8, width  82.0
#   Vega, collision:        joints 371.0 mm apart, tyres 449.9; radius  87.4, width  76.9
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q --no-deps upkie-description==2.2.0 hello-robot-stretch-urdf==0.1.2 dexmate-urdf==0.8.4 numpy==2.4.6
venv/bin/python - <<'END'
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np


def numbers(text, default):
    return np.array([float(one) for one in text.split()]) if text else np.array(default, float)


def pose(origin):
    """The 4 x 4 matrix of an <origin>."""
    made = np.eye(4)
    if origin is not None:
        (a, b, c), made[:3, 3] = numbers(origin.get("rpy"), [0] * 3), numbers(origin.get("xyz"), [0] * 3)
        x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        made[:3, :3] = z @ y @ x
    return made


def points(shape, folder):
    """Points of a cylinder or mesh (binary STL or OBJ), in its own frame."""
    if shape.tag == "cylinder":
        round_it, half = np.linspace(0, 2 * np.pi, 100), float(shape.get("length")) / 2
        ring = float(shape.get("radius")) * np.array([np.cos(round_it), np.sin(round_it)]).T
        return np.vstack([np.column_stack([ring, np.full(100, side)]) for side in (-half, half)])
    path = folder / shape.get("filename").split("package://")[-1].removeprefix("./")
    if path.suffix.lower() == ".stl":
        kind = np.dtype([("normal", "<3f4"), ("corners", "<(3,3)f4"), ("rest", "<u2")])
        return np.frombuffer(path.read_bytes()[84:], kind)["corners"].reshape(-1, 3).astype(float)
    return np.array([numbers(line[2:], None)[:3] for line in path.read_text().splitlines() if line.startswith("v ")])


def measure(urdf, folder, wheel, shaped, part):
    """Of a wheel's joint and shape: the joint's place across the robot, the middle of the shape's rim, its radius, its width."""
    tree = ET.parse(urdf).getroot()
    links = {one.get("name"): one for one in tree.findall("link")}
    above = {one.find("child").get("link"): one for one in tree.findall("joint")}

    def placed(link):
        joint = above.get(link)
        return np.eye(4) if joint is None else placed(joint.find("parent").get("link")) @ pose(joint.find("origin"))

    joint = next(one for one in above.values() if one.get("name") == wheel)
    at = placed(joint.find("child").get("link"))
    shape = links[shaped].find(part)
    frame = placed(shaped) @ pose(shape.find("origin"))
    where = points(shape.find("geometry")[0], folder) @ frame[:3, :3].T + frame[:3, 3]
    distance = np.hypot(where[:, 0] - at[0, 3], where[:, 2] - at[2, 3])
    rim = where[distance > 0.97 * distance.max(), 1]
    return at[1, 3], (rim.min() + rim.max()) / 2, distance.max(), np.ptp(where[:, 1])



here = next(Path("venv").glob("lib/python3*/site-packages"))
stretch, vega = here / "stretch_urdf", here / "dexmate_urdf/robots/humanoid/vega_1"
seen = []
for told, urdf, folder, wheel, shaped, part in (
    ("Upkie, collision", here / "upkie_description/urdf/upkie.urdf", here, "{}_wheel", "{}_wheel_tire", "collision"),
    ("Stretch RE1, visual", stretch / "RE1V0/stretch_description_RE1V0_tool_none.urdf", stretch / "RE1V0",
     "joint_{}_wheel", "link_{}_wheel", "visual"),
    ("Stretch RE1, collision", stretch / "RE1V0/stretch_description_RE1V0_tool_none.urdf", stretch / "RE1V0",
     "joint_{}_wheel", "link_{}_wheel", "collision"),
    ("Stretch SE3, visual", stretch / "SE3/stretch_description_SE3_eoa_wrist_dw3_tool_nil.urdf", stretch / "SE3",
     "joint_{}_wheel", "link_{}_wheel", "visual"),
    ("Stretch SE3, collision", stretch / "SE3/stretch_description_SE3_eoa_wrist_dw3_tool_nil.urdf", stretch / "SE3",
     "joint_{}_wheel", "link_{}_wheel", "collision"),
    ("Vega, collision", vega / "vega_1.urdf", vega, "{}_wheel_j2", "{}_wheel_l2", "collision"),
):
    sides = ("L", "R") if "Vega" in told else ("left", "right")
    left, right = (measure(urdf, folder, wheel.format(one), shaped.format(one), part) for one in sides)
    row = [1000 * abs(left[0] - right[0]), 1000 * abs(left[1] - right[1]), 1000 * left[2], 1000 * left[3]]
    seen.append([round(float(value), 1) for value in row])
    print("{:23} joints {:5.1f} mm apart, tyres {:5.1f}; radius {:5.1f}, width {:5.1f}".format(told + ":", *seen[-1]))
expected = [
    [396.8, 304.8, 50, 40], [340.7, 340.7, 50.8, 80], [340.7, 260.7, 71.8, 82],
    [340.7, 315.3, 50.8, 80], [340.7, 260.7, 71.8, 82], [371, 449.9, 87.4, 76.9],
]
if not np.allclose(seen, expected, atol=0.2):
    raise SystemExit("The behaviour changed: the files have other wheels.")
END
