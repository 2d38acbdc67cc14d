#!/usr/bin/env bash
# A joint's ref counts in Pinocchio while its body has one joint, and is forgotten when it has two.
#
# Expected: <joint type="slide" ref="0.5"> at 0.5 leaves the body where the file draws it. Pinocchio does so
# for a body of one joint.
#
# What happens: with a second joint in the same body, Pinocchio makes one composite joint of them, and ref no
# longer counts: at its own qpos0 the body is 0.5 m away from where it is drawn. It is also the names' end:
# both joints are "Composite_x".
#
# For users: bases of two slides and a hinge in one body are common in MJCF. Give each joint a body of its
# own, or no ref.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   one joint, at qpos0: x = 0.0 in MuJoCo, 0.0 in Pinocchio, whose joints are ['x']
#   two joints, at qpos0: x = 0.0 in MuJoCo, 0.5 in Pinocchio, whose joints are ['Composite_x']
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


FILE = """<mujoco><worldbody><body name="base"><joint name="x" type="slide" axis="1 0 0" ref="0.5"/>{more}
<geom size="0.1"/></body></worldbody></mujoco>"""
seen = []
for told, more in (("one joint", ""), ("two joints", '<joint name="y" type="slide" axis="0 1 0"/>')):
    theirs, ours = both(FILE.format(more=more))
    state, data = mujoco.MjData(theirs), ours.createData()
    mujoco.mj_kinematics(theirs, state)
    start = ours.referenceConfigurations["qpos0"]
    assert np.allclose(start, theirs.qpos0)
    pin.framesForwardKinematics(ours, data, start)
    places = float(state.body("base").xpos[0]), float(data.oMf[ours.getFrameId("base")].translation[0])
    seen.append((*places, list(ours.names)[1:]))
    print("{}, at qpos0: x = {} in MuJoCo, {} in Pinocchio, whose joints are {}".format(told, *seen[-1]))
if seen != [(0.0, 0.0, ["x"]), (0.0, 0.5, ["Composite_x"])]:
    raise SystemExit("The behaviour changed: ref of two joints in a body.")
END
