#!/usr/bin/env bash
# Pinocchio reads the acceleration limits of URDF 1.2, and Python cannot get at them.
#
# Expected: limits that the model has are attributes of pin.Model, as those of position, velocity and effort
# are.
#
# What happens: two files that differ only in <limit acceleration deceleration jerk> give models that are not
# equal, though no limit that Python shows differs. saveToXML writes the numbers. So the model has them, and
# computing with them is left to C++. In a file without version="1.2" they are dropped, and a negative one is
# not even noticed.
#
# For users: read accelerations from the URDF's text yourself; and a comparison of two models may fail by what
# one cannot see. Versions: pin 4.1.0 with cmeel-urdfdom 6.0.0.
#
# Output:
#   version 1.1: models equal: True; what Python shows equal: True; written by saveToXML: []
#   version 1.2: models equal: False; what Python shows equal: True; written by saveToXML: [-22, 33, -99, 99]
#   limits that Python shows: effortLimit, lowerDryFrictionLimit, lowerEffortLimit, lowerPositionLimit, lowerVelocityLimit, positionLimitMargin, upperDryFrictionLimit, upperEffortLimit, upperPositionLimit, upperVelocityLimit, velocityLimit
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pin==4.1.0 cmeel-urdfdom==6.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import re

import pinocchio as pin

FILE = """<robot name="r" version="{version}"><link name="a"/><link name="b"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="0" upper="1" effort="5" velocity="7" {more}/></joint></robot>"""
MORE = 'acceleration="33" deceleration="22" jerk="99"'
NUMBERS = (-22, 33, -99, 99)


def shown(model):
    """The limits of a model that Python can read."""
    pairs = ((name, getattr(model, name)) for name in dir(model) if not name.startswith("_"))
    return {name: str(one.tolist()) for name, one in pairs if "imit" in name and hasattr(one, "tolist")}


seen = []
for version in ("1.1", "1.2"):
    bare, full = (pin.buildModelFromXML(FILE.format(version=version, more=more)) for more in ("", MORE))
    full.saveToXML("model.xml", "model")
    with open("model.xml") as file:
        items = [float(one) for one in re.findall(r"<item>(-?[0-9.e+-]+)</item>", file.read())]
    written = [number for number in NUMBERS if number in items]
    seen.append((bare == full, shown(bare) == shown(full), written))
    print("version {}: models equal: {}; what Python shows equal: {}; written by saveToXML: {}".format(version, *seen[-1]))
print("limits that Python shows:", ", ".join(shown(full)))
if seen != [(True, True, []), (False, True, [*NUMBERS])] or any("ccel" in name for name in dir(full)):
    raise SystemExit("The behaviour changed: the limits are elsewhere now.")
END
