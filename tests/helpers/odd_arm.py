"""An arm on a cart with all that origins may have: oblique axes, steep pitches, fixed joints between, a mimic
joint, names with dots, a joint without an origin or an axis; and its file with joints elsewhere."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from urdf_parts import inertial, joint, link, numbers, robot, shape, write

import nmm
from nmm.base.arrays import Array

STEEP = f'<origin xyz="0.02 0 0.15" rpy="0.4 {0.5 * math.pi - 1e-9!r} -0.3"/>'
NEAR = '<origin xyz="0 0.03 0.2" rpy="0.3 1.5701 0.9"/>'
BOX = shape('<box size="0.1 0.05 0.04"/>') + shape('<box size="0.1 0.05 0.04"/>', "collision")
#: The arm's joints that have numbers, in order.
JOINTS = ("arm.1", "slide", "spin", "finger")


def _body(axis: str, lower: float, upper: float) -> str:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="9" velocity="2"/>'
    return (f'<axis xyz="{axis}"/>' if axis else "") + limit


def odd_arm() -> str:
    """The file's text, a line for each element of the robot's."""
    follows = '<mimic joint="finger" multiplier="-0.5" offset="0.01"/>'
    at = '<origin xyz="0 0.05 0"/>'
    return robot(
        *(
            link(name, inertial(0.5, "0.01 0.02 0.03") + BOX)
            for name in ("base_link", "riser", "upper", "wrist")
        ),
        *(link(name) for name in ("bracket", "hand", "optical", "lamp")),
        link("camera", inertial(0.2) + BOX),
        link("left", inertial(0.1) + BOX),
        link("right", inertial(0.1)),
        joint("riser_joint", "base_link", "riser", "fixed", "", '<origin xyz="0.1 0 0.3"/>'),
        joint("arm.1", "riser", "upper", "revolute", _body("0.6 0 0.8", -1.5, 2.0), NEAR),
        joint("bracket_joint", "upper", "bracket", "fixed", "", STEEP),
        joint("slide", "bracket", "wrist", "prismatic", _body("0 -1 0", -0.1, 0.4), ""),
        joint("spin", "wrist", "hand", "continuous", '<limit effort="9" velocity="3"/>', STEEP),
        joint("finger", "hand", "left", "prismatic", _body("0 1 0", 0.0, 0.04), at),
        joint("other", "hand", "right", "prismatic", _body("0 1 0", -0.01, 0.01) + follows, at),
        joint("camera_joint", "wrist", "camera", "fixed", "", NEAR),
        joint("optical_joint", "camera", "optical", "fixed", "", STEEP),
        joint("held", "wrist", "lamp", "revolute", _body("1 0 0", -1.0, 1.0), NEAR),
        attributes='name="odd"',
    )


def loaded(path: Path, text: str | None = None) -> nmm.Robot:
    return nmm.load(write(path, odd_arm() if text is None else text), **KEYWORDS)


#: As it is loaded.
KEYWORDS: dict[str, Any] = {"platform": "unicycle", "lock": {"held": 0.3}}


def elsewhere(text: str, origins: Mapping[str, Array]) -> str:
    """The file's text with joints placed otherwise: by name x, y, z, roll, pitch, yaw in the axes that they
    have."""
    root = ElementTree.fromstring(text)
    for element in root.iterfind("joint"):
        if element.get("name") in origins:
            origin = element.find("origin")
            if origin is None:
                origin = ElementTree.SubElement(element, "origin")
            own = [np.array([*map(float, origin.get(key, "0 0 0").split())]) for key in ("rpy", "xyz")]
            more = np.asarray(origins[str(element.get("name"))])
            place = pin.SE3(pin.rpy.rpyToMatrix(own[0]), own[1])
            place = place * pin.SE3(pin.rpy.rpyToMatrix(more[3:]), more[:3])
            origin.set("rpy", numbers(pin.rpy.matrixToRpy(place.rotation)))
            origin.set("xyz", numbers(place.translation))
    return ElementTree.tostring(root, encoding="unicode")
