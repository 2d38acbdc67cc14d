"""Where many runs start: arrays or names, checked as a single run's start is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.errors import InputError

Start = ArrayLike | Mapping[str, float] | Sequence[Mapping[str, float]]


def checked_starts(controllers: Sequence[Controller], q0: Start) -> Array:
    """(B, n) of one controller, or of as many as there are; `InputError` names the run."""
    robot = controllers[0].robot
    if isinstance(q0, Mapping):
        found = robot.q(q0)[np.newaxis]
    elif isinstance(q0, Sequence) and any(isinstance(one, Mapping) for one in q0):
        found = np.array([robot.q(one) for one in q0])
    else:
        found = np.array(q0, dtype=np.float64)
        found = found[np.newaxis] if found.ndim == 1 else found
    if found.ndim != 2 or found.shape[1] != robot.n or not len(found):
        raise InputError(f"q0: expected at least one run, (B, {robot.n}) or ({robot.n},), got {found.shape}")
    if len(controllers) > 1:
        if len(found) not in (1, len(controllers)):
            raise InputError(
                f"q0: expected 1 or {len(controllers)} starts, one a controller, got {len(found)}"
            )
        found = np.broadcast_to(found, (len(controllers), robot.n)).copy()
    for k, q in enumerate(found):
        one = controllers[k if len(controllers) > 1 else 0]
        come_back = one.limits is not None and one.limits.position is not False
        try:
            robot.check_limits(robot.q(q), come_back=come_back)
        except InputError as error:
            raise InputError(f"run {k}: {error}") from None
        if one.setting is not None:
            one.setting.check_start(0.0, q)
    return robot.following.placed(found)
