#!/usr/bin/env bash
# With the recommended integrator, a robot on driven wheels runs ahead of them: by 8 ms of its acceleration.
#
# Expected: wheels that stick to the ground carry a robot at their radius times their rate. So it is with
# integrator="Euler", to a millionth.
#
# What happens: with integrator="implicitfast", which the documentation recommends, and a wheel that is driven
# by <velocity>, the robot's speed and its wheel's differ in proportion to the acceleration, whatever impratio,
# solimp and the friction are. The servo's damping is taken implicitly after the contacts' forces were found, and
# the velocities that it leaves do not keep to the contacts.
#
# For users: odometry beside such a simulation seems late. Use integrator="Euler" where wheels are driven by
# servos and must roll. Versions: mujoco-core 4.0.0.
#
# Output:
#   Euler         wheels 0.200 m/s, robot 0.200 m/s: 0.0 ms apart
#   implicitfast  wheels 0.199 m/s, robot 0.200 m/s: -8.1 ms apart
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q mujoco-core==4.0.0 numpy==2.4.6
venv/bin/python - <<'END'
import mujoco

WHEEL = """<body name="{0}" pos="0 {1} 0.1"><joint name="{0}" axis="0 1 0" armature="0.01"/>
<geom type="sphere" size="0.1" mass="1" condim="3"/></body>"""
FILE = """<mujoco><option timestep="0.002" integrator="{}" cone="elliptic" impratio="100"/>
<default><geom solref="0.004 1" solimp="0.99 0.99 0.001"/></default>
<worldbody><geom type="plane" size="0 0 1" condim="1"/>
<body><freejoint/><geom type="box" size="0.2 0.2 0.05" pos="0.08 0 0.2" mass="20" contype="0" conaffinity="0"/>
<geom type="sphere" size="0.05" pos="0.25 0 0.05" mass="0.1" condim="1"/>{}{}</body></worldbody>
<actuator><velocity joint="left" kv="30"/><velocity joint="right" kv="30"/></actuator></mujoco>"""
LEFT, RIGHT = WHEEL.format("left", 0.25), WHEEL.format("right", -0.25)
seen = []
for name in ("Euler", "implicitfast"):
    model = mujoco.MjModel.from_xml_string(FILE.format(name, LEFT, RIGHT))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=500)
    for k in range(1000):
        data.ctrl[:] = 1e-3 * 2.0 * k
        mujoco.mj_step(model, data)
    wheels, robot = 0.1 * data.joint("left").qvel[0], data.qvel[0]
    apart = 1e3 * (wheels - robot) / 0.1
    seen.append(round(apart, 1))
    print(f"{name:<13} wheels {wheels:.3f} m/s, robot {robot:.3f} m/s: {apart:.1f} ms apart")
if seen != [0.0, -8.1]:
    raise SystemExit("The behaviour changed: wheels lag otherwise.")
END
