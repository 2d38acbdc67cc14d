"""What a calibration of an arm learns: its numbers, and where what sees and what is seen are mounted."""

from __future__ import annotations

from nmm.plugins.robot.calibration.parameters import Learned

#: How far numbers may lie from where the file has them, m or rad: of mounts, of joints' placements, zeros
#: and, of 1, ratios.
MOUNT, PLACE, TURN, OFFSET, SLIDE, RATIO = 0.1, 0.01, 0.02, 0.1, 0.01, 0.1
#: What is learned rather than the others where numbers do the same, in this order.
ORDER = ("mount", "frame", "offset", "place", "turn", "ratio")


def mount_number(name: str, part: str, value: float, frame: bool = False) -> Learned:
    """Of where something is mounted, or of a frame that sees or is seen."""
    turns = part in ("roll", "pitch", "yaw")
    shown_by = "turn the hand about two axes, by a quarter turn and more"
    return Learned(name, "rad" if turns else "m", value, MOUNT, shown_by, "frame" if frame else "mount")


def offset_number(name: str, joint: str, unit: str, value: float) -> Learned:
    """Of a joint's zero."""
    plausible = OFFSET if unit == "rad" else SLIDE
    return Learned(name, unit, value, plausible, "move all joints by more, to more postures", "offset")


def ratio_number(name: str, joint: str, value: float) -> Learned:
    """Of what a joint's encoder counts."""
    return Learned(name, "1", value, RATIO * abs(value), f"move {joint} through its range", "ratio")


def origin_number(name: str, joint: str, part: str, value: float) -> Learned:
    """Of a joint's placement."""
    turns = part in ("roll", "pitch", "yaw")
    shown_by = "move all joints by more, to more postures"
    plausible, unit = (TURN, "rad") if turns else (PLACE, "m")
    return Learned(name, unit, value, plausible, shown_by, "turn" if turns else "place")
