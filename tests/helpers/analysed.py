"""What the tests of the singularity analysis look at: tasks, an added task of EJ."""

from __future__ import annotations

import twin

from nmm.control.controller import Controller
from nmm.control.functions.references import Bearing
from nmm.control.functions.tasks import Heading, LinearCoordinates, Position, Task
from nmm.control.resolvers import ExtendedJacobian
from nmm.model.robots.robot import Robot

TIP = Task(Position("ee", "xy"), [0.0, 0.0])
TIP_3D = Task(Position("ee", "xyz"), [0.0, 0.0, 0.0])
POINTING = (TIP, Task(Heading("link2"), 0.0))
LINK_POINTING = (TIP, Task(Heading("link1"), Bearing(Position("link2", "xy"), twin.TARGET)))
#: Two rows that take up the freedom of TIP: J_e is singular where d + l1 c1 = 0.
HELD = (Task(LinearCoordinates("q1"), 0.0), Task(Heading("link2"), 0.0))


def extended(added: Task | tuple[Task, ...], robot: Robot) -> Controller:
    return Controller(robot, TIP, ExtendedJacobian(), None, added)
