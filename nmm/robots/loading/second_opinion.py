"""What another reader of URDF makes of a description: yourdfpy, which shares no code with Pinocchio."""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.words import one_line

#: Largest difference of placements, m and of rotation matrices' entries.
SAME = 1e-6
_LOGGER = "yourdfpy.urdf"
_DEFAULTED = re.compile(r"<limit> of joint is missing attribute '(lower|upper)'")


def second_opinion(xml: str) -> list[str]:
    """Where yourdfpy refuses the description, or puts a link elsewhere than Pinocchio does; or none.

    Parameters
    ----------
    xml : URDF text, without problems and without mimic joints that matter; meshes are not read
    """
    try:
        import yourdfpy
    except ImportError as error:
        return [f"yourdfpy, for a second opinion, is not there: {error}"]
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
    model = pin.buildModelFromXML(xml, mimic=True)
    data = model.createData()
    q = pin.neutral(model)
    rng = np.random.default_rng(1)
    cfg: dict[str, float] = {}
    for name in other.actuated_joint_names:
        joint = model.joints[model.getJointId(name)]
        limit = other.joint_map[name].limit
        bounded = limit is not None and limit.lower is not None and limit.upper is not None
        low, high = (limit.lower, limit.upper) if bounded and joint.nq == 1 else (-1.0, 1.0)
        cfg[name] = value = float(rng.uniform(max(low, -3.0), min(high, 3.0))) if low < high else float(low)
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
