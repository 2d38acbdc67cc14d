"""Tasks: functions f(q), one file each, and `Task`, which pairs one with a reference and a gain."""

from nmm.tasks.callable_function import CallableFunction
from nmm.tasks.coordinates import Coordinates
from nmm.tasks.heading import Heading
from nmm.tasks.position import Position
from nmm.tasks.task import Stack, Task

__all__ = ["CallableFunction", "Coordinates", "Heading", "Position", "Stack", "Task"]
