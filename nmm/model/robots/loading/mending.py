"""What Pinocchio gets in place of parts with faults that kinematics does not feel, but its reader does."""

from collections.abc import Iterable
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from nmm.model.robots.loading.check_parts import MOMENTS, check_inertial, check_material
from nmm.model.robots.loading.xml_tree import NOBODY, QUATERNIONS, Attributes, Element, child, children

#: A limit that counts as none.
NO_LIMIT = "1.7976931348623157e+308"


def write_rpy(parents: Iterable[Element]) -> None:
    """Puts roll, pitch, yaw, rad, in place of the quaternions of these elements' origins."""
    for parent in parents:
        origin = child(parent, "origin")
        if origin is None or "quat_xyzw" not in origin.attrib:
            continue
        reader = Attributes(minor=QUATERNIONS)
        reader.origin(parent, NOBODY)
        text = origin.attrib.pop("quat_xyzw")
        if not reader.found:
            turn = np.array(text.split(), dtype=float)
            matrix = pin.Quaternion(turn / np.linalg.norm(turn)).matrix()
            text = " ".join(repr(round(float(angle), 17)) for angle in pin.rpy.matrixToRpy(matrix))
        origin.set("rpy", text)  # the four words of a faulty one are no angles: `inertials` leaves it out


def inertials(link: Element) -> list[ElementTree.Element]:
    """The link's inertia: without moments where they are wrong, none where the mass or its place is."""
    inertial, reader = child(link, "inertial"), Attributes()
    if inertial is None:
        return []
    check_inertial(inertial, NOBODY, reader)
    faulty = {finding.values.get("missing", finding.values["element"]) for finding in reader.found}
    if not faulty:
        return [inertial]
    if faulty != {"inertia"}:
        return []
    copied = ElementTree.Element("inertial")
    copied.extend(part for part in inertial if part.tag in ("origin", "mass"))
    ElementTree.SubElement(copied, "inertia", dict.fromkeys(MOMENTS, "0"))
    return [copied]


def limit(element: Element) -> ElementTree.Element:
    """A joint's limits, without those of effort and velocity that are missing or wrong."""
    copied = ElementTree.Element("limit", element.attrib)
    for attribute in ("effort", "velocity"):
        if Attributes().number(element, attribute, minimum=0.0) is None:
            copied.set(attribute, NO_LIMIT)
    return copied


def materials(parent: Element) -> list[Element]:
    """Those of a robot or of a shape that can be read."""
    readable = []
    for material in children(parent, "material"):
        reader = Attributes()
        check_material(material, NOBODY, reader)
        if not reader.found:
            readable.append(material)
    return readable


def with_shape(part: Element, shape: ElementTree.Element) -> ElementTree.Element:
    """A visual or collision part with that shape, without materials that cannot be read."""
    copied = ElementTree.Element(part.tag, part.attrib)
    copied.extend(children(part, "origin"))
    ElementTree.SubElement(copied, "geometry").append(shape)
    copied.extend(materials(part))
    return copied
