"""Signs of joints that count the other way, and what else may be the wrong way round where an arm does not
fit: the axes of what sees, or what stands elsewhere in another log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.rough import _refuse, offs, poses_of, rough, with_mounts

#: Where half of the residuals of a log are so many times as large, an arm does not fit to what was seen; from
#: so many times on, signs are tried.
IMPOSSIBLE, DOUBTFUL = 5.0, 0.5
#: Signs that make it fit leave such a share of the residuals.
MUCH = 1.0 / 3.0
#: So many sets of signs are tried with zeros, those that are best without.
TRIED = 4
#: All sets of signs are tried of so many joints at most.
MOST = 8


def with_signs(model: ArmModel, values: Array, held: Mapping[int, float]) -> tuple[Array, list[str]]:
    """Values from which it fits, and the joints whose readings count the other way, where it fits better by
    far with them; `InputError` where nothing fits."""
    best, off = rough(model, values, held)
    if off < DOUBTFUL:
        return best, []
    joints = [*dict.fromkeys(c for view in model.views for c in view.chain.coordinates)]
    names = [model.robot.q_names[c] for c in joints]
    poses = poses_of(model)
    sizes = range(1, len(names) + 1) if len(names) <= MOST else range(1, 3)
    signs: list[str] = []
    least, turns = off, {**model.turns}
    for some in (sizes[:1], sizes[1:2], sizes[2:] if off > IMPOSSIBLE else ()):
        trials = []
        for flipped in (flips for size in some for flips in combinations(names, size)):
            model.flipped = {*flipped}
            made = with_mounts(model, values, held, poses, tries=0)
            trials.append((float(offs(model, made).max()), flipped))
        for _, flipped in sorted(trials)[:TRIED]:
            model.flipped = {*flipped}
            made, now = rough(model, with_mounts(model, values, held, poses), held)
            if now < MUCH * least:
                best, least, signs, turns = made, now, [*flipped], {**model.turns}
        if least < DOUBTFUL:
            break
        if some == sizes[:1]:
            _expect_right_handed(model, values, held, least)
    model.flipped = {*signs}
    model.turns.clear()
    model.turns.update(turns)
    if least >= IMPOSSIBLE:
        model.flipped = set()
        _expect_together(model, values, held, poses)
        _refuse(model, values, held, poses, off)
    return best, signs


def _expect_right_handed(model: ArmModel, values: Array, held: Mapping[int, float], off: float) -> None:
    """`InputError` where what was seen fits by far better with one of its axes the other way."""
    if all(view.log.kind == "corners" for view in model.views):
        return
    turned = [np.diag([*axis, 1.0]) for axis in ((1, 1, -1), (1, -1, 1), (-1, 1, 1))]
    for k, across in enumerate([(D, D) for D in turned[:1]] + [(D, np.eye(4)) for D in turned]):
        if k and all(view.log.kind == "points" for view in model.views):
            return
        other = _seen_as(model, *across)
        made = with_mounts(other, values, held)
        if rough(other, made, held)[1] < min(IMPOSSIBLE, MUCH * off):
            what = "the axes of what sees seem left-handed: mirrored, what it saw fits"
            expected = "right-handed axes (negate one), or readings of joints with the file's signs"
            raise InputError(what, where=model.where, expected=expected)


def _seen_as(model: ArmModel, left: Array, right: Array) -> ArmModel:
    """The model of what was seen with M (4, 4) as its place and turn left M right."""
    other = model.part([slice(0, len(view.log)) for view in model.views])
    other.turns, other.flipped = {}, set()
    for view in other.views:
        if view.log.kind == "points":
            object.__setattr__(view.log, "seen", view.log.seen @ left[:3, :3])
        elif view.log.kind == "poses":
            seen = left @ view.log.seen @ right
            if np.linalg.det(left @ right) < 0.0:  # places alone are mirrored
                seen[:, :3, :3] = view.log.seen[:, :3, :3]
            object.__setattr__(view.log, "seen", seen)
    return other


def _expect_together(
    model: ArmModel, values: Array, held: Mapping[int, float], poses: Sequence[Array | None]
) -> None:
    """`InputError` where each of several logs fits by itself, and not all of them together."""
    if len(model.views) < 2:
        return
    for view in model.views:
        one = model.part([slice(0, len(v.log) if v is view else 0) for v in model.views])
        one.turns, none = {}, np.zeros((0, 4, 4))
        seen = [at if at is None or v is view else none for v, at in zip(model.views, poses, strict=True)]
        if rough(one, with_mounts(one, values, held, seen), held)[1] >= IMPOSSIBLE:
            return
    names = [block.name for view in model.views for block in (*view.sensor, *view.target)]
    shared = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    what = f"each log fits by itself, and not together: {' or '.join(shared)} is elsewhere in one of them"
    raise InputError(
        what, where=model.where, expected="other names in it: sensor= or target=, or one log alone"
    )
