"""Points that cameras see, in views of a run: the paths of those that move, marks for those that stand."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes

from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.motion.trajectory import Trajectory

#: Size of the mark of a point that stands, and of where one that moves is at an instant, pt.
_MARK, _DOT = 6.5, 3.5
_MOVING, _STANDS = "path of what is seen", "seen point"
#: A point whose way is shorter stands, m.
_RESTS = 1e-6


class DrawnPoints:
    """Those of runs, each once; of several runs those that are the same in all.

    Attributes
    ----------
    lines : the paths (k, 3), m, of those that move
    dots (d, 3) : where these are at the given times, m
    marks (K, 3) : those that stand, m
    """

    def __init__(self, runs: Sequence[Trajectory], times: Array | None = None) -> None:
        first = runs[0]
        seen = np.zeros((len(first), 0, 3)) if first.seen is None else first.seen
        shared = [point for point in seen.swapaxes(0, 1) if all(_has(run, point) for run in runs[1:])]
        moves = [bool(np.ptp(point, axis=0).max() > _RESTS) for point in shared]
        moving = [point for point, does in zip(shared, moves, strict=True) if does]
        self.lines = moving
        standing = [point[0] for point, does in zip(shared, moves, strict=True) if not does]
        self.marks = np.array(standing).reshape(-1, 3)
        wanted = np.zeros(0) if times is None else times
        at = np.searchsorted(first.t, wanted - 1e-9).clip(0, len(first) - 1)
        self.dots = np.array([point[at] for point in moving]).reshape(-1, 3)

    @property
    def names(self) -> list[str]:
        return [_MOVING] * bool(self.lines) + [_STANDS] * bool(len(self.marks))

    @property
    def parts(self) -> list[Array]:
        """All of it, (k, 3) each, m."""
        return [*self.lines, *([self.marks] if len(self.marks) else [])]

    def draw(self, axes: Axes, of: Callable[[Array], Array]) -> None:
        """Draw it as a view projects points of the world."""
        color = resolver_style.ORANGE
        for k, line in enumerate(self.lines):
            axes.plot(*of(line).T, color=color, linewidth=1.2, zorder=2.7, label=None if k else _MOVING)
        if len(self.dots):
            axes.plot(*of(self.dots).T, "o", color=color, markersize=_DOT, zorder=2.8, linestyle="none")
        if len(self.marks):
            axes.plot(
                *of(self.marks).T, "D", color=color, markersize=_MARK, label=_STANDS, zorder=6,
                markeredgecolor=resolver_style.BLACK, markeredgewidth=0.7, linestyle="none",
            )  # fmt: skip


def _has(run: Trajectory, point: Array) -> bool:
    """Whether a run has seen the same point (N, 3), as far as both go."""
    if run.seen is None:
        return False
    common = min(len(run), len(point))
    return any(np.allclose(own[:common], point[:common]) for own in run.seen.swapaxes(0, 1))
