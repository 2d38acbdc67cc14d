#!/usr/bin/env bash
# A robot on a free joint may go 1.01 m from the origin, says its Pinocchio model from MJCF.
#
# Expected: MuJoCo's free joint cannot have limits, and Pinocchio's free flyer of a URDF has none for the
# position.
#
# What happens: after buildModelFromMJCF the position limits of x, y and z are -1.01 and 1.01, as if they were
# parts of the quaternion. A base that starts at height 1.2, as in the file below, begins outside its limits.
#
# For users: inverse kinematics and sampling that keep the model's limits hold the robot within a cube of two
# metres. Set lowerPositionLimit[:3] and upperPositionLimit[:3] to infinity after loading.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   MuJoCo, MJCF: limited: False
#   Pinocchio, URDF with a free flyer: x, y, z without limits: True
#   Pinocchio, MJCF: [-1.01, -1.01, -1.01] to [1.01, 1.01, 1.01]
#   height at the start: 1.2
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pin==4.1.0 mujoco-core==4.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import mujoco
import pinocchio as pin


def both(text):
    """The file's model by MuJoCo and by Pinocchio."""
    with open("robot.xml", "w") as file:
        file.write(text)
    return mujoco.MjModel.from_xml_path("robot.xml"), pin.buildModelFromMJCF("robot.xml")


FILE = """<mujoco><worldbody><body name="base" pos="0 0 1.2"><freejoint name="root"/><geom size="0.1"/></body></worldbody></mujoco>"""
URDF = """<robot name="r"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
theirs, ours = both(FILE)
flyer = pin.buildModelFromXML(URDF, pin.JointModelFreeFlyer())
free = bool((flyer.upperPositionLimit[:3] > 1e300).all())
print("MuJoCo, MJCF: limited:", bool(theirs.jnt_limited[0]))
print("Pinocchio, URDF with a free flyer: x, y, z without limits:", free)
print("Pinocchio, MJCF:", ours.lowerPositionLimit[:3].tolist(), "to", ours.upperPositionLimit[:3].tolist())
start = ours.referenceConfigurations["qpos0"]
print("height at the start:", start[2])
if not free or ours.upperPositionLimit[:3].tolist() != [1.01] * 3 or not start[2] > ours.upperPositionLimit[2]:
    raise SystemExit("The behaviour changed: other limits of x, y, z.")
END
