#!/usr/bin/env bash
# A free joint puts a body where its numbers say in MuJoCo, and elsewhere in Pinocchio.
#
# Expected: the position of a free joint in qpos is the body's place in the world, whatever pose its <body>
# has in the file; MuJoCo does so. Pinocchio takes over the same numbers (referenceConfigurations["qpos0"]),
# so they should mean the same.
#
# What happens: if the body's pose has a turn, Pinocchio shifts the body by p - R p, with p and R of the file:
# at the file's own start it stands 0.77 m away from where the file puts it. Without a turn, both agree.
#
# For users: states of MuJoCo cannot be given to Pinocchio's model of such a file as they are. Give the body
# of the free joint no turn in the file, and turn it in a keyframe.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   <body pos='1 0.5 0.1'> turned by 0.0, at qpos0: MuJoCo [1.0, 0.5, 0.1], Pinocchio [1.0, 0.5, 0.1]
#   <body pos='1 0.5 0.1'> turned by 0.7, at qpos0: MuJoCo [1.0, 0.5, 0.1], Pinocchio [1.557, -0.027, 0.1]
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


FILE = """<mujoco><compiler angle="radian"/><worldbody><body name="base" pos="1 0.5 0.1" euler="0 0 {yaw}">
<freejoint name="root"/><geom size="0.1"/></body></worldbody></mujoco>"""
seen = []
for yaw in (0.0, 0.7):
    theirs, ours = both(FILE.format(yaw=yaw))
    state, data = mujoco.MjData(theirs), ours.createData()
    mujoco.mj_kinematics(theirs, state)
    start = ours.referenceConfigurations["qpos0"]
    assert np.allclose(start[:3], theirs.qpos0[:3])
    pin.framesForwardKinematics(ours, data, start)
    places = state.body("base").xpos, data.oMf[ours.getFrameId("base")].translation
    seen.append([[round(float(value), 3) for value in place] for place in places])
    print(f"<body pos='1 0.5 0.1'> turned by {yaw}, at qpos0: MuJoCo {seen[-1][0]}, Pinocchio {seen[-1][1]}")
if seen != [[[1.0, 0.5, 0.1]] * 2, [[1.0, 0.5, 0.1], [1.557, -0.027, 0.1]]]:
    raise SystemExit("The behaviour changed: Pinocchio puts the body elsewhere now.")
END
