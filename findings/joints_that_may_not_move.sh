#!/usr/bin/env bash
# The wheels of two published robots may turn by 0 degrees, and the fingers of a third by 0 radians per
# second.
#
# Expected: the motors of a robot that is sold or driven can move within the limits of its description.
#
# What happens: the wheels of Upkie and Cookie are "revolute" with <limit effort velocity> and no lower and
# upper. URDF takes those as 0, so the wheels' range is [0, 0]. Dexmate's grippers have velocity="0" and
# effort="0" beside a good range.
#
# For users: inverse kinematics that keeps the files' limits holds these joints still and blames the task; a
# simulator puts the wheels on their stops. Make such wheels continuous, and a velocity of 0 "not known".
# Versions: upkie-description 2.2.0, cookie-description 1.2.1, dexmate-urdf 0.8.4; read by pin 4.1.0.
#
# Output:
#   upkie.urdf left_wheel: from 0.0 to 0.0, velocity 111.0, effort 1.7
#   upkie.urdf right_wheel: from 0.0 to 0.0, velocity 111.0, effort 1.7
#   cookie.urdf left_wheel: from 0.0 to 0.0, velocity 111.0, effort 1.7
#   cookie.urdf right_wheel: from 0.0 to 0.0, velocity 111.0, effort 1.7
#   dexd_gripper.urdf gripper_j1: from 0.0 to 0.96, velocity 0.0, effort 0.0
#   vega_1_gripper.urdf L_gripper_j1: from 0.0 to 0.785, velocity 0.0, effort 0.0
#   vega_1_gripper.urdf R_gripper_j1: from 0.0 to 0.785, velocity 0.0, effort 0.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pin==4.1.0 cmeel-urdfdom==6.0.0 numpy==2.4.6
venv/bin/pip install -q --no-deps upkie-description==2.2.0 cookie-description==1.2.1 dexmate-urdf==0.8.4
venv/bin/python - <<'END'
from pathlib import Path

import pinocchio as pin

here = next(Path("venv").glob("lib/python3*/site-packages"))
seen = []
for path, names in (
    ("upkie_description/urdf/upkie.urdf", ("left_wheel", "right_wheel")),
    ("cookie_description/urdf/cookie.urdf", ("left_wheel", "right_wheel")),
    ("dexmate_urdf/robots/hands/dexd_gripper/dexd_gripper.urdf", ("gripper_j1",)),
    ("dexmate_urdf/robots/humanoid/vega_1/vega_1_gripper.urdf", ("L_gripper_j1", "R_gripper_j1")),
):
    model = pin.buildModelFromUrdf(str(here / path))
    for name in names:
        joint = model.joints[model.getJointId(name)]
        q, v = joint.idx_q, joint.idx_v
        low, high = model.lowerPositionLimit[q], model.upperPositionLimit[q]
        seen.append((round(float(low), 3), round(float(high), 3), float(model.velocityLimit[v]), float(model.effortLimit[v])))
        print("{} {}: from {} to {}, velocity {}, effort {}".format(path.rsplit("/", 1)[1], name, *seen[-1]))
if any(one[:2] != (0, 0) or one[2] == 0 for one in seen[:4]) or any(one[0] == one[1] or one[2:] != (0, 0) for one in seen[4:]):
    raise SystemExit("The behaviour changed: these joints have other limits.")
END
