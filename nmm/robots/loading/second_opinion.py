"""What another reader of URDF makes of a description: yourdfpy, which shares no code with Pinocchio."""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from nmm.robots.followers import first_leaders, settled
from nmm.robots.loading.check_mimics import check_mimics
from nmm.robots.loading.findings import Findings, children
from nmm.robots.loading.xml_tree import parse
from nmm.words import one_line

#: Largest difference of placements, m and of rotation matrices' entries.
SAME = 1e-6
_LOGGER = "yourdfpy.urdf"
_DEFAULTED = re.compile(r"<limit> of joint is missing attribute '(lower|upper)'")


def second_opinion(xml: str) -> list[str]:
    """Where yourdfpy refuses the description, or puts a link elsewhere than Pinocchio does; or none.

    Parameters
    ----------
    xml : URDF text, without problems; meshes are not read
    """
    try:
        import yourdfpy
    except ImportError as error:
        return [f"yourdfpy, for a second opinion, is not there: {error}"]
    xml = _without_chains(xml)
    with _quiet() as said:
        try:
            other = yourdfpy.URDF.load(io.BytesIO(xml.encode("utf-8")), load_meshes=False)
            valid = other.validate()
            other_errors = [one_line(str(error), 160) for error in other.errors]
            differing = list(_differences(xml, other))
        except Exception as error:  # whatever it stumbles over
            return [f"yourdfpy cannot read it: {type(error).__name__}: {one_line(str(error), 160)}"]
    # It asks for limits that the standard gives a default; `advice` tells where that default is no good.
    texts = [] if valid else [text for text in other_errors if not _DEFAULTED.search(text)]
    reported = dict.fromkeys([*texts, *(one_line(text, 160) for text in said)])
    return [*(f"yourdfpy: {text}" for text in reported), *differing]


def _differences(xml: str, other: Any) -> Iterator[str]:
    """Links whose placements in the root link differ, at one configuration with every joint moved."""
    model = pin.buildModelFromXML(xml)
    data = model.createData()
    q = pin.neutral(model)
    rng = np.random.default_rng(1)
    cfg: dict[str, float] = {}
    for name in other.actuated_joint_names:
        limit = other.joint_map[name].limit
        bounded = limit is not None and limit.lower is not None and limit.upper is not None
        single = model.joints[model.getJointId(name)].nq == 1
        low, high = (limit.lower, limit.upper) if bounded and single else (-1.0, 1.0)
        cfg[name] = float(rng.uniform(max(low, -3.0), min(high, 3.0))) if low < high else float(low)
    followers = check_mimics(children(parse(xml), "joint"), Findings())
    fixed = {one.leader: 0.0 for one in followers if not model.existJointName(one.leader)}
    following = settled(followers, {**fixed, **cfg})[0]
    for name, value in {**cfg, **{name: value for name, (_, value) in following.items()}}.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    other.update_cfg(cfg)
    pin.framesForwardKinematics(model, data, q)
    for name in other.link_map:
        frame = model.getFrameId(name, pin.FrameType.BODY)
        ours, theirs = data.oMf[frame].homogeneous, other.get_transform(name)
        if np.abs(ours - theirs).max() > SAME:
            apart = np.linalg.norm(ours[:3, 3] - theirs[:3, 3])
            yield (
                f"Pinocchio and yourdfpy read it differently: link {name!r} is {apart:.3g} m apart, or "
                "turned (an axis that is no unit vector?)"
            )
            return


def _without_chains(xml: str) -> str:
    """The same with every follower by a joint that follows nobody: yourdfpy reads no chains of them."""
    followers = check_mimics(children(parse(xml), "joint"), Findings())
    if first_leaders(followers) == followers:
        return xml
    root = ElementTree.fromstring(xml)
    found = {one.joint: one for one in first_leaders(followers)}
    for joint in root.iterfind("joint"):
        one, mimic = found.get(joint.get("name", "")), joint.find("mimic")
        if one is not None and mimic is not None:
            numbers = {"multiplier": repr(one.multiplier), "offset": repr(one.offset)}
            mimic.attrib = {"joint": one.leader, **numbers}
    return ElementTree.tostring(root, encoding="unicode")


@contextmanager
def _quiet() -> Iterator[list[str]]:
    """What yourdfpy logs, in a list and not on the terminal."""
    said: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.levelno >= logging.WARNING:
                said.append(record.getMessage())

    logger, listener = logging.getLogger(_LOGGER), Listener()
    propagated, logger.propagate = logger.propagate, False
    logger.addHandler(listener)
    try:
        yield said
    finally:
        logger.removeHandler(listener)
        logger.propagate = propagated
