#!/usr/bin/env bash
# Capitals in MJCF's eulerseq mean fixed axes, and Pinocchio reads them as small letters.
#
# Expected: eulerseq="XYZ" turns about the parent's fixed axes, as MuJoCo's documentation says (it is URDF's
# rpy); "xyz" turns about axes that turn along.
#
# What happens: Pinocchio gives "XYZ" and "xyz" the same rotation. Three angles of 0.3, 0.4 and 0.5 rad end
# 0.27 rad away from where MuJoCo has them. There is no warning.
#
# For users: files that were made from URDF often have eulerseq="XYZ" or "zyx" for its rpy. Write quaternions
# for Pinocchio, or the reversed sequence in small letters with the angles reversed.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   eulerseq="xyz": 0.0 rad between MuJoCo and Pinocchio
#   eulerseq="XYZ": 0.27 rad between MuJoCo and Pinocchio
#   eulerseq="zyx": 0.0 rad between MuJoCo and Pinocchio
#   eulerseq="ZYX": 0.27 rad between MuJoCo and Pinocchio
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


FILE = """<mujoco><compiler angle="radian" eulerseq="{}"/><worldbody><body name="b" euler="0.3 0.4 0.5"><joint name="j"/>
<geom size="0.1"/></body></worldbody></mujoco>"""
seen = []
for sequence in ("xyz", "XYZ", "zyx", "ZYX"):
    theirs, ours = both(FILE.format(sequence))
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, theirs.body("b").quat)
    apart = np.linalg.norm(pin.log3(turn.reshape(3, 3).T @ ours.jointPlacements[1].rotation))
    seen.append(round(float(apart), 2))
    print(f'eulerseq="{sequence}": {seen[-1]} rad between MuJoCo and Pinocchio')
if seen != [0, 0.27, 0, 0.27]:
    raise SystemExit("The behaviour changed: other rotations.")
END
