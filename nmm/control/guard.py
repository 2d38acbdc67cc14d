"""What keeps distances beyond the rows: the motion that the inputs make is looked at before it is made.

Rows are linear, the motion is not, and nearest points jump. So where a pair could come too near within the
sample, or while the robot then brakes (all inputs alike, as hard as accelerations let it), distances are
measured along that way. Where one falls short, a row for the points that do is added and the problem is
answered again; after a few rounds the inputs go towards those of braking, as little as can be. The way on
which the robot brakes was found clear a sample before, so that there always is one where obstacles stand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.collisions.setting import Setting
from nmm.control.equations import ControlStep
from nmm.resolvers.answer import Status
from nmm.robots.held import Held

#: Rows keep distances by MARGIN more than asked for, m; ways have to keep them by SLACK more: between
#: looks they may dip.
MARGIN, SLACK = 5e-4, 5e-5
#: Rows for these are kept free; how often the problem is answered again.
CUTS, ROUNDS = 8, 5
#: Looks along a way are no farther apart than this, in m and rad of the coordinates together.
APART = 0.01
#: Shares of the way from braking to what was asked that are tried, then.
SHARES = (0.75, 0.5, 0.25, 0.1, 0.0)
#: Samples of braking that are looked at.
BRAKING = 400


class Short(NamedTuple):
    """A pair that comes too near.

    after : s from now; weight : for how long the inputs would have gone as far, s
    q (n,) : where; by : m
    """

    pair: int
    after: float
    weight: float
    q: Array
    by: float


class Counts(NamedTuple):
    """How often a guard had to do something since its controller was reset, in samples.

    looked : it looked along the way; added : rows were added; braked : the inputs went towards braking;
    short : no inputs that it tried keep the distance
    """

    looked: int = 0
    added: int = 0
    braked: int = 0
    short: int = 0


class Guard:
    """A controller's part for distances.

    Attributes
    ----------
    counts : what it had to do
    held : whether it looked along the way of the last sample, which then is one with inputs that are held
    """

    def __init__(
        self,
        setting: Setting,
        step: ControlStep,
        update: Callable[[float, Array], None],
        again: Callable[[Array], float],
        instead: Callable[[Array], None],
    ) -> None:
        self._setting, self._queries = setting, setting.queries
        self._near, self._keep, self._step = step.near, step.clearance, step
        self._update, self._again, self._instead = update, again, instead
        robot = setting.robot
        self._hold = Held(robot)
        self._A = step.limits.acceleration
        self._brakes = bool(np.isfinite(self._A).any())
        self._target = setting.distance + SLACK
        self._queries.scene.kept[:] = self._target
        self._lowered: list[int] = []
        self._times = np.zeros(robot.n)
        self._cut = False
        self.reset()

    def reset(self) -> None:
        """Count anew."""
        self.counts = Counts()
        self.held = False

    def look(self, t: float, q: Array) -> None:
        """Measure distances at (t, q) and write their rows."""
        if self._cut:
            self._keep.least[:] = -np.inf
            self._cut = False
        self._update(t, q)

    def clear(self, moved: float) -> bool:
        """Whether all was farther away than coordinates reach that move so far, m and rad."""
        room = float(self._queries.scene.bounds.min(initial=np.inf)) - self._setting.distance
        return moved * (1.0 + self._setting.robot.reach) < room

    def _count(self, what: str) -> None:
        self.counts = self.counts._replace(**{what: getattr(self.counts, what) + 1})

    def certify(self, t: float, q: Array, before: Array) -> None:
        """Look along the way that the inputs found make, and change them where it comes too near.

        before (m,) : the inputs of the sample before, from which accelerations count
        """
        self.held = False
        pairs = self._risky(q)
        if not pairs:
            return
        self.held = True
        self._count("looked")
        u = self._step.answer.u
        short = self._first_short(t, q, u, pairs)
        for round_ in range(ROUNDS):
            if short is None:
                return
            if not self._add_row(t, q, short):
                break
            if round_ == 0:
                self._count("added")
            self._step.problem.before[:] = before
            if self._again(q) >= Status.SINGULAR_J:
                break
            pairs = list(dict.fromkeys([*pairs, *self._risky(q)]))
            short = self._first_short(t, q, u, pairs)
        if short is not None:
            self._count("braked")
            self._brake(t, q, before, pairs, short)

    def _brake(self, t: float, q: Array, before: Array, pairs: list[int], short: Short) -> None:
        """From braking towards what was asked, the last inputs that keep the distances; else the best."""
        problem = self._step.problem
        wanted = self._step.answer.u.copy()
        if not np.isfinite(wanted).all():
            wanted = before.copy()
        rest = np.clip((1.0 - self._slower(before)) * before, problem.u_lower, problem.u_upper)
        best, least = wanted, short.by
        for share in SHARES:
            tried = rest + share * (wanted - rest)
            found = self._first_short(t, q, tried, pairs)
            if found is None:
                best, least = tried, 0.0
                break
            if found.by < least:
                best, least = tried, found.by
        if least > 0.0:
            self._count("short")
        self._instead(best)

    def _risky(self, q: Array) -> list[int]:
        """The pairs that could come too near, with the inputs found, before the robot would stand."""
        step, queries = self._step, self._queries
        kept, bounds = queries.scene.kept, queries.scene.bounds
        for k in self._lowered:
            kept[k] = self._target
        self._lowered = []
        if queries.least < self._target:  # what is too near already may not come nearer
            asked = self._setting.distance
            for k in np.flatnonzero(bounds < self._target).tolist():
                d = float(bounds[k])
                kept[k] = d - 1e-9 if d < asked else max(asked, d - 1e-7)
                self._lowered.append(k)
        dt = float(step.problem.dt)
        if self._brakes:
            self._times[:] = dt + 0.5 * dt / self._slower(step.answer.u)
        else:
            self._times[:] = dt
        return queries.risky(step.q_dot, self._times)

    def _first_short(self, t: float, q: Array, u: Array, pairs: list[int]) -> Short | None:
        """Where a pair first comes too near on the way that u makes: dt with u, then braking."""
        kept = self._queries.scene.kept[pairs]
        worst: Short | None = None
        for after, weight, ahead in self._way(q, u):
            by = kept - self._queries.distances(t + after, ahead, pairs)
            k = int(np.argmax(by))
            if by[k] > 0.0 and (worst is None or by[k] > worst.by):
                worst = Short(pairs[k], after, weight, ahead.copy(), float(by[k]))
            elif worst is not None:
                break
        return worst

    def _way(self, q: Array, u: Array) -> Iterator[tuple[float, float, Array]]:
        """Times from now, s, for how long u would have gone as far, s, and configurations (n,)."""
        dt = float(self._step.problem.dt)
        looks = int(np.clip(np.ceil(dt * np.abs(u).sum() / APART), 2, 20))
        for i in range(1, looks + 1):
            ahead = self._hold(q, u, dt * i / looks)
            yield dt * i / looks, dt * i / looks, ahead
        if not self._brakes:
            return
        share, after, gone, weight = 1.0, dt, 0.0, dt
        step = self._slower(u)
        size = float(np.abs(u).sum())
        for _ in range(BRAKING):
            share -= step
            if share <= 0.0:
                if gone > 0.0:
                    yield after, weight, ahead
                return
            ahead = self._hold(ahead, share * u, dt)
            after += dt
            weight += share * dt
            gone += dt * share * size
            if gone > APART:
                yield after, weight, ahead
                gone = 0.0

    def _slower(self, u: Array) -> float:
        """The share of the inputs that one sample of braking takes, all of them alike: directions stay."""
        dt = float(self._step.problem.dt)
        return float(np.min(self._A * dt / np.maximum(np.abs(u), 1e-12), initial=1.0))

    def _add_row(self, t: float, q: Array, short: Short) -> bool:
        """A row for the points that come too near; whether there was room for it."""
        near, keep, step = self._near, self._keep, self._step
        slot = int(near.used)
        u_dot = step.q_dot.copy()
        if slot == len(near.d):
            self._queries.place(t, q)
            return False
        self._queries.carry(short.pair, (t, q), (t + short.after, short.q), near, slot)
        near.used[()] = slot + 1
        rate = float(near.d_q[slot] @ u_dot + near.d_t[slot])
        keep.least[slot] = rate + (short.by + 1e-6) / short.weight
        self._cut = True
        return True
