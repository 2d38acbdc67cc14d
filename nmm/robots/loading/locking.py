"""Joints fixed at a value: those that the caller names, and those that follow them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.arrays import scalar
from nmm.errors import InputError, RobotError, unknown
from nmm.robots.loading.chain import CHAIN, Rebuilt
from nmm.robots.loading.check_mimics import Mimic
from nmm.robots.loading.reduction import reduced

# Limits are decimal fractions of angles that are none.
_SLACK = 1e-9


@dataclass(frozen=True)
class Locked:
    """A model with joints fixed.

    Attributes
    ----------
    rebuilt : the model, and notes on what was fixed
    values : where the named joints are fixed, rad or m
    followers : the joints that were fixed because they follow one of these: which, and where
    """

    rebuilt: Rebuilt
    values: Mapping[str, float]
    followers: Mapping[str, tuple[str, float]]


def with_locked(
    rebuilt: Rebuilt, lock: Mapping[str, float], mimics: Sequence[Mimic], where: str, own: Sequence[str] = ()
) -> Locked:
    """The model with joints fixed at their values, on the body above; they are no coordinates any more.

    Parameters
    ----------
    rebuilt : a model on the chain
    lock : values by joint, rad or m
    mimics : joints that follow one of these, or a fixed joint, each after the one that it follows
    where : what messages call the model
    own : the platform's own joints, as far as they are known: they cannot be locked

    Raises
    ------
    RobotError : a name that is no joint, a value that is no number or outside the joint's limits
    """
    model = rebuilt.model
    free = [str(name) for name in model.names][len(CHAIN) + 1 :]
    values = {name: _value(name, value, free, own, where) for name, value in lock.items()}
    for name, value in values.items():
        _check_limits(model, name, value, where, "")
    followers: dict[str, tuple[str, float]] = {}
    settled = dict(values)
    for mimic in mimics:
        # A leader that is no joint of the model is a fixed one, which stands at zero.
        value = mimic.multiplier * settled.get(mimic.leader, 0.0) + mimic.offset
        _check_limits(model, mimic.joint, value, where, f", which follows {mimic.leader}")
        followers[mimic.joint] = mimic.leader, value
        settled[mimic.joint] = value
    if not settled:
        return Locked(rebuilt, {}, {})
    q = np.zeros(model.nq)
    ids = [model.getJointId(name) for name in settled]
    for joint, value in zip(ids, settled.values(), strict=True):
        q[model.joints[joint].idx_q] = value
    lean, geometries = reduced(model, rebuilt.geometries, ids, q)
    notes = [*rebuilt.notes]
    if values:
        notes.append(f"locked joints: {', '.join(f'{name} at {at:g}' for name, at in values.items())}")
    if followers:
        sentences = (f"{name} at {at:g} (follows {leader})" for name, (leader, at) in followers.items())
        notes.append(f"locked with the joint that they follow: {', '.join(sentences)}")
    return Locked(Rebuilt(lean, geometries, tuple(notes)), values, followers)


def _value(name: str, value: float, free: Sequence[str], own: Sequence[str], where: str) -> float:
    if name not in free or name in own:
        raise RobotError(unknown("joint to lock", name, [joint for joint in free if joint not in own], where))
    try:
        return scalar(value, f"lock: {name}")
    except InputError as error:
        raise RobotError(f"{where}: {error}") from None


def _check_limits(model: pin.Model, name: str, value: float, where: str, more: str) -> None:
    index = model.joints[model.getJointId(name)].idx_q
    lower, upper = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
    if not lower - _SLACK <= value <= upper + _SLACK:
        raise RobotError(
            f"{where}: lock: {name}{more}: {value:g} is outside its limits, from {lower:g} to {upper:g}"
        )
