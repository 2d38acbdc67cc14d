"""A loop in the small install of docs/deploy.md: load, control, loop, log; then its size and how late it is.

python .ci/on_a_robot.py [SECONDS]
"""

import gc
import sys
import sysconfig
from pathlib import Path
from time import monotonic

import numpy as np

import nmm

PERIOD = 0.005
#: The goal of docs/deploy.md, MB on disk.
MOST = 520
seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0

robot = nmm.load("unicycle_3r", platform="differential")
target = nmm.LiveTarget([0.8, 0.2, 1.0])
task = nmm.Task(nmm.Position("ee"), target, gain=2.0, speed=0.3)
limits = nmm.Limits(velocity={"platform": 10, "arm": 2}, acceleration={"platform": 20, "arm": 10})
pillar = nmm.Obstacle(nmm.Box([0.2, 0.2, 1.0]), [0.0, 3.0, 0.5])
apart = nmm.Collisions(0.03, obstacles=[pillar])
controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits, dt=PERIOD, collisions=apart)
loop = nmm.Loop(controller, PERIOD)
q = robot.q({"q2": 0.6, "q3": 0.8})
controller(0.0, q), controller.stop(0.0, q)  # compiled before the motors are on
woken, spent = [], []


def read():
    woken.append(monotonic())
    return q.copy(), woken[-1]


def write(u):
    global q
    spent.append(monotonic() - woken[-1])
    q = q + PERIOD * robot.S(q) @ u


gc.collect()
gc.freeze()
loop.run(read, write, duration=seconds)
run = loop.trajectory()
logged = np.load(run.save("robot_loop", figures=False) / "trajectory.npz")
if not np.array_equal(logged["u"], run.u) or loop.state != "stopped":
    raise SystemExit(f"the loop's log is another, or it did not stop: {loop.state}, {loop.findings}")
unneeded = {"scipy", "matplotlib", "sympy", "pydantic", "typer", "meshcat", "trimesh"} & sys.modules.keys()
if unneeded:
    raise SystemExit(f"imported, though a robot needs none of it: {', '.join(sorted(unneeded))}")
files = [one for one in Path(sysconfig.get_paths()["platlib"]).rglob("*") if not one.is_symlink()]
size = 512e-6 * sum(one.stat().st_blocks for one in files)
apart = 1e6 * np.diff(woken)
for what, us in (("between calls", apart[4:]), ("read to write", 1e6 * np.array(spent[5:]))):
    if len(us):  # on a busy machine the watchdog may stop it at once
        print(
            what, *np.percentile(us, [50, 99, 99.9, 100]).round().astype(int), "µs: median, 99, 99.9 %, most"
        )
print(f"{loop.calls} calls, {loop.late_calls} late; {size:.0f} MB installed")
if len(sys.argv) == 1 and size > MOST:
    raise SystemExit(f"expected at most {MOST} MB")
