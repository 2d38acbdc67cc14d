"""What a camera does that a perfect one does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import counted, positive, scalar, vector
from nmm.base.errors import expect


@dataclass(frozen=True)
class CameraFaults:
    """What a camera in a simulation does that a perfect one does not.

    Parameters
    ----------
    rate : pictures per s
    latency : until a picture arrives, s
    noise : standard deviation of each coordinate, in the unit of the image
    whole : whether coordinates are rounded to whole pixels (to 1 in the image's unit)
    dropped : the share of pictures that do not come
    size : width and height of the picture, px, from 0 on; points outside are not seen; all are when not given
    focal : the focal length over the one that is believed
    hand_eye : where the camera is in its frame's axes, x, y, z (m) and a rotation vector (rad); as believed
        when not given
    seed : of the noise and of what is dropped

    Raises
    ------
    InputError : numbers out of their range

    Examples
    --------
    >>> nmm.CameraFaults(rate=30.0, latency=0.05, noise=0.5, size=[640, 480]).latency
    0.05
    """

    rate: float = 30.0
    latency: float = 0.0
    noise: float = 0.0
    whole: bool = False
    dropped: float = 0.0
    size: ArrayLike | None = None
    focal: float = 1.0
    hand_eye: ArrayLike | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        positive(self.rate, "rate")
        positive(self.focal, "focal")
        scalar(self.latency, "latency", least=0.0)
        scalar(self.noise, "noise", least=0.0)
        expect(0.0 <= scalar(self.dropped, "dropped") < 1.0, "dropped", "a share, 0 to below 1", self.dropped)
        if self.hand_eye is not None:
            vector(self.hand_eye, 6, "hand_eye")
        if self.size is not None:
            expect(bool(np.all(vector(self.size, 2, "size") > 0.0)), "size", "numbers above 0", self.size)
        counted(self.seed, "seed", 0)
