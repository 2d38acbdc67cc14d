"""Singularity analysis: where J loses rank, why, and what the platform buys. Arrays in, arrays out."""

from nmm.analysis.algorithmic import ExtendedSingularity, PartitionSingularities
from nmm.analysis.along import SingularityHistory, analyse_along
from nmm.analysis.instants import Crossing, Dip
from nmm.analysis.minors import Minors
from nmm.analysis.parts import Part
from nmm.analysis.restoration import Restoration
from nmm.analysis.singularity import SingularityReport, analyse

__all__ = [
    "Crossing",
    "Dip",
    "ExtendedSingularity",
    "Minors",
    "Part",
    "PartitionSingularities",
    "Restoration",
    "SingularityHistory",
    "SingularityReport",
    "analyse",
    "analyse_along",
]
