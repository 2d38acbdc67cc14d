"""The fixed base: no coordinate, no input; every formula becomes the standard manipulator's."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import PLATFORM, Kernel, kernel
from nmm.platforms.base import Platform


@kernel(PLATFORM)
def fixed(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G is empty, (0, 0)."""


class Fixed(Platform):
    """qp = [], up = []: the root link stands where the world's axes are.

    Examples
    --------
    >>> arm = nmm.load("unicycle_3r", platform="fixed")
    >>> arm.q_names
    ('q1', 'q2', 'q3')
    """

    name = "fixed"
    coordinates = ()
    inputs = ()
    input_units = ()

    @property
    def velocity_map(self) -> Kernel:
        return fixed

    def pfaffian(self, qp: Array) -> Array:
        """No coordinate, so none that is held back: shape (0, 0)."""
        return np.zeros((0, 0))
