"""What a calibration learns: numbers of the robot, where the reference is on it, and its clock's delay."""

from __future__ import annotations

from dataclasses import dataclass

#: Names of the numbers that are not the robot's.
MOUNT = ("reference.x", "reference.y", "reference.yaw")
DELAY, CLOCK = "delay", "clock"
#: By the kind of a number: how far it may lie from the file's, as a share of it or, without, in its unit; and
#: the motion that shows it.
PLAUSIBLE: dict[str, tuple[float, float, str]] = {
    "radius": (0.1, 0.0, "drive straight ahead"),
    "scale": (0.1, 0.0, "drive straight ahead"),
    "track": (0.2, 0.0, "turn on the spot, both ways"),
    "left": (0.5, 0.0, "turn on the spot and along curves, both ways"),
    "right": (0.5, 0.0, "turn on the spot and along curves, both ways"),
    "ahead": (0.0, 0.2, "turn on the spot, with the reference's place on the robot known"),
    "wheelbase": (0.2, 0.0, "drive curves at several steering angles, both ways"),
    "offset": (0.0, 0.1, "drive straight ahead, and curves both ways"),
    "ratio": (0.2, 0.0, "drive curves at several steering angles, both ways"),
    "reference": (0.0, 0.5, "turn by more than a quarter, both ways"),
    DELAY: (0.0, 0.1, "speed up and slow down"),
    CLOCK: (0.0, 1e-3, "speed up and slow down for minutes"),
}
#: Of any other number, a length.
LENGTH = (0.2, 0.0, "turn on the spot, both ways")
#: How far from the file's a length of 0 may lie, m.
NEAR = 0.1


@dataclass(frozen=True)
class Learned:
    """A number that a calibration may learn.

    name, unit : of the number
    value : in the robot's file, or at first
    plausible : how far from this it may lie, in its unit: the scale by which it is judged what is shown
    shown_by : the motion that shows it
    role : of an arm what it is to it, "" of a platform
    """

    name: str
    unit: str
    value: float
    plausible: float
    shown_by: str
    role: str = ""

    @property
    def of_robot(self) -> bool:
        """Whether it is a number of the robot, or of its counts, not of the reference."""
        return self.kind not in ("reference", DELAY, CLOCK)

    @property
    def kind(self) -> str:
        return self.name.split(".")[0]


def learned(name: str, unit: str, value: float) -> Learned:
    """With what is usual for its kind."""
    share, absolute, shown_by = PLAUSIBLE.get(name.split(".")[0], LENGTH)
    return Learned(name, unit, value, share * abs(value) + absolute or NEAR, shown_by)


@dataclass(frozen=True)
class LearnedNumber:
    """A number, before and after.

    Attributes
    ----------
    before : by the robot's file, or 0 for what is none of the robot's
    after : learned, or what it was held at
    deviation : standard deviation of it, 0 where it was held
    unit : "m", "rad", "s" or "1"
    why : "learned"; "held" as was asked; "not shown" by the logs; of an arm also "as others", which do the
        same whatever it does, and "sign" of a ratio that is known but for it

    Examples
    --------
    >>> track = nmm.LearnedNumber(before=0.5, after=0.56, deviation=0.004, unit="m", why="learned")
    >>> round((track.after - track.before) / track.deviation)
    15
    """

    before: float
    after: float
    deviation: float
    unit: str
    why: str
