"""How good an arm's calibration is: samples that it has not seen, and a base that moved in between."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import stats

from nmm.base.arrays import Array, Flags
from nmm.plugins.robot.calibration.arm.fit import ArmFit, explained, fit, normalised
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.sightings import WORLD
from nmm.plugins.robot.calibration.arm.view import SightingsView
from nmm.plugins.robot.calibration.judged import LEARNED_FROM, ljung_box

#: At least so many samples are predicted.
PREDICTED = 6
#: A base has moved where a step of it explains such a share of what is left, and so much of it in units of
#: the noise.
EXPLAINED, MUCH = 0.3, 60.0
#: Pixels are taken to be off by so many focal lengths at most.
FARTHEST = 4.0
#: Samples that were held out are of another arm where more than such a share of them are off as no noise
#: explains, or half of them so many times as far as expected.
LOST_SHARE, TIMES = 1.0 / 3.0, 1.5
#: Or where such a share of the samples behind some sample was left out, and of those before not.
LOST = 0.8


class ArmHeldOut(NamedTuple):
    """What the numbers of the first part of the sightings say of samples that were not learned from.

    samples : how many
    before, after : root of the mean square error, by the file's numbers and by those learned, each with the
        mounts that go with them; in `unit`: "m", "px", or "1" for multiples of the noise where logs differ
    turn_before, turn_after : of poses, rad; NaN without
    p : the chance that such a difference comes of noise alone (Wilcoxon's signed ranks, of the samples'
        squares in units of the noise); closer : whether these ranks are for the numbers learned
    lost : how many of them are off, by the numbers learned, as no noise explains: these are not in before
        and after; times : how far half of all are off, in units of what is expected of them

    Examples
    --------
    >>> nmm.extending.ArmHeldOut(18, "m", 0.011, 4e-4, np.nan, np.nan, p=8e-6, closer=True).verdict
    'better'
    """

    samples: int
    unit: str
    before: float
    after: float
    turn_before: float
    turn_after: float
    p: float
    closer: bool
    lost: int = 0
    times: float = 1.0

    @property
    def changed(self) -> bool:
        """Whether they are not of the arm that the first ones show."""
        return self.lost > LOST_SHARE * self.samples or self.times > TIMES

    @property
    def verdict(self) -> str:
        """ "better", "worse" or "no difference"; "worse", too, where more than a third is off as no noise
        explains."""
        if self.lost > LOST_SHARE * self.samples:
            return "worse"
        if not self.p < 0.05:
            return "no difference"
        return "better" if self.closer else "worse"


def held_out(model: ArmModel, fitted: ArmFit) -> ArmHeldOut | None:
    """What the first part of each log predicts of the rest, beside the file; None where there is too little,
    or where nothing of the robot was learned."""
    cuts = [round(LEARNED_FROM * len(view.log)) for view in model.views]
    part = model.part([slice(0, cut) for cut in cuts])
    rest = model.part([slice(cut, len(view.log)) for cut, view in zip(cuts, model.views, strict=True)])
    held = {i: float(fitted.values[i]) for i in range(len(model.first)) if i not in fitted.free}
    if all(model.learned[i].role == "mount" for i in fitted.free):
        return None  # nothing of the robot's, which would be no other before
    many = sum(3 if v.log.kind == "points" else 6 for v in part.views for _ in range(len(v.log)))
    for view in rest.views:
        view.taken[...] = view.log.visible
    several = sum(int(view.samples_taken.sum()) for view in rest.views)
    if several < PREDICTED or many < 1.5 * len(fitted.free):
        return None
    learned = fit(part, held, like=fitted, anew=True)
    before = by_file(part, learned)
    expected = _expected(rest, fitted, learned)
    half = np.concatenate(
        [_by_sample(w, view) / w.shape[-1] for view, w in zip(rest.views, expected, strict=True)]
    )
    times = math.sqrt(float(np.median(half)))
    for view, w in zip(rest.views, expected, strict=True):
        view.taken[...] = explained(view.log.visible, w)
    lost = several - sum(int(view.samples_taken.sum()) for view in rest.views)
    if several - lost < PREDICTED:  # all are scored, then
        for view in rest.views:
            view.taken[...] = view.log.visible
    squares: tuple[list[Array], list[Array]] = [], []
    sizes: tuple[list[Array], list[Array]] = [], []
    turns: tuple[list[Array], list[Array]] = [], []
    for which, one in enumerate((before, learned)):
        for view, w in zip(rest.views, normalised(rest, one.values, learned.noise), strict=True):
            off = rest.residuals(view, one.values)
            if view.log.camera is not None:  # a board behind a camera is anywhere
                off = np.clip(off, -FARTHEST * view.log.camera.fx, FARTHEST * view.log.camera.fx)
            squares[which].append(_by_sample(w, view))
            sizes[which].append(_by_sample(off[..., : 2 if off.ndim == 3 else 3], view))
            if view.log.kind == "poses":
                turns[which].append(_by_sample(off[:, 3:], view))
    scores = [np.concatenate(one) for one in squares]
    same = bool(np.all(scores[0] == scores[1]))
    p = 1.0 if same else float(stats.wilcoxon(scores[0], scores[1]).pvalue)
    gained = scores[0] - scores[1]
    closer = float(np.sum(np.sign(gained) * stats.rankdata(np.abs(gained)))) > 0.0
    kinds = {view.log.kind == "corners" for view in model.views}
    unit = "1" if len(kinds) > 1 else "px" if True in kinds else "m"
    off_before, off_after = (_root(one) for one in (sizes if unit != "1" else squares))
    turned = [_root(one) if one else math.nan for one in turns]
    return ArmHeldOut(several, unit, off_before, off_after, turned[0], turned[1], p, closer, lost, times)


def _expected(rest: ArmModel, fitted: ArmFit, learned: ArmFit) -> list[Array]:
    """Of each log residuals over their deviations by the noise and by how well the numbers are known: (N, k)
    or (N, m, 2), NaN for unseen."""
    free = fitted.free
    known = np.diag(rest.scales[free] ** 2)  # of a number that the first ones do not show
    some = [k for k, i in enumerate(free) if i in learned.free]
    own = [learned.free.index(free[k]) for k in some]
    known[np.ix_(some, some)] = learned.covariance[np.ix_(own, own)]
    rows = rest.rows(learned.values, free)
    J = rows.J @ np.linalg.pinv(rest.told_slopes(learned.values)[np.ix_(free, free)])
    square = learned.noise[rows.group] ** 2 + np.einsum("ri,ij,rj->r", J, known, J)
    made, first = [], 0
    for view in rest.views:
        off = np.full((*view.log.visible.shape, len(view.groups)), np.nan)
        last = first + int(view.taken.sum()) * len(view.groups)
        off[view.taken] = (rows.r / np.sqrt(square))[first:last].reshape(-1, len(view.groups))
        made.append(off)
        first = last
    return made


def by_file(model: ArmModel, fitted: ArmFit) -> ArmFit:
    """The fit of the numbers of the robot's file, with the mounts that go with them."""
    held = {i: float(fitted.values[i]) for i in range(len(model.first)) if i not in fitted.free}
    own = [i for i in fitted.free if model.learned[i].role != "mount"]
    return fit(model, held | {i: float(model.first[i]) for i in own}, like=fitted)


def _by_sample(off: Array, view: SightingsView) -> Array:
    """Of each sample that is taken the sum of squares; of corners the mean of theirs."""
    items = np.sum(off * off, axis=-1)
    if items.ndim == 2:
        items = np.where(view.taken, items, np.nan)[view.samples_taken]
        mean: Array = np.nanmean(items, axis=1)
        return mean
    return items[view.taken]


def _root(parts: list[Array]) -> float:
    return math.sqrt(float(np.concatenate(parts).mean()))


def whiteness(model: ArmModel, fitted: ArmFit) -> float:
    """The chance that what is left from sample to sample is white, 0 to 1; NaN with fewer than 40."""
    least, tests = 1.0, 0
    for view, w in zip(model.views, normalised(model, fitted.values, fitted.noise), strict=True):
        if w.ndim == 3:
            w = np.nanmean(np.where(view.taken[:, :, np.newaxis], w, np.nan)[view.samples_taken], axis=1)
        else:
            w = w[view.taken]
        for column in w.T if len(w) >= 40 else ():
            least, tests = min(least, ljung_box(column)), tests + 1
    return min(1.0, least * tests) if tests else math.nan


def moved_base(model: ArmModel, fitted: ArmFit) -> tuple[SightingsView, int] | None:
    """The log in which what stands in the world seems to have moved, and the sample at which it did."""
    for view in model.views:
        if WORLD not in (view.log.by, view.log.on) or view.base is not None:
            continue
        taken = view.samples_taken
        lost = _lost_from(taken)
        if lost:
            return view, lost
        blocks = view.sensor if view.log.by == WORLD else view.target[-1:]
        columns = [i for block in blocks for i in block.numbers.values()]
        if k := _step(model, fitted, view, columns):
            return view, k
    return None


def _lost_from(taken: Flags) -> int:
    """The sample from which on most are left out, and before it few; 0 without."""
    best, at = 0.0, 0
    for k in range(3, len(taken) - 2):
        before, after = float(taken[:k].mean()), float(1.0 - taken[k:].mean())
        if before > LOST and after > LOST and before + after > best:
            best, at = before + after, k
    return at


def _step(model: ArmModel, fitted: ArmFit, view: SightingsView, columns: list[int]) -> int:
    """The sample from which on a step of a mount would explain much of what is left; 0 without."""
    one = model.part([slice(0, len(v.log) if v is view else 0) for v in model.views])
    rows = one.rows(fitted.values, [*fitted.free, *columns])
    noise = fitted.noise[rows.group]
    W = rows.J / noise[:, np.newaxis]
    r, f = rows.r / noise, len(fitted.free)
    Q = W[:, :f] * one.scales[fitted.free]
    back = np.linalg.pinv(Q.T @ Q, hermitian=True)
    left = r - Q @ (back @ (Q.T @ r))
    total, D = float(left @ left), W[:, f:] * one.scales[columns]
    sample = rows.sample
    best, at = 0.0, 0
    for k in range(4, len(view.log) - 3):
        late = sample >= k
        step = D[late]
        across = Q[late].T @ step
        gained, square = step.T @ left[late], step.T @ step - across.T @ back @ across
        won = float(gained @ np.linalg.pinv(square, rcond=1e-9, hermitian=True) @ gained)
        if won > best:
            best, at = won, k
    return at if best > max(MUCH, EXPLAINED * total) else 0
