"""A robot's joints from JointStates that have others, too, or come in parts."""

from __future__ import annotations

import math
from typing import Any

from nmm.robots.robot import Robot
from nmm.ros.reading import joints, nanoseconds


class JointStates:
    """The newest position of each joint that a robot knows, for `Robot.q_from`.

    Joints of other machines, and those that the robot's file has not, are left out. `q_from` names the joints
    that are missing until each part has come.

    Attributes
    ----------
    joints : positions by joint, rad or m
    stamp : s, when the joint was measured whose part is the oldest; -inf before the first. So a part that
        does not come any more is noticed: `nmm.Loop` then has no new measurement. Passive wheels do not count

    Examples
    --------
    >>> from types import SimpleNamespace as M
    >>> def state(sec, **at):
    ...     return M(header=M(stamp=M(sec=sec, nanosec=0)), name=[*at], position=[*at.values()])
    >>> states = nmm.ros.JointStates(nmm.load("unicycle_2r"))
    >>> states.add(state(3, q1=0.1, lid=1.0)), states.add(state(4, q2=0.5)), states.add(state(5, lid=0.0))
    (True, True, False)
    >>> states.joints, states.stamp
    ({'q1': 0.1, 'q2': 0.5}, 3.0)
    """

    def __init__(self, robot: Robot) -> None:
        steers = robot.platform.n_p > 3  # else swivels are casters'
        self._timed = {*robot.q_names[min(3, robot.platform.n_p) :]}
        self._timed |= {wheel.swivel for wheel in robot.wheels if steers}
        wheels = {joint for wheel in robot.wheels for joint in wheel.joints}
        self._known = self._timed | wheels | {*robot.locked}
        self.joints: dict[str, float] = {}
        self._at: dict[str, float] = {}

    @property
    def stamp(self) -> float:
        return min(self._at.values(), default=-math.inf)

    def add(self, message: Any) -> bool:
        """Take over a JointState; whether it has any of the joints. `InputError` as of `joints`, with nothing
        taken over."""
        found = {name: value for name, value in joints(message).items() if name in self._known}
        at = nanoseconds(message) / 1e9
        self.joints.update(found)
        self._at.update(dict.fromkeys(found.keys() & self._timed, at))
        return bool(found)
