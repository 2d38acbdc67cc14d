from damped import DampedLeastSquares
from slope import Slope

import nmm

robot = nmm.load("unicycle_3r")
task = nmm.Task(Slope("base_footprint", "ee"), [0.3], gain=2.0)
start = robot.q({"q1": 0.4, "q2": 0.6, "q3": 0.9})
run = nmm.simulate(nmm.Controller(robot, task, DampedLeastSquares(damping=0.1)), start, duration=4.0, dt=0.01)
