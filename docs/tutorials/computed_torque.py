"""A run of second order tracked by the motors' torques."""

import numpy as np
from mujoco_robot import MujocoRobot
from setup import robot, start

import nmm

tip = nmm.Configuration(robot, start).placement("ee").translation
task = nmm.Task(nmm.Position("ee"), tip + np.array([0.4, 0.2, -0.1]), gain=1.0)
second = nmm.Controller(robot, task, nmm.ProjectedGradient(), order=2, servo=2.0)
run = nmm.simulate(second, start, 4.0, 0.005)  # its inputs, and their accelerations
hardware = MujocoRobot(robot, start, [(0.25, 0.0), (-0.25, 0.0)])
dynamics, sent, off, k1 = hardware.dynamics, [], [], 10.0
for q_d, u_d, u_dot in zip(run.q[:-1], run.u[:-1], run.u_dot[:-1], strict=True):
    q, motors = hardware.q[np.newaxis], dynamics.actuators
    turned = np.vstack([motors.rates(q, one[np.newaxis]) for one in np.eye(robot.n_u)]).T
    u = np.linalg.pinv(turned) @ hardware.rates()
    off.append(q_d - q[0])
    u_dot = u_dot + k1 * (u_d - u) + k1**2 / 4 * np.linalg.pinv(robot.S(q[0])) @ off[-1]
    sent.append(motors.torques(q, dynamics.inverse(q[0], u, u_dot)[np.newaxis])[0])
    hardware.apply(sent[-1], 0.005)
foretold = run.torques().torques[:-1]
share = np.sqrt(np.mean((sent - foretold) ** 2, axis=0)) / np.abs(foretold).max(axis=0)
platform, joints = 1000 * np.abs(off)[:, :2].max(), np.abs(off)[:, 2:].max()
print(f"the platform is at most {platform:.2f} mm off, the joints {joints:.3f} rad;")
print(f"torques are those foretold to {100 * share.max():.1f} % of their peaks (RMS)")
