"""What Pinocchio gets in place of parts with faults that kinematics does not feel, but its reader does."""

from xml.etree import ElementTree

from nmm.robots.loading.check_parts import MOMENTS, check_inertial, check_material
from nmm.robots.loading.xml_tree import NOBODY, Attributes, Element, child, children

#: A limit that counts as none.
NO_LIMIT = "1.7976931348623157e+308"


def inertials(link: Element) -> list[ElementTree.Element]:
    """The link's inertia: without moments where they are wrong, none where the mass or its place is."""
    inertial, reader = child(link, "inertial"), Attributes()
    if inertial is None:
        return []
    check_inertial(inertial, NOBODY, reader)
    faulty = {one.values.get("missing", one.values["element"]) for one in reader.found}
    if not faulty:
        return [inertial]
    if faulty != {"inertia"}:
        return []
    copied = ElementTree.Element("inertial")
    copied.extend(part for part in inertial if part.tag in ("origin", "mass"))
    ElementTree.SubElement(copied, "inertia", dict.fromkeys(MOMENTS, "0"))
    return [copied]


def limit(given: Element) -> ElementTree.Element:
    """A joint's limits, without those of effort and velocity that are missing or wrong."""
    copied = ElementTree.Element("limit", given.attrib)
    for attribute in ("effort", "velocity"):
        if Attributes().number(given, attribute, minimum=0.0) is None:
            copied.set(attribute, NO_LIMIT)
    return copied


def materials(parent: Element) -> list[Element]:
    """Those of a robot or of a shape that can be read."""
    found = []
    for material in children(parent, "material"):
        reader = Attributes()
        check_material(material, NOBODY, reader)
        if not reader.found:
            found.append(material)
    return found


def with_shape(part: Element, shape: ElementTree.Element) -> ElementTree.Element:
    """A visual or collision part with that shape, without materials that cannot be read."""
    copied = ElementTree.Element(part.tag, part.attrib)
    copied.extend(children(part, "origin"))
    ElementTree.SubElement(copied, "geometry").append(shape)
    copied.extend(materials(part))
    return copied
