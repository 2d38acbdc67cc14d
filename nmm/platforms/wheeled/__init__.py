"""A platform described by its wheels.

descriptions   the wheels and hitches that a user writes down
structure, geometry, rows   which rows A has, and what a row is at a configuration
inputs, read_inputs   what an input may mean, and the rows W that it adds
kernel         G = [A; W]⁻¹ [0; I] and its derivative
problem, rates, fit   why the wheels cannot roll, how they turn, how a file is read
platform       `WheeledPlatform`
"""

from nmm.platforms.wheeled.descriptions import CasterWheel, FixedWheel, Hitch, OmniWheel, SteeredWheel
from nmm.platforms.wheeled.inputs import CommonSpeed, Speed, Spin, Spins
from nmm.platforms.wheeled.platform import WheeledPlatform

__all__ = [
    "CasterWheel",
    "CommonSpeed",
    "FixedWheel",
    "Hitch",
    "OmniWheel",
    "Speed",
    "Spin",
    "Spins",
    "SteeredWheel",
    "WheeledPlatform",
]
