"""Tasks: functions f(q), one file each, and `Task`, which pairs one with a reference and a gain."""

from nmm.tasks.callable_function import CallableFunction
from nmm.tasks.center_of_mass import CenterOfMass
from nmm.tasks.coordinates import Coordinates
from nmm.tasks.distance import Distance
from nmm.tasks.heading import Heading
from nmm.tasks.orientation import Orientation
from nmm.tasks.pointing import Pointing
from nmm.tasks.pose import Pose
from nmm.tasks.position import Position
from nmm.tasks.posture import Posture
from nmm.tasks.task import Stack, Task

__all__ = [
    "CallableFunction",
    "CenterOfMass",
    "Coordinates",
    "Distance",
    "Heading",
    "Orientation",
    "Pointing",
    "Pose",
    "Position",
    "Posture",
    "Stack",
    "Task",
]
