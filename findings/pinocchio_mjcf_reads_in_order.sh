#!/usr/bin/env bash
# Pinocchio reads MJCF from top to bottom; what stands below the bodies does not count for them.
#
# Expected: the sections of an MJCF file may come in any order: <default> and <compiler> hold for the whole
# file. MuJoCo reads them first.
#
# What happens: Pinocchio applies <default> and <compiler> to bodies that come after them. Below <worldbody>
# they are without effect, in silence: no range, and angles of 90 radians where 90 degrees are meant, or the
# reverse.
#
# For users: files that are assembled by <include> often end with <compiler> or <default>. Move them to the
# top.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   <default><joint range='-30 60'/> above the bodies: MuJoCo [-0.524, 1.047], Pinocchio [-0.524, 1.047]
#   <default><joint range='-30 60'/> below the bodies: MuJoCo [-0.524, 1.047], Pinocchio [-inf, inf]
#   <compiler angle='radian'/>, range='-0.5 1' above the bodies: MuJoCo [-0.5, 1.0], Pinocchio [-0.5, 1.0]
#   <compiler angle='radian'/>, range='-0.5 1' below the bodies: MuJoCo [-0.5, 1.0], Pinocchio [-0.009, 0.017]
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


BODY = '<worldbody><body name="b"><joint name="j" {}/><geom size="0.1"/></body></worldbody>'
seen = []
for told, other, joint in (
    ("<default><joint range='-30 60'/>", '<default><joint range="-30 60"/></default>', ""),
    ("<compiler angle='radian'/>, range='-0.5 1'", '<compiler angle="radian"/>', 'range="-0.5 1"'),
):
    for place, text in (("above", other + BODY.format(joint)), ("below", BODY.format(joint) + other)):
        theirs, ours = both(f"<mujoco>{text}</mujoco>")
        limits = theirs.jnt_range[0], (ours.lowerPositionLimit[0], ours.upperPositionLimit[0])
        seen.append([[round(float(value), 3) for value in one] for one in limits])
        print("{} {} the bodies: MuJoCo {}, Pinocchio {}".format(told, place, *seen[-1]))
if any(one[0] != one[1] for one in seen[::2]) or any(one[0] == one[1] for one in seen[1::2]):
    raise SystemExit("The behaviour changed: the order counts otherwise.")
END
