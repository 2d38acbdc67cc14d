"""Tasks: functions f(q), one file each, and `Task`, which pairs one with a reference and a gain."""

from nmm.functions.tasks.callable_function import CallableFunction
from nmm.functions.tasks.center_of_mass import CenterOfMass
from nmm.functions.tasks.conditions import After, Between, While
from nmm.functions.tasks.coordinates import Coordinates
from nmm.functions.tasks.distance import Distance
from nmm.functions.tasks.heading import Heading
from nmm.functions.tasks.orientation import Orientation
from nmm.functions.tasks.pointing import Pointing
from nmm.functions.tasks.pose import Pose
from nmm.functions.tasks.position import Position
from nmm.functions.tasks.posture import Posture
from nmm.functions.tasks.task import Stack, Task

__all__ = [
    "After",
    "Between",
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
    "While",
]
