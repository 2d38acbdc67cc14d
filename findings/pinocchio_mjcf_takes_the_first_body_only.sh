#!/usr/bin/env bash
# Of the bodies in MJCF's world, Pinocchio reads the first one.
#
# Expected: a scene with a ball, a robot and a table has them all in the model, or is refused.
#
# What happens: the first body of <worldbody> with what hangs on it is the whole model; the others are dropped
# in silence. If a scene begins with the ball, "the robot" is the ball.
#
# For users: put the robot first in a scene, or load its own file. nq tells.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   the arm, then the ball: MuJoCo 3 joints; Pinocchio ['shoulder', 'wrist']
#   the ball, then the arm: MuJoCo 3 joints; Pinocchio ['ball']
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


BALL = '<body name="ball" pos="2 0 1"><joint name="ball" type="ball"/><geom size="0.1"/></body>'
ARM = '<body name="arm"><joint name="shoulder"/><geom size="0.1"/><body name="hand" pos="1 0 0"><joint name="wrist"/><geom size="0.1"/></body></body>'
seen = []
for told, bodies in (("the arm, then the ball", ARM + BALL), ("the ball, then the arm", BALL + ARM)):
    theirs, ours = both(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    seen.append((theirs.njnt, list(ours.names)[1:]))
    print("{}: MuJoCo {} joints; Pinocchio {}".format(told, *seen[-1]))
if seen != [(3, ["shoulder", "wrist"]), (3, ["ball"])]:
    raise SystemExit("The behaviour changed: Pinocchio reads other bodies of the world now.")
END
