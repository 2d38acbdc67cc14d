#!/usr/bin/env bash
# An axis of length 2 makes Pinocchio's "rotation" a matrix that stretches.
#
# Expected: in axisangle="0 2 0 0.5" only the direction of the axis counts; MuJoCo turns by 0.5 rad about y,
# as for "0 1 0 0.5".
#
# What happens: Pinocchio's joint placement then has a rotation matrix of determinant 2.85. Everything beyond
# this body is stretched along the axis: a point 1 m along y is at 1.69 m. There is no warning.
#
# For users: check that the determinants of model.jointPlacements are 1 after loading MJCF, or write unit
# axes.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   axis 0 1 0: MuJoCo determinant 1.0, y to 1.0; Pinocchio determinant 1.0, y to 1.0
#   axis 0 2 0: MuJoCo determinant 1.0, y to 1.0; Pinocchio determinant 2.85, y to 1.69
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pin==4.1.0 mujoco-core==4.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import mujoco
import numpy as np
import pinocchio as pin


def both(text):
    """The file's model by MuJoCo and by Pinocchio."""
    with open("robot.xml", "w") as file:
        file.write(text)
    return mujoco.MjModel.from_xml_path("robot.xml"), pin.buildModelFromMJCF("robot.xml")


FILE = """<mujoco><compiler angle="radian"/><worldbody><body name="b" axisangle="0 {y} 0 0.5"><joint name="j"/>
<geom size="0.1"/></body></worldbody></mujoco>"""
seen = []
for y in (1, 2):
    theirs, ours = both(FILE.format(y=y))
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, theirs.body("b").quat)
    turns = turn.reshape(3, 3), ours.jointPlacements[1].rotation
    seen.append([value for one in turns for value in (round(float(np.linalg.det(one)), 2), round(float(one[1, 1]), 2))])
    print("axis 0 {} 0: MuJoCo determinant {}, y to {}; Pinocchio determinant {}, y to {}".format(y, *seen[-1]))
if seen != [[1, 1, 1, 1], [1, 1, 2.85, 1.69]]:
    raise SystemExit("The behaviour changed: other rotations.")
END
