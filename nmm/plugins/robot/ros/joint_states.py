"""A robot's joints from JointStates that have others, too, or come in parts."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from nmm.base.errors import expect
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.reading import expect_reached, is_reached, name_of, nanoseconds


def timed_joints(robot: Robot) -> set[str]:
    """The joints of whose positions q is made: its own, and those that steer its wheels."""
    steers = robot.platform.n_p > 3  # else swivels are casters'
    return {*robot.q_names[min(3, robot.platform.n_p) :]} | {
        wheel.swivel for wheel in robot.wheels if steers and wheel.swivel
    }


def parts(
    message: Any, known: Collection[str], prefix: str = ""
) -> tuple[dict[str, float], dict[str, float]]:
    """Positions and velocities of the known joints in a JointState, by joint, finite or not. Either is empty
    where the message has none.

    Raises
    ------
    InputError : a known joint twice; not a position for each name
    """
    where, position, velocity = name_of(message), message.position, getattr(message, "velocity", ())
    others = len(velocity) or len(getattr(message, "effort", ()))
    names = [name if name in known else name.removeprefix(prefix).lstrip("/") for name in message.name]
    at = [i for i, name in enumerate(names) if name in known]
    own = [names[i] for i in at]
    expect(len({*own}) == len(own), f"{where}: name", "each joint once", names)
    if not own:
        return {}, {}
    count = len(names)
    whole = len(position) == count or (not len(position) and others)
    expect(whole, f"{where}: position", f"{count} numbers, as many as names", len(position))
    positions, velocities = (
        {names[i]: float(values[i]) for i in at} if len(values) == count else {}
        for values in (position, velocity)
    )
    return positions, velocities


class JointStates:
    """The newest position of each joint that a robot knows, for `Robot.q_from`.

    Joints of other machines, and those that the robot's file has not, are left out, and so is what says a
    velocity alone, or no number of a wheel that only rolls. `q_from` names the joints that are missing until
    each part has come.

    Parameters
    ----------
    robot : whose
    prefix : what the names of its joints begin with in messages, where several robots share a topic

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

    def __init__(self, robot: Robot, prefix: str = "") -> None:
        self._timed, self._prefix = timed_joints(robot), prefix
        wheels = {joint for wheel in robot.wheels for joint in wheel.joints}
        self._known = self._timed | wheels | {*robot.locked}
        self.joints: dict[str, float] = {}
        self._at: dict[str, float] = {}

    @property
    def stamp(self) -> float:
        return min(self._at.values(), default=-math.inf)

    def add(self, message: Any, t: float | None = None) -> bool:
        """Take over a JointState; whether it has the position of any of the joints.

        Parameters
        ----------
        message : it
        t : when it came, s, which counts where its stamp is 0

        Raises
        ------
        InputError : no number of a joint that is needed; a joint twice; not a position for each name; nothing
            is taken over then
        """
        positions, _ = parts(message, self._known, self._prefix)
        for name, value in positions.items():
            if name in self._timed:
                expect_reached(value, f"{name_of(message)}: position of {name}")
        at = nanoseconds(message) / 1e9
        at = t if t is not None and at == 0.0 else at
        finite = {name: value for name, value in positions.items() if is_reached(value)}
        for name in positions.keys() - finite.keys():  # an old one would stand for it
            self.joints.pop(name, None)
        self.joints.update(finite)
        self._at.update(dict.fromkeys(finite.keys() & self._timed, at))
        return bool(finite)
