#!/usr/bin/env bash
# Pinocchio limits a joint of which the MJCF says limited="false".
#
# Expected: a range beside limited="false" is switched off; MuJoCo's documentation says so, and the joint
# turns freely there.
#
# What happens: the Pinocchio model has the range as the joint's limits. The same happens where a class
# switches limits off for the joints that inherit a range.
#
# For users: wheels and turntables that were freed by limited="false" hit a stop in Pinocchio. Compare with
# jnt_limited.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   limited="false" in the joint: limited in MuJoCo: False; in Pinocchio: -1.0 to 1.0
#   limited="false" in its class: limited in MuJoCo: False; in Pinocchio: -1.0 to 1.0
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


seen = []
for told, classes, joint in (
    ("in the joint", "", 'range="-1 1" limited="false"'),
    ("in its class", '<default><joint range="-1 1" limited="false"/></default>', ""),
):
    theirs, ours = both(
        f'<mujoco><compiler angle="radian"/>{classes}<worldbody><body name="b"><joint name="j" {joint}/>'
        '<geom size="0.1"/></body></worldbody></mujoco>'
    )
    seen.append((bool(theirs.jnt_limited[0]), float(ours.lowerPositionLimit[0]), float(ours.upperPositionLimit[0])))
    print('limited="false" {}: limited in MuJoCo: {}; in Pinocchio: {} to {}'.format(told, *seen[-1]))
if seen != [(False, -1.0, 1.0)] * 2:
    raise SystemExit("The behaviour changed: other limits.")
END
