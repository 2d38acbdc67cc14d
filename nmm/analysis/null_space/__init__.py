"""What a task leaves free: degrees, words, self-motions, and whether closed paths bring the posture back."""

from nmm.analysis.null_space.laps import Laps, Repeatability, repeatability
from nmm.analysis.null_space.moving import SelfMotion, self_motion
from nmm.analysis.null_space.report import RedundancyReport, redundancy

__all__ = [
    "Laps",
    "RedundancyReport",
    "Repeatability",
    "SelfMotion",
    "redundancy",
    "repeatability",
    "self_motion",
]
