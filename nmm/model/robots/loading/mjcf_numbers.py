"""Numbers of MJCF's attributes: vectors, and the five ways in which it says a rotation."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.loading.xml_tree import Attributes, Element

ORIGIN = (0.0, 0.0, 0.0)
#: The attributes that say a rotation; those of an element replace any of its class.
ROTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


class Numbers:
    """Reads attributes with a file's own units; `faults` is what is not understood."""

    def __init__(self, settings: Mapping[str, str], faults: Attributes) -> None:
        self.faults = faults
        self.degree = 1.0 if settings["angle"] == "radian" else math.pi / 180.0
        self._sequence = settings["eulerseq"]

    def vector(self, element: Element, attribute: str, usual: Sequence[float]) -> Array:
        read = self.faults.vector(element, attribute, len(usual), {"part": f"<{element.tag}>"})
        return np.array(usual if read is None else read, dtype=float)

    def number(self, element: Element, attribute: str, usual: float = 0.0) -> float:
        return float(self.vector(element, attribute, (usual,))[0])

    def place(self, element: Element) -> pin.SE3:
        return pin.SE3(self.rotation(element), self.vector(element, "pos", ORIGIN))

    def rotation(self, element: Element, quaternion: str = "quat") -> Array:
        """The matrix of the attribute, of those that say a rotation, that the element has."""
        if element.get("axisangle"):
            *axis, angle = self.vector(element, "axisangle", (*ORIGIN, 0.0))
            return turn(self.degree * angle, unit(np.array(axis)))
        if element.get("euler"):
            return self.turned(self.vector(element, "euler", ORIGIN))
        if element.get("xyaxes"):
            x, y = self.vector(element, "xyaxes", (*ORIGIN, *ORIGIN)).reshape(2, 3)
            x = unit(x)
            y = unit(y - (x @ y) * x)
            return np.column_stack([x, y, np.cross(x, y)])
        if element.get("zaxis"):
            return onto(self.vector(element, "zaxis", ORIGIN))
        return matrix(self.vector(element, quaternion, (1.0, *ORIGIN)))

    def turned(self, angles: Array) -> Array:
        """The matrix of angles in the file's unit and sequence."""
        made = np.eye(3)
        for letter, angle in zip(self._sequence, angles, strict=True):
            step = pin.utils.rotate(letter.lower(), float(self.degree * angle))
            made = made @ step if letter.islower() else step @ made
        return made


def matrix(quaternion: Array) -> Array:
    """Of a quaternion, w first, of any length."""
    w, x, y, z = map(float, quaternion)
    return np.array(pin.Quaternion(w, x, y, z).normalized().matrix())


def at(point: Sequence[float] | Array) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(point))


def unit(vector: Array) -> Array:
    length = np.linalg.norm(vector)
    return vector / length if length > 0.0 else vector


def turn(angle: float, axis: Array) -> Array:
    return np.array(pin.AngleAxis(float(angle), axis).matrix())


def onto(vector: Array) -> Array:
    """The shortest turn of the z axis onto a vector."""
    axis = np.cross((0.0, 0.0, 1.0), vector)
    sine = float(np.linalg.norm(axis))
    return turn(math.atan2(sine, vector[2]), axis / sine if sine > 1e-10 else np.array([1.0, 0.0, 0.0]))
