#!/usr/bin/env bash
# An equality between a replicated part and one outside disappears, in silence.
#
# Expected: the documentation says that all elements that refer to a replicated one are replicated, too. Two
# replicas of a joint that is coupled to an outer joint give two equalities.
#
# What happens: they give none. The same holds for <weld> and <connect> from a replicated body to one outside.
# Equalities within the replica, or of one joint alone, are doubled, and so are actuators, tendons that join
# both sides, and <exclude> between both sides.
#
# For users: fingers that follow an outer joint come loose when they are replicated. Compare neq with what you
# wrote. Versions: mujoco-core 4.0.0.
#
# Output:
#   0 made of <equality><joint joint1="bend" joint2="lead"/></equality>
#   0 made of <equality><weld body1="finger" body2="base"/></equality>
#   0 made of <equality><connect body1="tip" body2="base" anchor="0 0 0"/></equality>
#   2 made of <equality><joint joint1="curl" joint2="bend"/></equality>
#   2 made of <equality><joint joint1="bend"/></equality>
#   2 made of <tendon><fixed><joint joint="bend" coef="1"/><joint joint="lead" coef="1"/></fixed></tendon>
#   2 made of <contact><exclude body1="base" body2="tip"/></contact>
#   2 made of <actuator><motor joint="bend"/></actuator>
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q mujoco-core==4.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import mujoco

FILE = """<mujoco><worldbody><body name="base"><joint name="lead"/><geom size="0.1"/>
<replicate count="2" offset="0 0 0.5"><body name="finger" pos="1 0 0"><joint name="bend"/><geom size="0.1"/>
<body name="tip" pos="1 0 0"><joint name="curl"/><geom size="0.1"/></body></body></replicate></body></worldbody>{}</mujoco>"""
seen = []
for text in (
    '<equality><joint joint1="bend" joint2="lead"/></equality>',
    '<equality><weld body1="finger" body2="base"/></equality>',
    '<equality><connect body1="tip" body2="base" anchor="0 0 0"/></equality>',
    '<equality><joint joint1="curl" joint2="bend"/></equality>',
    '<equality><joint joint1="bend"/></equality>',
    '<tendon><fixed><joint joint="bend" coef="1"/><joint joint="lead" coef="1"/></fixed></tendon>',
    '<contact><exclude body1="base" body2="tip"/></contact>',
    '<actuator><motor joint="bend"/></actuator>',
):
    model = mujoco.MjModel.from_xml_string(FILE.format(text))
    seen.append(model.neq + model.ntendon + model.nexclude + model.nu)
    print(f"{seen[-1]} made of {text}")
if seen != [0, 0, 0, 2, 2, 2, 2, 2]:
    raise SystemExit("The behaviour changed: other numbers of elements.")
END
