"""Maps of singular values and manipulability, over two coordinates or a plane of the workspace."""

from nmm.analysis.mapping.coordinates import singularity_map
from nmm.analysis.mapping.result import Map
from nmm.analysis.mapping.workspace import workspace_map

__all__ = ["Map", "singularity_map", "workspace_map"]
