"""Loading robots: from a bundled name, a URDF or xacro file, or a Pinocchio model."""

from __future__ import annotations

from nmm.loading.check import Problem, find_problems
from nmm.loading.load import load

__all__ = ["Problem", "find_problems", "load"]
