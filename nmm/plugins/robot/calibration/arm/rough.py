"""Where an arm's calibration begins: mounts by closed forms, and why an arm does not fit at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.origins import PARTS
from nmm.plugins.robot.calibration.arm.causes import expected_instead
from nmm.plugins.robot.calibration.arm.guess import TRIES, board_poses, first_mounts
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.placements import inverse, parts_of
from nmm.plugins.robot.calibration.arm.residuals import PLACE, TURN
from nmm.plugins.robot.calibration.arm.sightings import WORLD
from nmm.plugins.robot.calibration.arm.solving import robust
from nmm.plugins.robot.calibration.arm.view import Block

#: What residuals are within before anything is known: m and rad, and of pixels a share of the focal length.
START = {PLACE: 0.005, TURN: 0.01}
START_SHARE = 0.003
#: Where one part explains so little of what two leave, there are two.
MUCH = 1.0 / 3.0
#: A base that moved is sought at so many samples, each with so many before and behind it.
TRIALS, LEAST = 24, 6
#: Beyond this pitch, rad, angles of a mount are counted from where it is.
STEEP = 1.2


def start_noise(model: ArmModel) -> Array:
    """(g,): what residuals of each group may be at first."""
    made = []
    for i, kind in model.groups:
        camera = model.views[i].log.camera
        made.append(START_SHARE * camera.fx if camera is not None else START[kind])
    return np.array(made)


def poses_of(model: ArmModel) -> list[Array | None]:
    """Of each log the poses that were seen; None where points were."""
    made: list[Array | None] = []
    for view in model.views:
        log = view.log
        made.append(board_poses(log) if log.kind == "corners" else log.seen if log.kind == "poses" else None)
    return made


def with_mounts(
    model: ArmModel,
    values: Array,
    held: Mapping[int, float],
    poses: Sequence[Array | None] | None = None,
    tries: int = TRIES,
) -> Array:
    """Values with mounts by closed forms, log after log: what one log has told is known to the next."""
    values, known = values.copy(), {*held}
    poses = poses_of(model) if poses is None else poses
    for view, seen in zip(model.views, poses, strict=True):
        free = [
            [i for b in side for i in b.numbers.values() if i not in known]
            for side in (view.sensor, view.target)
        ]
        if view.log.kind == "points" and not view.target[-1].numbers:
            continue
        mounted = [model.mounted(side, values) for side in (view.sensor, view.target)]
        S, T = (None if some else at for some, at in zip(free, mounted, strict=True))
        result = first_mounts(view.log, model.nominal(view, values), seen, S, T, tries)
        if result is None:
            continue
        for side, at in ((view.sensor, result.sensor), (view.target, result.target)):
            _put(model, side, at, values, known)
    return values


def _put(model: ArmModel, side: Sequence[Block], at: Array, values: Array, known: set[int]) -> None:
    """Give the last block of a side that is not known what makes the side stand there."""
    free = [k for k, block in enumerate(side) if any(i not in known for i in block.numbers.values())]
    if not free:
        return
    k = free[-1]
    ahead, behind = (model.mounted(blocks, values) for blocks in (side[:k], side[k + 1 :]))
    own, block = inverse(ahead) @ at @ inverse(behind), side[k]
    whole = len(block.numbers) == 6 and not any(i in known for i in block.numbers.values())
    parts = parts_of(own)
    model.turns.pop(block.name, None)
    if whole and abs(parts[4]) > STEEP:
        model.turns[block.name] = own[:3, :3].copy()
        parts[3:] = 0.0
    for part, i in block.numbers.items():
        if i not in known:
            values[i] = parts[PARTS.index(part)]
        known.add(i)


def rough(model: ArmModel, values: Array, held: Mapping[int, float]) -> tuple[Array, float]:
    """Mounts and zeros that are least off, robustly, and how far they are off: see `offs`."""
    free = [
        i
        for i, number in enumerate(model.learned)
        if number.role in ("mount", "frame", "offset") and i not in held
    ]
    noise, scales = start_noise(model), model.scales[free]
    zeros = np.array([model.learned[i].role == "offset" for i in free], dtype=float)
    pull = np.diag(zeros / (3.0 * scales) + (1.0 - zeros) * 1e-3)
    if free:
        values = robust(model, values, free, noise, pull, values[free], 2, most=12)
    return values, float(offs(model, values).max())


def offs(model: ArmModel, values: Array) -> Array:
    """Of each group half of the residuals, in units of `start_noise`; 0 where nothing of it is taken."""
    rows = model.rows(values)
    own = [np.abs(rows.r[rows.group == g]) / noise for g, noise in enumerate(start_noise(model))]
    return np.array([float(np.median(some)) if len(some) else 0.0 for some in own])


def _refuse(
    model: ArmModel, values: Array, held: Mapping[int, float], poses: Sequence[Array | None], off: float
) -> None:
    """`InputError` for an arm that what was seen is not of."""
    view = model.views[0]
    if view.log.kind == "corners":
        assert view.log.camera is not None
        much = f"{off * START_SHARE * view.log.camera.fx:.3g} px"
    else:
        much = f"{1e3 * off * START[PLACE]:.3g} mm"
    if k := _split(model, values, held, poses):
        what = f"the base, or what stands in the world, seems to have moved before sample {k}"
        raise InputError(
            what, where=model.where, expected="a base that stands still, or base= where it stood"
        )
    what = f"the arm by its readings and what was seen disagree by {much}, wherever things are mounted"
    expected = expected_instead(view.log, model.nominal(view, values), poses[0])
    raise InputError(what, where=model.where, expected=expected)


def _split(model: ArmModel, values: Array, held: Mapping[int, float], poses: Sequence[Array | None]) -> int:
    """The sample at which what stands in the world seems to have moved, where both parts of the first log fit
    by themselves and not together; 0 where they do not."""
    view, seen, several = model.views[0], poses[0], len(model.views[0].log)
    if view.base is not None or WORLD not in (view.log.by, view.log.on):
        return 0
    F = model.nominal(view, values)

    def off(first: int, last: int) -> float:
        some = None if seen is None else seen[first:last]
        result = first_mounts(view.log.part(first, last), F[first:last], some, None, None, tries=0)
        return np.inf if result is None else result.off

    if several <= 2 * LEAST:
        return 0
    at = np.unique(np.linspace(LEAST, several - LEAST, TRIALS).astype(int)).tolist()
    offs = {k: max(off(0, k), off(k, several)) for k in at}
    near = min(offs, key=lambda k: offs[k])
    for k in range(max(LEAST, near - 3), min(several - LEAST, near + 3) + 1):
        offs[k] = max(off(0, k), off(k, several))
    best = min(offs, key=lambda k: offs[k])
    return best if offs[best] < MUCH * off(0, several) else 0
