"""An arm's numbers of least squares, the noise, outliers, and what the sightings do not show."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from nmm.base.arrays import Array, Flags
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.arm.deviations import covariance
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.parameters import ORDER
from nmm.plugins.robot.calibration.arm.residuals import PIXEL, PLACE, TURN
from nmm.plugins.robot.calibration.arm.rough import start_noise, with_mounts
from nmm.plugins.robot.calibration.arm.signs import with_signs
from nmm.plugins.robot.calibration.arm.solving import robust
from nmm.plugins.robot.calibration.shown import hidden, independent

#: Noise is no less than this, m, rad and px.
LEAST = {PLACE: 1e-7, TURN: 1e-7, PIXEL: 1e-4}
#: Residuals beyond so many standard deviations are outliers, looked for so many times.
OUTLIER, SCREENS = 5.0, 8
#: A picture of which a greater share of corners is left out is left out.
HALF = 0.5
#: While outliers are sought, numbers stay about within so many times what is plausible.
PRIOR = 3.0
#: Weights of a robust fit are taken anew so many times.
ROUNDS = 3
#: Configurations at which it is looked what numbers do at all.
ANYWHERE = 60
#: Standard deviation of a normal distribution by the median of its sizes.
_BY_MEDIAN = 1.4826

Progress = Callable[[float], None]


@dataclass(eq=False)
class ArmFit:
    """values (n,), free : the numbers that were learned, their covariance (f, f), noise (g,) of the model's
    groups; unseen : numbers that the sightings do not show, with the others that would make up for each;
    same : numbers that do what others do, whatever the arm does; signs : joints that count the other way"""

    values: Array
    free: list[int]
    covariance: Array
    noise: Array
    unseen: dict[int, list[int]] = field(default_factory=dict)
    same: list[int] = field(default_factory=list)
    signs: list[str] = field(default_factory=list)

    @property
    def deviations(self) -> Array:
        return np.sqrt(np.diag(self.covariance))


def fit(
    model: ArmModel,
    held: Mapping[int, float],
    like: ArmFit | None = None,
    progress: Progress = lambda _: None,
    anew: bool = False,
) -> ArmFit:
    """The numbers but for those held, which keep their values; from another fit's on, with the samples and
    the noise that this took, or with them anew."""
    values = model.first.copy() if like is None else like.values.copy()
    for i, value in held.items():
        values[i] = value
    sought = [i for i in range(len(values)) if i not in held]
    if like is None:
        values = with_mounts(model, values, held)
        same = _same(model, values, sought)
        values, back = _put_back(model, values, held, same)
        stays = [i for i in back if i not in same]
        _expect_enough(model, [i for i in sought if i not in same and i not in stays])
        progress(0.05)
        values, signs = with_signs(model, values, {**held, **{i: values[i] for i in (*same, *stays)}})
        progress(0.2)
    else:
        same, signs, stays = [i for i in like.same if i in sought], like.signs, []
    free = [i for i in sought if i not in same and i not in stays]
    noise = start_noise(model) if like is None else like.noise
    own = like is None or anew
    if own:
        values, noise = _robustly(model, values, free, progress)
    unseen = _hidden(model, values, free, noise)
    for i in unseen:
        if model.learned[i].role not in ("mount", "frame"):  # these stay where closed forms have them
            values[i] = model.first[i]
    free = [i for i in free if i not in unseen]
    if like is None:
        values, back = _put_back(model, values, held, [*unseen])
        stays += [i for i in back if i in free]
        free = [i for i in free if i not in back]
        if back:
            values, noise = _robustly(model, values, free)
    unseen |= {i: [] for i in stays}
    for turn in range(SCREENS):
        values = solve(model, values, free, noise)
        if not own:
            break
        noise = noise_of(model, values, free, noise)
        progress(0.5 + 0.3 * turn / SCREENS)
        if not screened(model, values, noise) and turn > 0:
            break
    if like is None:
        expect_most(model)
    rows = model.rows(values, free)
    W = rows.J / noise[rows.group][:, np.newaxis]
    known = covariance(W, rows.r / noise[rows.group], rows.sample, model.scales[free])
    if model.turns:
        stated = model.told_slopes(values)[np.ix_(free, free)]
        known = stated @ known @ stated.T
    return ArmFit(values, free, known, noise, unseen, same, signs)


def _robustly(
    model: ArmModel, values: Array, free: Sequence[int], progress: Progress = lambda _: None
) -> tuple[Array, Array]:
    """The values and the noise that few samples which are far off hardly change, with what is taken."""
    noise = start_noise(model)
    for view in model.views:
        view.taken[...] = view.log.visible
    for turn in range(3):
        values = solve(model, values, free, noise, prior=PRIOR, robustly=True)
        noise = _robust_noise(model, values, len(free))
        progress(0.2 + 0.1 * (turn + 1))
    screened(model, values, noise)
    return values, noise


def _put_back(
    model: ArmModel, values: Array, held: Mapping[int, float], lost: Sequence[int]
) -> tuple[Array, list[int]]:
    """Values with frames where they were in what is not shown of them, and the mounts that go with these; the
    numbers that stay so: all of a frame of which a turn is not shown."""
    at = {
        block.name: [*block.numbers.values()]
        for view in model.views
        for block in (*view.sensor, *view.target)
    }
    back: list[int] = []
    for name, block in at.items():
        own = [i for i in block if i in lost and model.learned[i].role == "frame"]
        if any(model.learned[i].unit == "rad" for i in own):
            own = [i for i in block if i not in held]
            model.turns.pop(name, None)
        back += own
    if not back:
        return values, []
    values = values.copy()
    values[back] = model.first[back]
    fixed = {i: float(values[i]) for i in (*held, *back)}
    return with_mounts(model, values, fixed), back


def solve(
    model: ArmModel,
    values: Array,
    free: Sequence[int],
    noise: Array,
    prior: float = 0.0,
    robustly: bool = False,
) -> Array:
    """Least squares; with a prior, numbers of the robot stay within about so many times what is plausible."""
    if not free:
        return values
    scales = model.scales[[*free]]
    pulled = [k for k, i in enumerate(free) if prior and model.learned[i].role not in ("mount", "frame")]
    pull = np.zeros((len(pulled), len(free)))
    pull[np.arange(len(pulled)), pulled] = 1.0 / (prior * scales[pulled]) if prior else 0.0
    centre = model.first[[*free]]
    rounds = ROUNDS if robustly else 0
    return robust(model, values, free, noise, pull, centre, rounds)


def noise_of(model: ArmModel, values: Array, free: Sequence[int], first: Array) -> Array:
    """Noise of each group by what is left, less what the numbers took of it (by the leverages of its
    rows)."""
    noise = first.copy()
    rows = model.rows(values, free)
    for _ in range(6):
        W = rows.J / noise[rows.group][:, np.newaxis]
        scaled = W * model.scales[[*free]]
        leverage = np.sum((scaled @ np.linalg.pinv(scaled.T @ scaled, hermitian=True)) * scaled, axis=1)
        before = noise.copy()
        for g, (_, kind) in enumerate(model.groups):
            some = rows.group == g
            count = float(np.count_nonzero(some) - leverage[some].sum())
            if count > 0.5:
                square = float(rows.r[some] @ rows.r[some])
                noise[g] = max(math.sqrt(square / count), LEAST[kind])
        if np.allclose(noise, before, rtol=1e-3):
            break
    return noise


def _robust_noise(model: ArmModel, values: Array, free: int) -> Array:
    rows = model.rows(values)
    noise = np.ones(len(model.groups))
    spare = math.sqrt(len(rows.r) / max(len(rows.r) - free, 0.1 * len(rows.r)))
    for g, (_, kind) in enumerate(model.groups):
        sizes = np.abs(rows.r[rows.group == g])
        noise[g] = (
            max(_BY_MEDIAN * float(np.median(sizes)) * spare, LEAST[kind]) if len(sizes) else LEAST[kind]
        )
    return noise


def normalised(model: ArmModel, values: Array, noise: Array) -> list[Array]:
    """Of each log residuals over their deviations, taken or not: (N, k) or (N, m, 2), NaN for unseen."""
    made = []
    for i, view in enumerate(model.views):
        level = np.array([noise[model.groups.index((i, kind))] for kind in view.groups])
        made.append(model.residuals(view, values) / level)
    return made


def explained(there: Flags, off: Array) -> Flags:
    """Which items of what is there noise explains, by residuals over their deviations."""
    good: Flags = there & (np.abs(np.where(np.isfinite(off), off, np.inf)).max(axis=-1) < OUTLIER)
    if good.ndim == 2:
        share = good.sum(axis=1) / np.maximum(there.sum(axis=1), 1)
        good[share < HALF] = False
    return good


def screened(model: ArmModel, values: Array, noise: Array) -> int:
    """Leave out what no noise explains, and take in what it does; how many changed."""
    changed = 0
    for view, off in zip(model.views, normalised(model, values, noise), strict=True):
        good = explained(view.log.visible, off)
        if not good.any():
            continue
        changed += int(np.count_nonzero(good != view.taken))
        view.taken[...] = good
    return changed


def _same(model: ArmModel, values: Array, sought: Sequence[int]) -> list[int]:
    """Numbers that do what others do at any configuration: those that come last in what is learned first."""
    W = []
    rng = np.random.default_rng(0)
    for view in model.views:
        readings = view.chain.random(ANYWHERE, rng)
        base = None if view.base is None else view.base[rng.integers(len(view.base), size=ANYWHERE)]
        posed = type(view)(view.log, view.chain, readings, base, view.sensor, view.target, view.taken)
        moved, _, T, seen = model.placements(posed, values)
        twists = model.twists(posed, values, sought, moved, T, seen)
        W.append(twists[:, : 3 if view.log.kind == "points" else 6].reshape(-1, len(sought)))
    ranks = [ORDER.index(model.learned[i].role) for i in sought]
    order = sorted(range(len(sought)), key=lambda k: (ranks[k], k))
    independents = {sought[k] for k in independent(np.concatenate(W) * model.scales[[*sought]], order)}
    return [i for i in sought if i not in independents]


def _hidden(model: ArmModel, values: Array, free: Sequence[int], noise: Array) -> dict[int, list[int]]:
    rows = model.rows(values, free)
    W = rows.J / noise[rows.group][:, np.newaxis]
    ranks = [ORDER.index(model.learned[i].role) for i in free]
    lost = hidden(W, model.scales[[*free]], lambda k: ranks[k])
    return {free[k]: [free[j] for j in others] for k, others in lost.items()}


def expect_most(model: ArmModel) -> None:
    """`InputError` where more of a log is left out than not."""
    for view in model.views:
        taken, several = int(view.samples_taken.sum()), len(view.log)
        if 2 * taken < several:
            what = f"{several - taken} samples of {several} are off as no noise explains"
            expected = "sightings of one arm: readings, what was seen and what stood still go together"
            raise InputError(what, where=f"{model.where}: {view.log.name}", expected=expected)


def _expect_enough(model: ArmModel, free: Sequence[int]) -> None:
    """`InputError` for fewer measurements than numbers."""
    per = [3 if view.log.kind == "points" else 6 for view in model.views]
    many = [int(view.samples_taken.sum()) for view in model.views]
    stated = sum(a * b for a, b in zip(per, many, strict=True))
    if stated >= len(free) + 1:
        return
    what = f"{sum(many)} samples tell {stated} things, fewer than {len(free)} numbers"
    more = math.ceil((len(free) + 1) / min(per))
    expected = f"{more} samples and better twice as many, or fewer numbers: hold='origin'"
    raise InputError(what, where=model.where, expected=expected)
