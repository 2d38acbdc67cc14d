"""What tests of maps share."""

from __future__ import annotations

import pytest

from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot


@pytest.fixture(scope="session")
def fixed_2r() -> Robot:
    """The planar arm of unicycle_2r on a base that stands."""
    wheels = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
    return load("unicycle_2r", platform="fixed", lock=wheels)
