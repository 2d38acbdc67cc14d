"""Whether a reference sits at one place on the robot in all drives, and in all their pieces."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.fit import Fit
from nmm.plugins.robot.calibration.innovations import BEGINS, TAKEN
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.parameters import MOUNT

#: A reference was moved on the robot by more, m or rad, and by more of its deviations.
MOVED, CERTAIN = 0.03, 8.0
#: Looks of a piece that tell where a reference is.
SOME = 20


def check_mounting(model: Model, fitted: Fit, where: str) -> None:
    """`InputError` where the reference sits elsewhere on the robot in a piece of a drive than in the others:
    the numbers would be of neither."""
    names = [name for name in MOUNT if model.index(name) in fitted.free]
    pieces = [
        replace(drive, at=drive.at[a:b], z=drive.z[a:b], taken=drive.taken[a:b])
        for drive in model.with_looks
        for a, b in pairwise([*np.flatnonzero(drive.taken == BEGINS).tolist(), len(drive.at)])
        if np.count_nonzero(drive.taken[a:b] == TAKEN) >= SOME
    ]
    if len(pieces) < 2 or not names:
        return
    free, told = [model.index(name) for name in names], []
    for piece in pieces:
        one = model.of([piece])
        made = one.filtered(fitted.values, free, one.stretched(fitted.values, free), fitted.noise)[0]
        rows = made.taken
        W = made.W[rows].reshape(-1, len(free))
        known = np.linalg.pinv(W.T @ W, rcond=1e-9, hermitian=True)
        by = -known @ W.T @ made.w[rows].reshape(-1)
        seen = np.diag(W.T @ W) > 0.0
        told.append((by, np.where(seen, np.sqrt(np.diag(known)), math.inf), len(piece.at)))
    most = max(range(len(told)), key=lambda k: told[k][2])
    for piece, (by, deviation, _) in zip(pieces, told, strict=True):
        off = by - told[most][0]
        sure = np.abs(off) > CERTAIN * np.hypot(deviation, told[most][1])
        for name, far, certain in zip(names, off.tolist(), sure.tolist(), strict=True):
            if certain and abs(far) > MOVED:
                unit = "rad" if name == MOUNT[2] else "m"
                what = f"from {piece.at[0]:.4g} s on {name} is {far:+.2g} {unit} beside what it is elsewhere"
                expected = "a reference that stays where it is on the robot: drives, or parts, for themselves"
                raise InputError(what, where=f"{where}: {piece.name}", expected=expected)
