"""A trajectory: what a run recorded, with the names, the outcome and what people look at in it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.arrays import Array, Integers
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.recorded import places
from nmm.control.sequence import Event
from nmm.doors import door
from nmm.machine import made_with
from nmm.robots.bodies import Body, Nearest
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot
from nmm.runs.ellipsoid_options import Wanted
from nmm.runs.figure_options import Drawn
from nmm.runs.residuals import NONE, Residuals

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Outcome(StrEnum):
    """How a run ended (docs/outcomes.md).

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_3r_out_of_reach").run()
    >>> run.outcome is nmm.Outcome.MISSED, run.complete
    (True, False)
    """

    COMPLETED = "completed"
    MISSED = "missed"
    SINGULAR = "singular"
    DIVERGED = "diverged"
    UNSTABLE = "unstable"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """N samples of a closed loop, both ends included.

    Attributes
    ----------
    robot : the robot that moved
    t (N,) s; q (N, n); u (N, n_u): times, coordinates, inputs, in `robot.q_units`, `robot.u_units`
    q_dot (N, n): S(q) u, per second
    r, r_d, error (N, s): task value, target and error (angles wrapped), in `r_units`; not a number where a
        task that comes and goes is not active
    objective (N,): H(q)
    sigma_min (N,): smallest singular value of J_bar
    partition (N, s): columns of Ja (RG), -1 elsewhere
    residual (N,): ‖J u - rate‖
    scale (N, levels): the share λ of the task's rate that was left, a priority level a column; 1 where
        nothing was relaxed on purpose
    step_size (N,): the share of α that was taken, 1 where it is constant
    crossed (N,): 1 where the extended Jacobian was singular on the way from the sample before, else 0
    margin (N,): least distance to a limit, as a share of its range (see `nmm.runs.margins`), of all but the
        coordinates that stand still throughout; below 0 where one is broken, infinite without limits
    shares (N, limited): where each of `limit_names` is between its limits, 0 at the lower, 1 at the upper one
    limited : whether the controller kept limits
    unmet : where J u differed from the rate
    r_names, r_units : the task's rows
    resolver, method, dt : how it was made
    outcome, message, warnings : how it ended and why
    frame : the end-effector frame that the task positions, if any
    path, desired (N, 3): its path and, where the task says, the desired one, m in the world
    target (3,): the fixed point that a bearing looks at, if any
    clearance (N,): least distance between shapes that are kept apart, m, infinite where none are
    clearance_between (N,): the least on the way to the next sample, m
    clearance_pairs (N,): which of `clearance_names` is nearest, -1 for none
    clearance_points (N, 6): the two points that are nearest, in the order of the names, m in the world
    clearance_asked : the distance that was to be kept, m
    obstacles : what the robot kept off, where it was
    kinematics_off : the most by which kinematics that were compiled differ from Pinocchio's at the first, the
        middle and the last sample, m and rad; not a number where Pinocchio computed all
    scenario : the scenario as resolved, if it came from one
    events : when tasks that come and go began and ended, and why
    label : what it is called among other runs; "" for its resolver
    made_with : the versions and the machine that computed it (`nmm.machine`); empty where a folder lacks them

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> run.q.shape, run.u.shape, run.sigma_min[:1].round(3)
    ((5001, 5), (5001, 4), array([1.]))
    >>> folder = run.save("runs/first", figures=False)
    >>> nmm.Trajectory.load(folder).complete
    True
    """

    robot: Robot
    t: Array
    q: Array
    u: Array
    q_dot: Array
    r: Array
    r_d: Array
    error: Array
    objective: Array
    sigma_min: Array
    partition: Integers
    residual: Array
    scale: Array
    margin: Array
    r_names: tuple[str, ...]
    r_units: tuple[str, ...]
    resolver: str
    method: str
    dt: float
    outcome: Outcome = Outcome.COMPLETED
    message: str = ""
    warnings: tuple[str, ...] = ()
    frame: str | None = None
    path: Array | None = None
    desired: Array | None = None
    target: Array | None = None
    unmet: Residuals = NONE
    limited: bool = False
    shares: Array = field(default_factory=lambda: np.zeros((0, 0)))
    limit_names: tuple[str, ...] = ()
    step_size: Array = field(default_factory=lambda: np.ones(0))
    crossed: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    clearance: Array = field(default_factory=lambda: np.zeros(0))
    clearance_between: Array = field(default_factory=lambda: np.zeros(0))
    clearance_pairs: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    clearance_points: Array = field(default_factory=lambda: np.zeros((0, 6)))
    clearance_names: tuple[str, ...] = ()
    clearance_asked: float = 0.0
    obstacles: tuple[Obstacle, ...] = ()
    kinematics_off: float = float("nan")
    scenario: dict[str, Any] | None = field(default=None)
    events: tuple[Event, ...] = ()
    label: str = ""
    made_with: dict[str, str | int] = field(default_factory=made_with)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        end = f"{self.t[-1]:g} s in {len(self)} samples" if len(self) else "no samples"
        return f"Trajectory({self.robot.name}, {self.resolver}, {self.outcome}, {end})"

    @property
    def complete(self) -> bool:
        """Whether the run reached its end, and its task error went as its gain promises."""
        return self.outcome is Outcome.COMPLETED

    @property
    def called(self) -> str:
        """What tables, legends and messages call it."""
        return self.label or self.resolver.upper()

    @property
    def error_norm(self) -> Array:
        """‖e‖ of the tasks active at each sample, (N,), in the mixed units of the rows."""
        return np.asarray(np.linalg.norm(np.where(np.isnan(self.error), 0.0, self.error), axis=1))

    @property
    def switches(self) -> int:
        """How often RG changed its partition."""
        if len(self) < 2:
            return 0
        return int(np.sum(np.any(np.diff(self.partition, axis=0) != 0, axis=1)))

    @property
    def moving(self) -> Array | None:
        """(M, 3) m in the world: the desired path, of tasks that come and go without those that hold a point;
        None where there is none."""
        parts = [part for part in self._stretches if not _stays(part)]
        return np.vstack(parts) if parts else None

    @property
    def held(self) -> Array:
        """(K, 3) m in the world: the points where the desired path stays, from event to event."""
        points = [part[0] for part in self._stretches if _stays(part)]
        new = [not any(np.allclose(one, other) for other in points[:i]) for i, one in enumerate(points)]
        return np.array(points).reshape(-1, 3)[np.array(new, dtype=bool)]

    @property
    def marks(self) -> Array:
        """(K, 3) m in the world: the fixed points that figures and playback show, looked at or held."""
        return self.held if self.target is None else self.target[np.newaxis]

    @property
    def _stretches(self) -> list[Array]:
        """The desired path from event to event."""
        if self.desired is None:
            return []
        events = np.searchsorted(self.t, sorted({event.t for event in self.events}))
        return [part for part in np.split(self.desired, events) if len(part)]

    def with_scenario(self, scenario: dict[str, Any], warnings: tuple[str, ...] = ()) -> Trajectory:
        """The same trajectory with the scenario that it came from, and with what that warns of."""
        return replace(self, scenario=scenario, warnings=(*warnings, *self.warnings))

    def summary(self) -> dict[str, Any]:
        """The run in numbers, ready for JSON."""
        return door("nmm.runs.summary:summarise")(self)

    def save(
        self, folder: str | Path, *, figures: Drawn = True, html: bool = False, ellipsoids: Wanted = False
    ) -> Path:
        """Write the run's folder (see `nmm.folders.run.save`): arrays, tables, summary, figures, playback."""
        return door("nmm.folders.run:save")(self, folder, figures=figures, html=html, ellipsoids=ellipsoids)

    @staticmethod
    def load(folder: str | Path, robot: Robot | None = None) -> Trajectory:
        """Read a run's folder; with the robot it ran on, if that was put together in Python.

        Raises
        ------
        InputError : it is no run's folder, or its robot cannot be loaded, or is another one
        """
        return door("nmm.folders.run:load")(folder, robot)

    def plot(self, **options: float) -> Figure:
        """One figure that shows the run: the motion from above, errors, objective, inputs; `width`, in."""
        return door("nmm.figures:overview")(self, **options)

    def plot_ellipses(self, path: str | Path | None = None, options: Wanted = True) -> Figure:
        """The end-effector's path with manipulability ellipses; also as a file (`nmm.figures.ellipses`)."""
        return door("nmm.figures.ellipses:ellipses")(self, options, path)

    def motion(self, label: str | None = None) -> Motion:
        """What playback shows of it."""
        return Motion(
            robot=self.robot,
            t=self.t,
            q=self.q,
            u=self.u,
            path=self.path,
            desired=self.moving,
            target=self.marks if len(self.marks) else None,
            label=self.called if label is None else label,
            frame=self.frame,
            bodies=tuple(Body(one.name, one.shape.geometry(), places(one, self.t)) for one in self.obstacles),
            nearest=self._nearest(),
        )

    def _nearest(self) -> Nearest | None:
        if not len(self) or len(self.clearance_points) != len(self):
            return None
        return Nearest(
            self.clearance_points,
            self.clearance,
            self.clearance_pairs,
            self.clearance_names,
            self.clearance_asked,
        )

    def play(self, *, port: int | None = None, open_browser: bool = True, ellipsoids: Wanted = False) -> None:
        """Play the motion in a browser with MeshCat; returns when the user ends it (Ctrl-C)."""
        door("nmm.playback:play")([self], port=port, open_browser=open_browser, ellipsoids=ellipsoids)

    def _repr_html_(self) -> str | None:
        """In a notebook: the page that plays it."""
        page: str | None = door("nmm.playback.inline:of_run")(self)
        return page


def _stays(path: Array) -> bool:
    return float(np.ptp(path, axis=0).max()) <= 1e-9
