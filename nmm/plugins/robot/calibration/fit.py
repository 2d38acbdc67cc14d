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
from nmm.plugins.robot.calibration.innovations import BEGINS, LEFT_OUT, TAKEN
from nmm.plugins.robot.calibration.model import DriveNoise, Filtered, Model
from nmm.plugins.robot.calibration.parameters import CLOCK, DELAY

#: What is taken for noise at first, and the range in which it is sought.
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
    following=1e-4,
    jitter=1e-5,
)
#: Of where drives end: how well a robot is put on its marks, m and rad, and its slip.
OF_ENDS = {"place": 0.002, "heading": 0.005, "across": 1e-4, "turns": 1e-4}
MOST = DriveNoise(
    place=3.0, heading=1.0, counters=1.0, across=1.0, turns=1.0, agreement=1.0, following=1.0, jitter=0.2
)
#: A direction of numbers is shown if it is known to this share of what is plausible.
SHOWN = 0.5
#: While outliers are sought, numbers stay about within so many times what is plausible.
PRIOR = 1.0
#: Innovations beyond so many standard deviations are outliers, looked for so many times.
OUTLIER, SCREENS = 5.0, 6
#: Looks after a bad one that tell whether the reference jumped; below so many innovations a number, noise is
#: judged with the numbers that were learned from them (restricted likelihood).
NEXT, FEW = 3, 100
#: Steps of least squares end when no number moves by such a share of its deviation.
SMALL, STEPS = 0.02, 25
#: They also end when twice the logarithm of the likelihood gains less; slopes are taken anew at the first.
ENOUGH, ANEW = 1e-3, 2


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
            level = noise_of(model, values, sought, level)
            if not screened(model, values, level) and turn > 0:
                break
    unseen: dict[int, list[int]] = {}
    free = sought
    for turn in range(2):
        lost = hidden(model, values, free, level)
        for i in lost:
            values[i] = 0.0 if model.learned[i].kind == DELAY else model.first[i]
        unseen |= lost
        free = [i for i in free if i not in lost]
        progress(f"least squares, {turn + 1} of 2")
        values = solve(model, values, free, level)
        if like is None:
            level = noise_of(model, values, free, level)
    values = solve(model, values, free, level)
    filtered = model.filtered(values, free, model.stretched(values, free), level)
    w, W = stacked(filtered, len(free))
    share = (
        float(w @ w) / max(sum(drive_fit.count for drive_fit in filtered) - len(free), 1)
        if like is None
        else 1.0
    )
    covariance = np.asarray(np.linalg.pinv(W.T @ W, hermitian=True) * max(share, 1.0), dtype=np.float64)
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
    """w (N,) and W (N, f) of the looks that were taken, and of what is known beside them."""
    w, W = [], []
    for drive_fit in filtered:
        w += [drive_fit.w[drive_fit.taken].ravel(), drive_fit.agreement.over, drive_fit.following.over]
        looks = drive_fit.W[drive_fit.taken].reshape(-1, drive_fit.W.shape[2])
        W += [rows[:, :f] for rows in (looks, drive_fit.agreement.slopes, drive_fit.following.slopes)]
    return np.concatenate(w), np.concatenate(W)


def solve(model: Model, values: Array, free: list[int], noise: DriveNoise, prior: float = 0.0) -> Array:
    """Least squares by Gauss and Newton's steps, halved where they lead up; with a prior, numbers stay within
    so many times what is plausible."""
    if not free:
        return values
    scales = model.scales[free]
    pull = np.diag(1.0 / (prior * scales)) if prior else np.zeros((0, len(free)))

    def cost_of(at: Array, slopes: Sequence[int]) -> tuple[float, Array, Array]:
        filtered = model.filtered(at, slopes, model.stretched(at, slopes), noise)
        w, W = stacked(filtered, len(slopes))
        off = pull @ (at - model.first)[free]
        likelihood = sum(drive_fit.log_likelihood for drive_fit in filtered)
        return -2.0 * likelihood + off @ off, np.concatenate([w, off]), W

    cost, w, W = cost_of(values, free)
    for turn in range(STEPS):
        step = -scales * np.linalg.lstsq(np.concatenate([W, pull]) * scales, w, rcond=1e-12)[0]
        step *= min(1.0, 1.0 / np.max(np.abs(step) / (3.0 * scales)))
        if float(np.sum((W @ step) ** 2)) < SMALL**2:
            break
        for _ in range(12):
            trial = values.copy()
            trial[free] += step
            with suppress(InputError):  # a length below zero
                new, ahead, _ = cost_of(trial, ())
                if new < cost:  # not so for a number that is none
                    break
            step = 0.5 * step
        else:
            break
        values, gained, cost, w = trial, cost - new, new, ahead
        if gained < ENOUGH:
            break
        if turn < ANEW or gained > 1.0:  # later slopes are as those before
            cost, w, W = cost_of(values, free)
    return values


def noise_of(model: Model, values: Array, free: Sequence[int], first: DriveNoise) -> DriveNoise:
    """The noise of greatest likelihood at these numbers; of drives of which only the ends are known that of
    the counters alone. With few looks it is that of what the free numbers leave (D. A. Harville, Maximum
    likelihood approaches to variance component estimation, JASA 72, 1977)."""
    made = model.stretched(values, [])
    as_before = model.filtered(values, [], made, first)
    for name in ("agreement", "following"):
        beside = [getattr(drive_fit, name) for drive_fit in as_before]
        if count := sum(drive_fit.free for drive_fit in beside):
            square = sum(float(drive_fit.over @ drive_fit.over) for drive_fit in beside)
            level = getattr(first, name) * math.sqrt(square / count)
            level = min(max(level, getattr(LEAST, name)), getattr(MOST, name))
            first = first._replace(**{name: level})
    looked = model.with_looks
    sought = ["counters", *(["place", "across", "turns", "jitter"] if looked else [])]
    if any(drive.rows == 3 for drive in looked):
        sought.append("heading")
    if not looked:
        first = first._replace(**OF_ENDS)
    count = sum(np.count_nonzero(drive_fit.taken) * drive_fit.w.shape[1] for drive_fit in as_before)
    few = count < FEW * len(free)
    if few:
        made = model.stretched(values, free)

    def noise_at(logs: Array) -> DriveNoise:
        return first._replace(**dict(zip(sought, np.exp(logs).tolist(), strict=True)))

    def cost(logs: Array) -> float:
        filtered = model.filtered(values, free if few else [], made, noise_at(logs))
        value = -sum(drive_fit.log_likelihood for drive_fit in filtered)
        if few:
            scaled = stacked(filtered, len(free))[1] * model.scales[[*free]]
            value += 0.5 * float(np.linalg.slogdet(scaled.T @ scaled + np.eye(len(free)))[1])
        return value

    bounds = [(math.log(getattr(LEAST, name)), math.log(getattr(MOST, name))) for name in sought]
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
    """Numbers that the drives do not show, one after another: of what is plausible, the direction that is
    least known, in units of the noise; the last number in it by order of what is held first."""
    filtered = model.filtered(values, free, model.stretched(values, free), noise)
    _, W = stacked(filtered, len(free))
    left, lost = [*range(len(free))], {}
    while left:
        scaled = W[:, left] * model.scales[[free[j] for j in left]]
        _, sizes, directions = np.linalg.svd(scaled, full_matrices=False)
        if len(sizes) == len(left) and sizes[-1] * SHOWN > 1.0:
            break
        weak = np.abs(directions[-1])
        weak = np.where(weak > 0.3 * weak.max(), weak, 0.0)
        order = [_held_first(model.learned[free[j]].kind) for j in left]
        worst = max(range(len(left)), key=lambda j: (weak[j] > 0.0, order[j], weak[j]))
        others = [free[left[j]] for j in range(len(left)) if weak[j] > 0.0 and j != worst]
        lost[free[left.pop(worst)]] = others
    return lost


def _held_first(kind: str) -> int:
    """Of numbers that are not told apart, those that are held rather than others."""
    order = ["radius", "scale", "offset", "track", "wheelbase", "left", "right"]
    return order.index(kind) if kind in order else len(order) + (kind in ("ratio", "reference", DELAY, CLOCK))


def screened(model: Model, values: Array, noise: DriveNoise) -> int:
    """Leave out looks that no noise explains, and begin anew where the reference jumped; how many are new.

    A look that is far off, and those after it, are left out for a trial: if what comes then is where it was
    predicted, the far ones were outliers; else the reference jumped."""
    changes, made = 0, model.stretched(values, [])

    def far_off(i: int) -> Array:
        drive = model.drives[i]
        drive_fit = model.of([drive]).filtered(values, [], [made[i]], noise)[0]
        return np.max(np.abs(drive_fit.w), axis=1)

    for i, drive in enumerate(model.drives):
        for _ in range(0 if drive.ends else SCREENS):
            bad = np.flatnonzero((drive.taken == TAKEN) & (far_off(i) > OUTLIER)).tolist()
            bad = [m for n, m in enumerate(bad) if n == 0 or m - bad[n - 1] > 1]  # a run's first
            apart: list[int] = []
            for m in bad:
                if not apart or m - apart[-1] > 3 * NEXT:
                    apart.append(m)
            if not apart:
                break
            before = drive.taken.copy()
            for m in apart:
                drive.taken[m : m + NEXT][before[m : m + NEXT] == TAKEN] = LEFT_OUT
            off = far_off(i)
            for m in apart:
                drive.taken[m : m + NEXT] = before[m : m + NEXT]
                later = [n for n in range(m + NEXT, min(m + 2 * NEXT, len(off))) if before[n] == TAKEN]
                if later and all(off[n] > OUTLIER for n in later):
                    drive.taken[m] = BEGINS
                else:
                    some = np.arange(m, min(m + NEXT, len(off)))
                    drive.taken[some[(before[some] == TAKEN) & (off[some] > OUTLIER)]] = LEFT_OUT
            new = int(np.count_nonzero(drive.taken != before))
            changes += new
            if not new:
                break
    return changes
