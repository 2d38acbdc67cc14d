"""Tasks: functions f(q), one file per idea, and `Task`, which pairs one with a reference and a gain."""

from nmm.functions.callbacks import CallableFunction as CallableFunction
from nmm.functions.tasks.camera_faults import CameraFaults as CameraFaults
from nmm.functions.tasks.conditions import After as After
from nmm.functions.tasks.conditions import Between as Between
from nmm.functions.tasks.conditions import While as While
from nmm.functions.tasks.image import ImageLine as ImageLine
from nmm.functions.tasks.image import ImageMoments as ImageMoments
from nmm.functions.tasks.image import ImagePoints as ImagePoints
from nmm.functions.tasks.image import LogDepth as LogDepth
from nmm.functions.tasks.linear_coordinates import LinearCoordinates as LinearCoordinates
from nmm.functions.tasks.linear_coordinates import Posture as Posture
from nmm.functions.tasks.measured import MeasuredPoints as MeasuredPoints
from nmm.functions.tasks.pointing import Heading as Heading
from nmm.functions.tasks.pointing import Pointing as Pointing
from nmm.functions.tasks.pose import Orientation as Orientation
from nmm.functions.tasks.pose import Pose as Pose
from nmm.functions.tasks.position import CenterOfMass as CenterOfMass
from nmm.functions.tasks.position import Distance as Distance
from nmm.functions.tasks.position import Position as Position
from nmm.functions.tasks.task import Stack as Stack
from nmm.functions.tasks.task import Task as Task
