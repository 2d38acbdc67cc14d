"""Tasks: functions f(q), one file per idea, and `Task`, which pairs one with a reference and a gain."""

from nmm.control.functions.callbacks import CallableFunction as CallableFunction
from nmm.control.functions.tasks.camera_faults import CameraFaults as CameraFaults
from nmm.control.functions.tasks.conditions import After as After
from nmm.control.functions.tasks.conditions import Between as Between
from nmm.control.functions.tasks.conditions import While as While
from nmm.control.functions.tasks.image import ImageLine as ImageLine
from nmm.control.functions.tasks.image import ImageMoments as ImageMoments
from nmm.control.functions.tasks.image import ImagePoints as ImagePoints
from nmm.control.functions.tasks.image import LogDepth as LogDepth
from nmm.control.functions.tasks.linear_coordinates import LinearCoordinates as LinearCoordinates
from nmm.control.functions.tasks.linear_coordinates import Posture as Posture
from nmm.control.functions.tasks.measured import MeasuredPoints as MeasuredPoints
from nmm.control.functions.tasks.pointing import Heading as Heading
from nmm.control.functions.tasks.pointing import Pointing as Pointing
from nmm.control.functions.tasks.pose import Orientation as Orientation
from nmm.control.functions.tasks.pose import Pose as Pose
from nmm.control.functions.tasks.position import CenterOfMass as CenterOfMass
from nmm.control.functions.tasks.position import Distance as Distance
from nmm.control.functions.tasks.position import Position as Position
from nmm.control.functions.tasks.task import Stack as Stack
from nmm.control.functions.tasks.task import Task as Task
