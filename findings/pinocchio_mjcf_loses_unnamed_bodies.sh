#!/usr/bin/env bash
# MJCF bodies without a name are not in Pinocchio's model.
#
# Expected: a body's name is optional in MJCF, so bodies without names are read. Joints without names are:
# they get names that are made up.
#
# What happens: below a base that has a name, two bodies without names are left out, with their joints and
# masses, whether they hang on each other or side by side. That the joints have names does not help. There is
# no error and no warning.
#
# For users: name every body of a file that Pinocchio is to read.
#
# Versions: pin 4.1.0, mujoco-core 4.0.0.
#
# Output:
#   two named, one on the other: MuJoCo 3 joints, 7 kg; Pinocchio ['one', 'two', 'three'], 7 kg
#   two without names, one on the other: MuJoCo 3 joints, 7 kg; Pinocchio ['one'], 1 kg
#   two without names, side by side: MuJoCo 3 joints, 7 kg; Pinocchio ['one'], 1 kg
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


FILE = """<mujoco><worldbody><body name="base"><joint name="one"/><geom size="0.1" mass="1"/>{}</body></worldbody></mujoco>"""
TWO = '<joint name="two"/><geom size="0.1" mass="2"/>'
THREE = '<joint name="three"/><geom size="0.1" mass="4"/>'
seen = []
for told, below in (
    ("two named, one on the other", f'<body name="b">{TWO}<body name="c">{THREE}</body></body>'),
    ("two without names, one on the other", f"<body>{TWO}<body>{THREE}</body></body>"),
    ("two without names, side by side", f"<body>{TWO}</body><body>{THREE}</body>"),
):
    theirs, ours = both(FILE.format(below))
    joints, mass = list(ours.names)[1:], round(sum(one.mass for one in ours.inertias))
    seen.append((theirs.njnt, round(sum(theirs.body_mass)), joints, mass))
    print("{}: MuJoCo {} joints, {} kg; Pinocchio {}, {} kg".format(told, *seen[-1]))
if seen != [(3, 7, ["one", "two", "three"], 7), (3, 7, ["one"], 1), (3, 7, ["one"], 1)]:
    raise SystemExit("The behaviour changed: Pinocchio reads other bodies now.")
END
