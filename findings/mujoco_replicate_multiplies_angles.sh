#!/usr/bin/env bash
# MuJoCo's <replicate euler="..."> multiplies the three angles; it does not repeat the turn.
#
# Expected: the documentation says that euler is the rotation between two subsequent replicas, with respect to
# the frame of the previous one. So the third replica is turned by the step twice.
#
# What happens: replica i is turned by the angles i * euler. About one axis this is the same. With two or
# three angles it is not: replica 2 of "0 30 40" is 20 degrees away from two steps and replica 3 is 56 degrees
# away from three, because each step is about another axis.
#
# For users: a helix or an arc of parts with two angles is not what two steps of the turn give. Who expands
# replicas must multiply the angles to get MuJoCo's model. Versions: mujoco-core 4.0.0.
#
# Output:
#   euler="0 0 40", replicas 0 to 3: degrees from k steps [0.0, 0.0, 0.0, 0.0], from k * angles [0.0, 0.0, 0.0, 0.0]; steps [40.0, 40.0, 40.0]
#   euler="0 30 40", replicas 0 to 3: degrees from k steps [0.0, 0.0, 20.3, 56.5], from k * angles [0.0, 0.0, 0.0, 0.0]; steps [49.6, 49.6, 49.6]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q mujoco-core==4.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import mujoco
import numpy as np


def turns(euler):
    text = f"""<mujoco><worldbody><body><geom size="0.1"/><replicate count="4" euler="{euler}">
    <site name="s"/></replicate></body></worldbody></mujoco>"""
    made = []
    for quaternion in mujoco.MjModel.from_xml_string(text).site_quat:
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, quaternion)
        made.append(turn.reshape(3, 3))
    return made


def apart(a, b):
    return round(float(np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1)))), 1)


seen = {}
for euler in ("0 0 40", "0 30 40"):
    found = turns(euler)
    _, once, _, _ = found
    multiplied = [turns(" ".join(str(k * float(one)) for one in euler.split()))[1] for k in range(4)]
    powers = [apart(one, np.linalg.matrix_power(once, k)) for k, one in enumerate(found)]
    angles = [apart(one, multiplied[k]) for k, one in enumerate(found)]
    steps = [apart(a, b) for a, b in zip(found, found[1:])]
    seen[euler] = powers, angles, steps
    print(f'euler="{euler}", replicas 0 to 3: degrees from k steps {powers}, from k * angles {angles}; steps {steps}')
if any(seen["0 0 40"][0]) or any(seen["0 30 40"][1]) or min(seen["0 30 40"][0][2:]) < 10:
    raise SystemExit("The behaviour changed: replicas are turned otherwise.")
END
