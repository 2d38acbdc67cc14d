"""The paths of several runs of one task, from above and, where they rise, from the side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from nmm import looks
from nmm.arrays import Array
from nmm.figures import style
from nmm.figures.views import ABOVE, View, Viewed, upright
from nmm.playback.placements import base_position
from nmm.runs.trajectory import Trajectory

#: Paths that rise or fall by more than this are drawn from the side too, m.
_RISES = 0.01
#: The least height of a drawing is twice this share of its width.
_FLAT = 0.1
_TARGET, _DESIRED = 12.0, "#C3C8D0"


class Paths(Viewed):
    """The frames' and the platforms' paths of runs, what is desired, and targets.

    Parameters
    ----------
    runs, worn : at least one run of a sample or more, and a look for each
    """

    on_the_ground = False

    def __init__(self, runs: Sequence[Trajectory], worn: Sequence[looks.Look]) -> None:
        self._worn = worn
        self._desired, self._held = runs[0].moving, runs[0].held
        self._frames = [run.frame for run in runs]
        self._paths = [run.path for run in runs]
        self._floors = [_on_the_floor(run) for run in runs]
        risen = [path for path in (*self._paths, self._desired) if path is not None]
        rises = any(float(np.ptp(path[:, 2])) > _RISES for path in risen)
        self.views = (ABOVE, upright(risen[-1])) if rises else (ABOVE,)

    @property
    def names(self) -> list[str]:
        """The entries of the paths' legend."""
        names = ["target"] * bool(len(self._held)) + ["desired path"] * (self._desired is not None)
        for i, (name, *_) in enumerate(self._worn):
            names += [f"{name}: {self._frames[i]}"] * (self._paths[i] is not None)
            names += [f"{name}: platform"] * (self._floors[i] is not None)
        return names

    def points(self, view: View, width: float) -> list[Array]:
        """All that is drawn, and enough around what is flat."""
        floors = self._floors if view == ABOVE else []
        parts = [self._held, self._desired, *self._paths, *floors]
        found = np.vstack([view.of(part) for part in parts if part is not None and len(part)])
        low, high = np.nanmin(found, axis=0), np.nanmax(found, axis=0)
        middle, half = 0.5 * (low + high), max(0.05, _FLAT * float(np.max(high - low)))
        return [found, np.array([middle - half, middle + half])]

    def draw(self, axes: Axes, view: View) -> None:
        """Draw the paths as they are seen in a view."""
        self.dress(axes, view)
        if len(self._held):
            axes.plot(
                *view.of(self._held).T, "*", color=looks.ORANGE, markersize=_TARGET,
                markeredgecolor=looks.BLACK, label="target", linestyle="none", zorder=6,
            )  # fmt: skip
        if self._desired is not None:
            axes.plot(*view.of(self._desired).T, color=_DESIRED, linewidth=5.0, label="desired path")
        for i, (name, color, dashes) in enumerate(self._worn):
            # The later ones are thinner: those below are seen where they run the same way.
            below = len(self._worn) - 1 - i
            for path, whose, thick in (
                (self._paths[i], self._frames[i], 1.5 + style.WIDER * below),
                (self._floors[i], "platform", 0.8 + 0.5 * below),
            ):
                if path is not None and (whose != "platform" or view == ABOVE):
                    axes.plot(
                        *view.of(path).T, dashes, color=color, linewidth=thick, label=f"{name}: {whose}"
                    )


def _on_the_floor(run: Trajectory) -> Array | None:
    """Where the platform has been (N, 3); None for an arm on the ground."""
    if not run.robot.platform.n_p:
        return None
    return np.column_stack([base_position(run.robot, run.q), np.zeros(len(run))])
