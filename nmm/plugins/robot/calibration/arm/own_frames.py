"""Whether a robot's own frame, whose place is learned, is the one that sees or is seen."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.origins import ORIGIN, PARTS
from nmm.plugins.robot.calibration.arm.chain import Chain
from nmm.plugins.robot.calibration.arm.fit import ArmFit
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.placements import inverse, placed, rotation_vectors
from nmm.plugins.robot.calibration.arm.view import Block

#: A frame that stands farther from where it was, m and rad, is another one.
FAR, TURNED = 0.1, 0.3
#: Another one fits where it is so near, m and rad.
NEAR, ALIKE = 0.05, 0.05


def check_frames(model: ArmModel, fitted: ArmFit, held: Mapping[int, float]) -> None:
    """`InputError` for a frame that would stand elsewhere than it did, with the one that would fit; where
    numbers of it are held at values, it counts from these."""
    before = model.first.copy()
    for i, value in held.items():
        before[i] = value
    after, unknown = model.stated(fitted.values), {*fitted.unseen, *fitted.same}
    for view in model.views:
        sides = (("by", "sensor", view.sensor[0]), ("on", "target", view.target[0]))
        for end, (side, carried, block) in enumerate(sides):
            if not block.name.startswith(ORIGIN) or unknown & {*block.numbers.values()}:
                continue
            at = _placed(block, after)
            off = _apart(inverse(_placed(block, before)) @ at)
            if off[0] < FAR and off[1] < TURNED:
                continue
            name = block.name.removeprefix(ORIGIN)
            what = f"{name} would stand {_told(off)} from where it was"
            other, near = _nearest(model, view.chain, end, at, name)
            fits = f"{side}='{other}', which fits within {_told(near)}, or " if other else ""
            expected = f"{fits}{carried}= a name for what {name} only carries"
            if not fits:
                expected += f", or about where it is: nmm.with_numbers, origin.{name}.x, ..."
            raise InputError(what, where=f"{model.where}: {view.log.name}", expected=expected)


def _placed(block: Block, values: Array) -> Array:
    return placed(np.array([values[block.numbers[part]] for part in PARTS]))


def _apart(at: Array) -> tuple[float, float]:
    """How far, m and rad, something at (4, 4) is."""
    turn = rotation_vectors(at[np.newaxis, :3, :3])[0]
    return float(np.linalg.norm(at[:3, 3])), float(np.linalg.norm(turn))


def _told(apart: tuple[float, float]) -> str:
    return f"{round(apart[0], 3):g} m and {round(apart[1], 3):g} rad"


def _nearest(
    model: ArmModel, chain: Chain, end: int, at: Array, name: str
) -> tuple[str, tuple[float, float]]:
    """The frame, fixed to the same joint, that is nearest to where a frame's place is learned to be, by names
    of links first, and how far it is; "" where none is near."""
    parent, file = chain.ends[end]
    robot, fitting = model.robot, []
    for other in robot.frames:
        frame = robot.model.frames[robot.frame_id(other)]
        if int(frame.parentJoint) == parent and other != name:
            apart = _apart(inverse(file @ at) @ frame.placement.homogeneous)
            if apart[0] < NEAR and apart[1] < ALIKE:
                link = frame.type == pin.FrameType.BODY
                fitting.append((round(apart[1] + apart[0], 6), not link, other, apart))
    return min(fitting)[2:] if fitting else ("", (0.0, 0.0))
