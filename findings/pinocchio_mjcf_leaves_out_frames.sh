#!/usr/bin/env bash
# Bodies in MJCF's <frame> or <replicate> are not in Pinocchio's model, and nobody says so.
#
# Expected: <frame> only shifts what is in it, so the arm in it is read, or the reader refuses the element.
#
# What happens: buildModelFromMJCF reads the file without a word, and every body in a <frame> or <replicate>
# is missing with its joints and its mass. A base with an arm becomes a base.
#
# For users: save the model from MuJoCo first (mj_saveLastXML); its files have no frames and replicas. Compare
# nq and the mass with MuJoCo's.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   no element around the arm: MuJoCo 2 joints, 7 kg; Pinocchio 2 joints, 7 kg
#   <frame> around the arm: MuJoCo 2 joints, 7 kg; Pinocchio 1 joints, 5 kg
#   <replicate> around the arm: MuJoCo 3 joints, 9 kg; Pinocchio 1 joints, 5 kg
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


FILE = """<mujoco><worldbody><body name="base"><joint name="turn"/><geom size="0.1" mass="5"/>{arm}</body></worldbody></mujoco>"""
ARM = '<body name="arm" pos="0.5 0 0"><joint name="shoulder"/><geom size="0.05" mass="2"/></body>'
seen = []
for told, arm in (
    ("no element around the arm", ARM),
    ("<frame> around the arm", f'<frame pos="0 0 1">{ARM}</frame>'),
    ("<replicate> around the arm", f'<replicate count="2" offset="0 0 1">{ARM}</replicate>'),
):
    theirs, ours = both(FILE.format(arm=arm))
    masses = sum(theirs.body_mass), sum(one.mass for one in ours.inertias)
    seen.append((theirs.nq, ours.nq, *(round(float(mass)) for mass in masses)))
    print("{}: MuJoCo {} joints, {} kg; Pinocchio {} joints, {} kg".format(told, *(seen[-1][k] for k in (0, 2, 1, 3))))
if seen != [(2, 2, 7, 7), (2, 1, 7, 5), (3, 1, 9, 5)]:
    raise SystemExit("The behaviour changed: Pinocchio reads other bodies now.")
END
