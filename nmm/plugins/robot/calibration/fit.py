"""The numbers of greatest likelihood, the noise, and what the drives do not show."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration import shown
from nmm.plugins.robot.calibration.filtered import DriveNoise, Filtered
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.parameters import CLOCK, DELAY
from nmm.plugins.robot.calibration.screening import SCREENS, begin_again, plain_jumps, rejoin, screened

#: What is taken for noise at first, and the range in which it is sought. (What hitches turn by themselves is
#: at least about what steps of an encoder of 16 bits are.)
FIRST = DriveNoise(
    place=0.01,
    heading=0.02,
    counters=0.02,
    across=0.01,
    turns=0.01,
    agreement=0.02,
    following=0.01,
    jitter=1e-3,
)
LEAST = DriveNoise(
    place=2e-5,
    heading=2e-5,
    counters=1e-4,
    across=1e-4,
    turns=1e-4,
    agreement=2e-3,
    following=5e-5,
    jitter=1e-5,
)
#: Of where drives end: how well a robot is put on its marks, m and rad, and its slip.
OF_ENDS = {"place": 0.002, "heading": 0.005, "across": 1e-4, "turns": 1e-4}
MOST = DriveNoise(
    place=3.0, heading=1.0, counters=1.0, across=1.0, turns=1.0, agreement=1.0, following=1.0, jitter=0.2
)
#: While outliers are sought, numbers stay about within so many times what is plausible.
PRIOR = 1.0
#: Below so many innovations a number, noise is judged with the numbers that were learned from them
#: (restricted likelihood); below more at last, where that is done once.
FEW, FEW_AT_LAST = 100, 400
#: Steps of least squares end when no number moves by such a share of its deviation.
SMALL, STEPS = 0.02, 25
#: They also end when twice the logarithm of the likelihood gains less.
ENOUGH = 1e-3
#: Rows that are factorised at once.
ROWS = 2048


@dataclass(eq=False)
class Fit:
    """values (n,), free : the numbers that were learned, their covariance (f, f), noise, innovations;
    unseen : each number that is held since the drives do not show it, with the others that would make up
    for it."""

    values: Array
    free: list[int]
    covariance: Array
    noise: DriveNoise
    filtered: list[Filtered]
    unseen: dict[int, list[int]] = field(default_factory=dict)

    @property
    def deviations(self) -> Array:
        return np.sqrt(np.diag(self.covariance))


Progress = Callable[[str], None]


def fit(
    model: Model,
    held: Mapping[int, float],
    progress: Progress = lambda _: None,
    like: Fit | None = None,
) -> Fit:
    """The numbers but for those held, which keep their values; from those of another fit on, with its noise
    and the looks that it left out."""
    values = model.first.copy() if like is None else like.values.copy()
    for i, value in held.items():
        values[i] = value
    scale = _scale(model, held) if model.closed else []
    sought = [i for i in range(len(values)) if i not in held and i not in scale[-1:]]
    level = FIRST if like is None else like.noise
    if like is None:
        for turn in range(SCREENS):  # what is shown is judged when no outliers are left
            progress(f"outliers, {turn + 1} of {SCREENS} at most")
            values = solve(model, values, sought, level, prior=PRIOR)
            if turn == 0 and plain_jumps(model, values, level):
                values = solve(model, values, sought, level, prior=PRIOR)
            level = noise_of(model, values, sought, level)
            if turn == 1:
                rejoin(model, values, level)
            begun = model.begun
            if not screened(model, values, level) and turn > 0:
                break
            if model.begun > begun:
                begin_again(model, values)
                level = FIRST
    unseen: dict[int, list[int]] = {}
    free = sought
    for turn in range(2):
        lost = hidden(model, values, free, level)
        if all(drive.ends for drive in model.drives):
            lost = together(lost)
        for i in lost:
            values[i] = 0.0 if model.learned[i].kind == DELAY else model.first[i]
        unseen |= lost
        free = [i for i in free if i not in lost]
        progress(f"least squares, {turn + 1} of 2")
        values = solve(model, values, free, level)
        if like is None:
            level = noise_of(model, values, free, level, FEW_AT_LAST if turn else FEW)
    values = solve(model, values, free, level)
    filtered = model.filtered(values, free, model.stretched(values, free), level)
    w, W = stacked(filtered, len(free))
    share = (
        float(w @ w) / max(sum(drive_fit.count for drive_fit in filtered) - len(free), 1)
        if like is None
        else 1.0
    )
    covariance = np.asarray(np.linalg.pinv(W.T @ W, hermitian=True) * max(share, 1.0), dtype=np.float64)
    filtered = [drive_fit.without_slopes() for drive_fit in filtered]
    fitted = Fit(values, free, covariance, level, filtered, unseen)
    if not scale:
        return fitted
    if {*scale[:-1]} <= {*free}:
        return with_mean_radius(model, fitted, scale)
    unseen[scale[-1]] = scale[:-1]
    return fitted


def _scale(model: Model, held: Collection[int]) -> list[int]:
    """Numbers that closed drives tell but for their common scale: radii, and lengths last; none where one is
    held, which tells the scale."""
    radii = [i for i, number in enumerate(model.learned) if number.kind == "radius"]
    lengths = [i for i, number in enumerate(model.learned) if number.unit == "m" and i not in radii]
    known = any(i in held for i in (*radii, *lengths))
    return [*radii, *lengths] if radii and lengths and not known else []


def with_mean_radius(model: Model, fitted: Fit, scale: Sequence[int]) -> Fit:
    """The fit of closed drives with all lengths larger or smaller by so much that the mean of radii stays:
    it is known better than a track. (The last of `scale` was held until then.)"""
    free = sorted({*fitted.free, scale[-1]})
    radii = [i for i in scale if model.learned[i].kind == "radius"]
    before, mean = float(model.first[radii].mean()), float(fitted.values[radii].mean())
    values = fitted.values.copy()
    values[[*scale]] *= before / mean
    slopes = np.zeros((len(free), len(fitted.free)))
    for row, i in enumerate(free):
        share = before / mean if i in scale else 1.0
        for column, j in enumerate(fitted.free):
            slopes[row, column] = share if i == j else 0.0
            if i in scale and j in radii:
                slopes[row, column] -= values[i] / mean / len(radii)
    return replace(fitted, values=values, free=free, covariance=slopes @ fitted.covariance @ slopes.T)


def stacked(filtered: Sequence[Filtered], f: int) -> tuple[Array, Array]:
    """w (R,) and W (R, f), R <= f + 1, of which squares and products are those of all rows: of the looks
    that were taken, and of what is known beside them. (The triangle of a QR factorisation, by some rows.)"""
    triangle = np.zeros((0, f + 1))
    for drive_fit in filtered:
        looks = drive_fit.w.reshape(-1), drive_fit.W.reshape(-1, drive_fit.W.shape[2])
        taken = np.repeat(drive_fit.taken, drive_fit.w.shape[1])
        sides = [
            (part.over, part.slopes, part.weights) for part in (drive_fit.agreement, drive_fit.following)
        ]
        for over, slopes, weights in ((*looks, taken.astype(np.float64)), *sides):
            for first in range(0, len(over), ROWS):
                some = slice(first, first + ROWS)
                rows = np.column_stack([slopes[some, :f] * weights[some, np.newaxis], over[some]])
                rows = rows[weights[some] > 0.0]
                factors: Any = np.linalg.qr(np.concatenate([triangle, rows]), mode="r")
                triangle = factors
    return triangle[:, f].copy(), triangle[:, :f].copy()


def solve(
    model: Model, values: Array, free: list[int], noise: DriveNoise, prior: float = 0.0, steps: int = STEPS
) -> Array:
    """Least squares by Gauss and Newton's steps, halved where they lead up, so many at most; with a prior,
    numbers stay within so many times what is plausible."""
    if not free:
        return values
    scales = model.scales[free]
    pull = np.diag(1.0 / (prior * scales)) if prior else np.zeros((0, len(free)))

    def cost_of(at: Array) -> float:
        off = pull @ (at - model.first)[free]
        filtered = model.filtered(at, [], model.stretched(at, []), noise)
        return float(off @ off) - 2.0 * sum(drive_fit.log_likelihood for drive_fit in filtered)

    cost = cost_of(values)
    for _ in range(steps):
        w, W = stacked(model.filtered(values, free, model.stretched(values, free), noise), len(free))
        w = np.concatenate([w, pull @ (values - model.first)[free]])
        step = -scales * np.linalg.lstsq(np.concatenate([W, pull]) * scales, w, rcond=1e-12)[0]
        step *= min(1.0, 1.0 / np.max(np.abs(step) / (3.0 * scales)))
        if float(np.sum((W @ step) ** 2)) < SMALL**2:
            break
        for _ in range(12):
            trial = values.copy()
            trial[free] += step
            with suppress(InputError):  # a length below zero
                new = cost_of(trial)
                if new < cost:  # not so for a number that is none
                    break
            step = 0.5 * step
        else:
            break
        values, gained, cost = trial, cost - new, new
        if gained < ENOUGH:
            break
    return values


def noise_of(
    model: Model, values: Array, free: Sequence[int], first: DriveNoise, few: int = FEW
) -> DriveNoise:
    """The noise of greatest likelihood at these numbers; of drives of which only the ends are known that of
    the counters alone. Counters err no less than those of one robot disagree. With less than `few`
    innovations a number it is that of what the free numbers leave (D. A. Harville, Maximum likelihood
    approaches to variance component estimation, JASA 72, 1977)."""
    model.put_beside(values)
    made = model.stretched(values, [])
    as_before = model.filtered(values, [], made, first)
    beside = [drive_fit.agreement for drive_fit in as_before]
    least = LEAST
    if spare := sum(part.free for part in beside):
        square = sum(float(part.over @ part.over) for part in beside)
        level = min(first.agreement * math.sqrt(square / spare), MOST.agreement)
        first = first._replace(agreement=max(level, LEAST.agreement))
        least = LEAST._replace(counters=max(level, LEAST.counters))
    looked = model.with_looks
    sought = ["counters", *(["place", "across", "turns", "jitter"] if looked else [])]
    if any(drive.rows == 3 for drive in looked):
        sought.append("heading")
    if any(drive.hitches for drive in model.drives):
        sought.append("following")
    if not looked:
        first = first._replace(**OF_ENDS)
    count = sum(np.count_nonzero(drive_fit.taken) * drive_fit.w.shape[1] for drive_fit in as_before)
    restricted = count < few * len(free)
    if restricted:
        made = model.stretched(values, free)

    def noise_at(logs: Array) -> DriveNoise:
        return first._replace(**dict(zip(sought, np.exp(logs).tolist(), strict=True)))

    def cost(logs: Array) -> float:
        filtered = model.filtered(values, free if restricted else [], made, noise_at(logs))
        value = -sum(drive_fit.log_likelihood for drive_fit in filtered)
        if restricted:
            scaled = stacked(filtered, len(free))[1] * model.scales[[*free]]
            value += 0.5 * float(np.linalg.slogdet(scaled.T @ scaled + np.eye(len(free)))[1])
        return value

    bounds = [(math.log(getattr(least, name)), math.log(getattr(MOST, name))) for name in sought]
    start = np.array(
        [
            math.log(min(max(getattr(first, name), 2.0 * getattr(LEAST, name)), 0.5 * getattr(MOST, name)))
            for name in sought
        ]
    )
    options: Any = {"maxiter": 40, "eps": 1e-4, "ftol": 1e-7}
    fitted = minimize(cost, start, method="L-BFGS-B", bounds=bounds, options=options)
    return noise_at(fitted.x)


def hidden(model: Model, values: Array, free: Sequence[int], noise: DriveNoise) -> dict[int, list[int]]:
    """Numbers that the drives do not show (`shown.hidden`)."""
    filtered = model.filtered(values, free, model.stretched(values, free), noise)
    _, W = stacked(filtered, len(free))
    kinds = [model.learned[i].kind for i in free]
    lost = shown.hidden(W, model.scales[[*free]], lambda j: _held_first(kinds[j]))
    return {free[j]: [free[i] for i in others] for j, others in lost.items()}


def together(lost: Mapping[int, list[int]]) -> dict[int, list[int]]:
    """The numbers that drives do not show, with those that they show only where others are exact: of ends
    alone nothing else tells these."""
    made = dict(lost)
    for i, others in lost.items():
        for j in others:
            made.setdefault(j, [i, *(other for other in others if other != j)])
    return made


def _held_first(kind: str) -> int:
    """Of numbers that are not told apart, those that are held rather than others."""
    order = ["radius", "scale", "offset", "track", "wheelbase", "left", "right"]
    return order.index(kind) if kind in order else len(order) + (kind in ("ratio", "reference", DELAY, CLOCK))
