#!/usr/bin/env bash
# The same <limit> means three things, by the version that <robot> states.
#
# Expected: a later version of a format reads what the version before read, or the limits that are left out
# are "none".
#
# What happens, for a revolute or prismatic joint. Before 1.2 a missing lower or upper is 0, so <limit effort
# velocity/> is a joint that may not move, without a word; and a missing effort or velocity makes the file
# unreadable. In 1.2 it is the other way around: a missing lower or upper makes the file unreadable, and a
# missing effort or velocity is infinite.
#
# For users: raising the version of a file that was read for years can make it unreadable. Lowering it can,
# too. State all four, then each version reads the same. Versions: pin 4.1.0 with cmeel-urdfdom 6.0.0.
#
# Output:
#   1.0  <limit upper="1" effort="5" velocity="7"/>: [0, 1], velocity 7, effort 5
#   1.1  <limit upper="1" effort="5" velocity="7"/>: [0, 1], velocity 7, effort 5
#   1.2  <limit upper="1" effort="5" velocity="7"/>: refused
#   1.0  <limit effort="5" velocity="7"/>: [0, 0], velocity 7, effort 5
#   1.1  <limit effort="5" velocity="7"/>: [0, 0], velocity 7, effort 5
#   1.2  <limit effort="5" velocity="7"/>: refused
#   1.0  <limit lower="0" upper="1"/>: refused
#   1.1  <limit lower="0" upper="1"/>: refused
#   1.2  <limit lower="0" upper="1"/>: [0, 1], velocity inf, effort inf
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pin==4.1.0 cmeel-urdfdom==6.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import pinocchio as pin

FILE = """<robot name="r" version="{version}"><link name="a"/><link name="b"/>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit {given}/></joint></robot>"""
seen = {}
for given in ('upper="1" effort="5" velocity="7"', 'effort="5" velocity="7"', 'lower="0" upper="1"'):
    for version in ("1.0", "1.1", "1.2"):
        try:
            model = pin.buildModelFromXML(FILE.format(version=version, given=given))
        except ValueError:
            told = "refused"
        else:
            low, high = model.lowerPositionLimit[0], model.upperPositionLimit[0]
            told = f"[{low:g}, {high:g}], velocity {model.velocityLimit[0]:g}, effort {model.effortLimit[0]:g}"
        seen[given, version] = told
        print(f"{version}  <limit {given}/>: {told}")
half, bare, ranged = ("[0, 1], velocity 7, effort 5", "[0, 0], velocity 7, effort 5", "[0, 1], velocity inf, effort inf")
if [*seen.values()] != [half, half, "refused", bare, bare, "refused", "refused", "refused", ranged]:
    raise SystemExit("The behaviour changed: the versions read these limits differently now.")
END
