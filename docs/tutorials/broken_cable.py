"""A cable breaks: a stop along the limits, and one by zeros."""

import numpy as np
from mujoco_robot import MujocoRobot
from setup import make_controller, robot, start, target

import nmm

target.set([4.0, 0.0, 1.1])
for sends_zeros in (False, True):
    hardware = MujocoRobot(robot, start, [(0.25, 0.0), (-0.25, 0.0)])
    loop = nmm.Loop(make_controller(dt=0.005))
    odometry, share = robot.odometry(start, hardware.readings()), 0.0
    for k in range(500):
        t, silent = k * loop.period, k >= 360
        u = loop.step(t, None if silent else odometry.update(hardware.readings()), t)
        hardware.send(0 * u if silent and sends_zeros else u, loop.period)
        if silent:
            share = max(share, np.abs(hardware.torques / hardware.efforts).max())
    print("zeros:" if sends_zeros else "along the limits:", f"a motor at {100 * share:.0f} % of its limit")
print(*loop.findings, sep="\n")
