"""Maps of singular values and manipulability, over two coordinates or a plane of the workspace."""

from nmm.analysis.maps.coordinates import singularity_map
from nmm.analysis.maps.result import Map
from nmm.analysis.maps.workspace import workspace_map

__all__ = ["Map", "singularity_map", "workspace_map"]
