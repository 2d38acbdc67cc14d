#!/usr/bin/env bash
# Pinocchio weighs the shapes of an MJCF body otherwise than MuJoCo, in two ways that are not told.
#
# Expected: a body without <inertial> has the mass of its geoms: by their mass, a class's mass, or density;
# and with <compiler inertiagrouprange="0 1"> only those of groups 0 and 1, so that shapes for the eye weigh
# nothing.
#
# What happens: a mass that is stated in <default><geom mass="3"/> is ignored (the shape weighs what its
# volume does at 1000 kg/m3), though a density and a size stated there count. And inertiagrouprange is
# ignored: the shapes for the eye weigh, too.
#
# For users: compare the mass of the model with MuJoCo's before you compute torques, or state <inertial>.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   mass 3 in the geom: MuJoCo 3.0 kg, Pinocchio 3.0 kg
#   mass 3 in its class: MuJoCo 3.0 kg, Pinocchio 4.189 kg
#   density 10 in its class: MuJoCo 0.042 kg, Pinocchio 0.042 kg
#   3 kg of group 0, 5 kg of group 2; groups 0 and 1 count: MuJoCo 3.0 kg, Pinocchio 8.0 kg
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


FILE = "<mujoco>{}<worldbody><body name='b'><joint name='j'/>{}</body></worldbody></mujoco>"
seen = []
for told, above, geoms in (
    ("mass 3 in the geom", "", '<geom size="0.1" mass="3"/>'),
    ("mass 3 in its class", '<default><geom mass="3"/></default>', '<geom size="0.1"/>'),
    ("density 10 in its class", '<default><geom density="10"/></default>', '<geom size="0.1"/>'),
    ("3 kg of group 0, 5 kg of group 2; groups 0 and 1 count", '<compiler inertiagrouprange="0 1"/>',
     '<geom size="0.1" mass="3"/><geom size="0.1" mass="5" group="2"/>'),
):
    theirs, ours = both(FILE.format(above, geoms))
    seen.append((round(float(theirs.body("b").mass[0]), 3), round(float(ours.inertias[1].mass), 3)))
    print("{}: MuJoCo {} kg, Pinocchio {} kg".format(told, *seen[-1]))
if seen != [(3, 3), (3, 4.189), (0.042, 0.042), (3, 8)]:
    raise SystemExit("The behaviour changed: other masses.")
END
