"""Joints fixed at a value: those that the caller names, and those that follow them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.arrays import scalar
from nmm.errors import InputError, RobotError, unknown
from nmm.robots.followers import Follower, first_leaders, settled
from nmm.robots.loading.chain import CHAIN, Rebuilt
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
    mimicked : the joints that were fixed because they follow one of these: which, and where
    followers : the others that follow a joint, each after the one that it follows
    """

    rebuilt: Rebuilt
    values: Mapping[str, float]
    mimicked: Mapping[str, tuple[str, float]]
    followers: tuple[Follower, ...]


def with_locked(
    rebuilt: Rebuilt,
    lock: Mapping[str, float],
    followers: Sequence[Follower],
    where: str,
    own: Sequence[str] = (),
    standing: Mapping[str, float] | None = None,
) -> Locked:
    """The model with joints fixed at their values, on the body above; they are no coordinates any more.

    Parameters
    ----------
    rebuilt : a model on the chain
    lock : values by joint, or by pattern, rad or m: see `load`
    followers : joints that follow others, each after the one that it follows
    where : what messages call the model
    own : the platform's own joints, as far as they are known: they cannot be locked
    standing : other joints to fix, of which nothing is said

    Raises
    ------
    RobotError : a name that is no joint, a value that is no number or outside the joint's limits
    """
    model = rebuilt.model
    free = [str(name) for name in model.names][len(CHAIN) + 1 :]
    lock = _named(lock, [name for name in free if name not in own], followers, where)
    values = {name: _value(name, value, free, own, where) for name, value in lock.items()}
    for name, value in values.items():
        _check_limits(model, name, value, where, "")
    followers = [one for one in followers if one.joint not in lock]  # what is locked follows nobody
    # A leader that is no joint of the model is a fixed one, which stands at zero.
    fixed = {one.leader: 0.0 for one in followers if one.leader not in free}
    standing = {**(standing or {}), **values}
    mimicked, moving = settled(followers, {**fixed, **standing})
    for name, (leader, value) in mimicked.items():
        _check_limits(model, name, value, where, f", which follows {leader}")
    still = {**standing, **{name: value for name, (_, value) in mimicked.items()}}
    if not still:
        return Locked(rebuilt, {}, {}, moving)
    q = np.zeros(model.nq)
    ids = [model.getJointId(name) for name in still]
    for joint, value in zip(ids, still.values(), strict=True):
        q[model.joints[joint].idx_q] = value
    lean, geometries = reduced(model, rebuilt.geometries, ids, q)
    notes = [*rebuilt.notes]
    if values:
        notes.append(f"locked joints: {', '.join(f'{name} at {at:g}' for name, at in values.items())}")
    if mimicked:
        sentences = (f"{name} at {at:g} (follows {leader})" for name, (leader, at) in mimicked.items())
        notes.append(f"locked with the joint that they follow: {', '.join(sentences)}")
    return Locked(Rebuilt(lean, geometries, tuple(notes)), values, mimicked, moving)


def _named(
    lock: Mapping[str, float], free: Sequence[str], followers: Sequence[Follower], where: str
) -> dict[str, float]:
    """Values by joint: of a pattern's joints those that are not named themselves, and follow none of them."""
    leaders = {one.joint: one.leader for one in first_leaders(followers)}
    found: dict[str, float] = {}
    for key, value in lock.items():
        if not is_pattern(key):
            continue
        pattern = re.compile(re.escape(key).replace(r"\*", ".*").replace(r"\?", "."))
        matched = [name for name in free if pattern.fullmatch(name)]
        if not matched:
            raise RobotError(f"{where}: lock: no joint matches {key!r}; joints: {', '.join(free)}")
        found |= {name: value for name in matched if leaders.get(name) not in matched}
    return found | {key: value for key, value in lock.items() if not is_pattern(key)}


def is_pattern(name: object) -> bool:
    """Whether a name of a joint to lock stands for several: * for any letters, ? for one."""
    return isinstance(name, str) and ("*" in name or "?" in name)


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
