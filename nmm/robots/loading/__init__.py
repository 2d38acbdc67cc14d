"""Loading robots: from a bundled name, a URDF or xacro file, or a Pinocchio model.

`mount` puts an arm on a platform; `PinocchioLayout` leads back to Pinocchio's own configurations.
"""

from __future__ import annotations

from nmm.robots.loading.check import Problem, find_problems
from nmm.robots.loading.load import load
from nmm.robots.loading.mount import mount
from nmm.robots.loading.pinocchio_layout import PinocchioLayout, pinocchio_model, pinocchio_models
from nmm.robots.loading.provenance import Parts, Provenance

__all__ = [
    "Parts",
    "PinocchioLayout",
    "Problem",
    "Provenance",
    "find_problems",
    "load",
    "mount",
    "pinocchio_model",
    "pinocchio_models",
]
