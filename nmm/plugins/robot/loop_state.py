"""What a robot's loop does."""

from __future__ import annotations

from enum import StrEnum


class LoopState(StrEnum):
    """What a `Loop` does: waits for a first measurement, starts softly, runs, holds the inputs where the
    resolver has none, stops along the limits, has stopped.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [1.5, 0.3])
    >>> limits = nmm.Limits(acceleration=2.0)
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
    >>> nmm.Loop(controller).state is nmm.LoopState.WAITING
    True
    """

    WAITING = "waiting"
    STARTING = "starting"
    RUNNING = "running"
    HOLDING = "holding"
    STOPPING = "stopping"
    STOPPED = "stopped"
