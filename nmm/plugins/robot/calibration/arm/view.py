"""A log of sightings beside the chain of joints that it is of, and rows of what is left of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Flags, Integers
from nmm.plugins.robot.calibration.arm.chain import Chain
from nmm.plugins.robot.calibration.arm.residuals import ROWS
from nmm.plugins.robot.calibration.arm.sightings import Sightings


class Block(NamedTuple):
    """Where something is mounted: the numbers of its parts, by index; it is at `placed(parts, turn)`."""

    name: str
    numbers: Mapping[str, int]


@dataclass(eq=False)
class SightingsView:
    """A log of sightings on its chain: readings (N, c) of the chain's coordinates, the platform's pose, the
    blocks of what sees and of what is seen, from inside out, and what is taken of what was seen."""

    log: Sightings
    chain: Chain
    readings: Array
    base: Array | None
    sensor: tuple[Block, ...]
    target: tuple[Block, ...]
    taken: Flags

    @property
    def groups(self) -> tuple[str, ...]:
        """Of each row of an item, what it is."""
        return ROWS[self.log.kind]

    @property
    def samples_taken(self) -> Flags:
        """Whether anything of a sample is taken, (N,)."""
        return some_of(self.taken)


def some_of(items: Flags) -> Flags:
    """Whether any item of a sample is, (N,), of items (N,) or (N, m)."""
    return np.asarray(items.reshape(len(items), -1).any(axis=1), dtype=np.bool_)


class ResidualRows(NamedTuple):
    """r (R,), m, rad or px; J (R, f); group (R,) : of `ArmModel.groups`, whose noise the row has; sample
    (R,) : whose the row is, counted through all logs."""

    r: Array
    J: Array
    group: Integers
    sample: Integers
