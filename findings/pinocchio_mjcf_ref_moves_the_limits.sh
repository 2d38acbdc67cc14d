#!/usr/bin/env bash
# A joint's ref moves its limits in Pinocchio, but not in MuJoCo, though both count the joint's value alike.
#
# Expected: <joint range="-2 2" ref="0.2"> may go from -2 to 2 in qpos. MuJoCo holds it there. Pinocchio's
# value is the same as qpos: at 0.2 the link is as the file draws it, in both. So its limits should be -2 and
# 2.
#
# What happens: they are -2.2 and 1.8: ref is taken off, as if the value were counted from ref.
#
# For users: a posture near a limit that is allowed in MuJoCo is refused by the Pinocchio model, and the other
# end leaves room that is not there. Add ref to both limits after loading.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   joint at 0.2: turned by 0.0 in MuJoCo, by 0.0 in Pinocchio
#   joint at 1.9: turned by 1.7 in MuJoCo, by 1.7 in Pinocchio
#   limits: [-2.0, 2.0] in MuJoCo, [-2.2, 1.8] in Pinocchio
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


FILE = """<mujoco><compiler angle="radian"/><worldbody><body name="link"><joint name="j" axis="0 0 1" range="-2 2" ref="0.2"/>
<geom size="0.1"/></body></worldbody></mujoco>"""
theirs, ours = both(FILE)
state, data = mujoco.MjData(theirs), ours.createData()
seen = []
for value in (0.2, 1.9):
    state.qpos[:] = value
    mujoco.mj_kinematics(theirs, state)
    pin.framesForwardKinematics(ours, data, np.array([value]))
    turns = state.body("link").xmat.reshape(3, 3), data.oMf[ours.getFrameId("link")].rotation
    seen.append([round(float(np.arctan2(turn[1, 0], turn[0, 0])), 6) for turn in turns])
    print(f"joint at {value}: turned by {seen[-1][0]} in MuJoCo, by {seen[-1][1]} in Pinocchio")
limits = [round(float(one[0]), 6) for one in (ours.lowerPositionLimit, ours.upperPositionLimit)]
print("limits:", theirs.jnt_range[0].tolist(), "in MuJoCo,", limits, "in Pinocchio")
if seen != [[0, 0], [1.7, 1.7]] or theirs.jnt_range[0].tolist() != [-2, 2] or limits != [-2.2, 1.8]:
    raise SystemExit("The behaviour changed: other values or limits of a joint with ref.")
END
