#!/usr/bin/env bash
# LeKiwi's columns in LeRobot's data sets change their units by version, and no data set says which they have.
#
# Expected: a column "arm_elbow_flex.pos" of a data set v3.0 means the same whichever LeRobot recorded it, or
# info.json states its unit; x.vel, y.vel and theta.vel are all in m/s, as the docstring of _wheel_raw_to_body
# says; a recorded action is what the wheels were told.
#
# What happens: the default of use_degrees went from False to True between 0.5.1 and 0.6.0. So 0.4.4 writes an
# arm's joints as shares of their calibrated range, -100 to 100, and 0.6.1 in degrees from its middle, under the
# same names, in the same format, with {"dtype", "shape", "names"} and no unit. The gripper stays in 0 to 100.
# theta.vel is in deg/s in both. The recorded action is the velocity asked for; what the wheels get is scaled
# down until none exceeds 3000 steps/s (0.23 m/s): 0.4 m/s to the left, the teleoperation's fastest, is 1.74 times
# what the base is told to do, and both at once more.
#
# For users: mixing data sets of both versions trains on two units at once, and numbers alone do not tell them
# apart. To turn shares into degrees needs the calibration file of that arm, which is not in the data set. Take
# the base's motion from observation.state, not from action. Versions: lerobot 0.4.4 and 0.6.1.
#
# Output:
#   0.4.4: use_degrees = False; at step 2500 of 700..3300: joint 38.46, gripper 69.23
#   0.6.1: use_degrees = True; at step 2500 of 700..3300: joint 43.96, gripper 69.23
#   0.4.4: features of a recorder: {'dtype': 'float32', 'shape': (1,), 'names': ['arm_elbow_flex.pos']}
#   0.6.1: features of a recorder: {'dtype': 'float32', 'shape': (1,), 'names': ['arm_elbow_flex.pos']}
#   0.4.4: asked for y 0.4 m/s: the base does 0.2301; for theta 90 deg/s: 90
#   0.6.1: asked for y 0.4 m/s: the base does 0.2301; for theta 90 deg/s: 90
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q numpy==2.4.6
for version in 0.4.4 0.6.1; do
  venv/bin/pip download -q --no-deps --disable-pip-version-check --only-binary=:all: --python-version 3.12 "lerobot==$version"
done
venv/bin/python - <<'END'
import re
import textwrap
import zipfile
from enum import Enum
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np


class Mode(str, Enum):
    RANGE_0_100 = "range_0_100"
    RANGE_M100_100 = "range_m100_100"
    DEGREES = "degrees"


def taken(wheel, path, *names):
    """Functions of a file of the wheel, as they stand there: importing it would need torch."""
    text = zipfile.ZipFile(wheel).read(path).decode()
    known = {"np": np, "Any": Any, "MotorNormMode": Mode, "OBS_STR": "observation", "ACTION": "action",
             "PolicyFeature": Any, "RobotAction": Any, "RobotObservation": Any, "_validate_feature_names": lambda features: None}
    for name in names:  # by its indentation: the file has syntax of Python 3.12
        head = re.search(rf"^( *)def {name}\(", text, re.M)
        end = re.compile(rf"^ {{0,{len(head[1])}}}[^\s)]", re.M).search(text, head.end())
        exec(textwrap.dedent(text[head.start() : end.start() if end else None]), known)
    return [known[name] for name in names]


def default(wheel):
    text = zipfile.ZipFile(wheel).read("lerobot/robots/lekiwi/config_lekiwi.py").decode()
    return {"True": True, "False": False}[re.search(r"use_degrees: bool = (\w+)", text)[1]]


def shown(number):
    return f"{number:.4g}"


seen = []
for version, features_in in (("0.4.4", "lerobot/datasets/utils.py"), ("0.6.1", "lerobot/utils/feature_utils.py")):
    (wheel,) = Path().glob(f"lerobot-{version}-*.whl")
    degrees = default(wheel)
    (normalize,) = taken(wheel, "lerobot/motors/motors_bus.py", "_normalize")
    joint = Mode.DEGREES if degrees else Mode.RANGE_M100_100
    bus = SimpleNamespace(
        calibration={name: SimpleNamespace(range_min=700, range_max=3300, drive_mode=0) for name in ("joint", "gripper")},
        motors={"joint": SimpleNamespace(norm_mode=joint), "gripper": SimpleNamespace(norm_mode=Mode.RANGE_0_100)},
        apply_drive_mode=True, model_resolution_table={"sts3215": 4096},
        _id_to_name=lambda k: {1: "joint", 2: "gripper"}[k], _id_to_model=lambda k: "sts3215",
    )
    values = [shown(value) for value in normalize(bus, {1: 2500, 2: 2500}).values()]
    seen.append((version, degrees, *values))
    print(f"{version}: use_degrees = {degrees}; at step 2500 of 700..3300: joint {values[0]}, gripper {values[1]}")
    (features,) = taken(wheel, features_in, "hw_to_dataset_features")
    seen.append(features({"arm_elbow_flex.pos": float}, "observation")["observation.state"])
    to_wheels, to_body, to_raw, to_degrees = taken(
        wheel, "lerobot/robots/lekiwi/lekiwi.py", "_body_to_wheel_raw", "_wheel_raw_to_body", "_degps_to_raw", "_raw_to_degps"
    )
    robot = SimpleNamespace(_degps_to_raw=to_raw, _raw_to_degps=to_degrees)
    done = [to_body(robot, *to_wheels(robot, *asked).values()) for asked in ((0.0, 0.4, 0.0), (0.0, 0.0, 90.0))]
    seen.append((shown(done[0]["y.vel"]), f"{done[1]['theta.vel']:.2g}"))
for k in (0, 1):
    print(f"{('0.4.4', '0.6.1')[k]}: features of a recorder: {seen[3 * k + 1]}")
for k in (0, 1):
    y, theta = seen[3 * k + 2]
    print(f"{('0.4.4', '0.6.1')[k]}: asked for y 0.4 m/s: the base does {y}; for theta 90 deg/s: {theta}")
told = {"dtype": "float32", "shape": (1,), "names": ["arm_elbow_flex.pos"]}
rest = [told, ("0.2301", "90")]
if seen != [("0.4.4", False, "38.46", "69.23"), *rest, ("0.6.1", True, "43.96", "69.23"), *rest]:
    raise SystemExit("The behaviour changed: LeKiwi's columns have other units, or state them.")
END
