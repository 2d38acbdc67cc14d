#!/usr/bin/env bash
# A joint turned by a quaternion is not turned at all unless the file states a new enough version.
#
# Expected: <origin quat_xyzw="..."> turns a joint by 90 degrees, or the reader says that it does not know the
# attribute.
#
# What happens: it turns the joint where <robot> has version="1.1" or "1.2". Without a version, or with "1.0",
# the attribute is dropped: no error, no warning, and the arm's next link points elsewhere. Nearly no URDF
# states a version.
#
# For users: write version="1.1" (or later) on <robot> when a file, or a part that is included in it, has
# quat_xyzw. A macro file with quaternions that is included in an old robot's file loses its turns. Versions:
# pin 4.1.0 with cmeel-urdfdom 6.0.0.
#
# Output:
#   <robot (no version)>: the joint is turned by 0 degrees
#   <robot version="1.0">: the joint is turned by 0 degrees
#   <robot version="1.1">: the joint is turned by 90 degrees
#   <robot version="1.2">: the joint is turned by 90 degrees
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pin==4.1.0 cmeel-urdfdom==6.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import numpy as np
import pinocchio as pin

FILE = """<robot name="r" {version}><link name="a"/><link name="b"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="0 0 0" quat_xyzw="0 0 0.7071067811865476 0.7071067811865476"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
seen = []
for version in ("", 'version="1.0"', 'version="1.1"', 'version="1.2"'):
    model = pin.buildModelFromXML(FILE.format(version=version))
    yaw = pin.rpy.matrixToRpy(model.jointPlacements[1].rotation)[2]
    seen.append(round(float(np.degrees(yaw))))
    print(f"<robot {version or '(no version)'}>: the joint is turned by {seen[-1]} degrees")
if seen != [0, 0, 90, 90]:
    raise SystemExit(f"The behaviour changed: turns of {seen} degrees instead of 0, 0, 90, 90.")
END
