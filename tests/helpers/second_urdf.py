"""URDF by yourdfpy, which shares no code with Pinocchio or nmm."""

from __future__ import annotations

import io
import logging
from xml.etree import ElementTree

import yourdfpy

from nmm.model.robots.loading.check import check_mimics
from nmm.model.robots.loading.xml_tree import Attributes, children, parse
from nmm.model.robots.mimic_joints import first_leaders


def read_by_yourdfpy(xml: str) -> yourdfpy.URDF:
    """With every mimic joint by a joint that follows nobody: yourdfpy reads no chains of them."""
    root = ElementTree.fromstring(xml)
    found = {
        one.joint: one
        for one in first_leaders(check_mimics(children(parse(xml), "joint"), Attributes(), Attributes()))
    }
    for element in root.iterfind("joint"):
        one, mimic = found.get(element.get("name", "")), element.find("mimic")
        if one is not None and mimic is not None:
            numbers = {"multiplier": repr(one.multiplier), "offset": repr(one.offset)}
            mimic.attrib = {"joint": one.leader, **numbers}
        elif mimic is not None:
            element.remove(mimic)  # its leader is no joint
    logging.getLogger("yourdfpy.urdf").setLevel(logging.ERROR)
    return yourdfpy.URDF.load(io.BytesIO(ElementTree.tostring(root)), load_meshes=False)
