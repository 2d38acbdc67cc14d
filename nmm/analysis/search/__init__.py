"""Singular configurations searched for: from many starts, told as families, or the nearest to a given one."""

from nmm.analysis.search.family import Relation, SingularFamily
from nmm.analysis.search.many_starts import SingularitySearch, find_singularities
from nmm.analysis.search.minimum import LocalMinimum
from nmm.analysis.search.nearest import SingularPoint, nearest_singularity

__all__ = [
    "LocalMinimum",
    "Relation",
    "SingularFamily",
    "SingularPoint",
    "SingularitySearch",
    "find_singularities",
    "nearest_singularity",
]
