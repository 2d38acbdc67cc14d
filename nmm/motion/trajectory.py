"""A trajectory: what a run recorded, with the names, the outcome and what people look at in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.ellipsoid_options import Wanted
from nmm.base.errors import expect_known
from nmm.base.figure_options import Drawn
from nmm.base.findings import Finding
from nmm.base.findings.run import line
from nmm.base.lazy_call import lazy_call
from nmm.base.machine import made_with
from nmm.base.trust import trusting
from nmm.control.sequencing.sequence import Event
from nmm.control.step.quantities import QUANTITIES, Record
from nmm.model.collisions.obstacle import Obstacle, obstacle_places
from nmm.model.robots.motion import Motion, Nearest
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import NO_SURROUNDINGS, Body, Surroundings
from nmm.motion.residuals import NO_RESIDUALS, Residuals
from nmm.motion.seen import RunCamera
from nmm.motion.verdict import AS_ASKED, Awaited, Verdict
from nmm.motion.verdict import Outcome as Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nmm.model.dynamics.torques import Torques


@dataclass(frozen=True, eq=False)
class Trajectory:
    """N samples of a closed loop, both ends included.

    Attributes
    ----------
    robot : the robot that moved
    t (N,) s; q (N, n); u (N, n_u): times, coordinates, inputs, in `robot.q_units`, `robot.u_units`
    q_dot (N, n): S(q) u, per second
    u_dot (N, n_u): accelerations of the inputs, per second, at order 2, else None
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
    margin (N,): least distance to a limit, as a share of its range (see `nmm.motion.margins`), of all but the
        coordinates that stand still throughout; below 0 where one is broken, infinite without limits
    shares (N, limited): where each of `limit_names` is between its limits, 0 at the lower, 1 at the upper one
    limited : whether the controller kept limits
    unmet : where J u differed from the rate
    r_names, r_units : the task's rows
    resolver, method, dt : how it was made
    verdict : how it ended, why, and what else is worth a warning; `outcome`, `findings`, `message` and
        `warnings` are read from it. Of a run that went wrong a shorter dt is tried when one of these is first
        read (of `outcome`, where it depends on that)
    frame : the end-effector frame that the task positions, if any
    path, desired (N, 3): its path and, where the task says, the desired one, m in the world
    believed (N, n): where odometry, or a filter, has the robot, which is what the controller sees, if it has
        one
    target (3,): the fixed point that a bearing looks at, if any
    seen (N, P, 3): the points that cameras see, m in the world, if any
    cameras : which of them each camera sees, and where the task wants them in its picture
    clearance (N,): least distance between shapes that are kept apart, m, infinite where none are
    clearance_between (N,): the least on the way to the next sample, m
    clearance_pairs (N,): which of `clearance_names` is nearest, -1 for none
    clearance_points (N, 6): the two points that are nearest, in the order of the names, m in the world
    clearance_asked : the distance that was to be kept, m
    obstacles : what the robot kept off, where it was
    surroundings : what its scenario draws beside it: loads, scenery, how the page opens
    kinematics_off : the most by which kinematics that were compiled differ from Pinocchio's at the first, the
        middle and the last sample, m and rad; not a number where Pinocchio computed all
    scenario : the scenario as resolved, if it came from one
    events : when tasks that come and go began and ended, and why
    label : what it is called among other runs; "" for its resolver
    made_with : the versions and the machine that computed it (`nmm.base.machine`); empty where not saved
    more : further recorded quantities by name; `trajectory[name]` is any of them

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
    verdict: Verdict | Awaited = AS_ASKED
    frame: str | None = None
    path: Array | None = None
    desired: Array | None = None
    planned: Array | None = None
    believed: Array | None = None
    u_dot: Array | None = None
    target: Array | None = None
    seen: Array | None = None
    unmet: Residuals = NO_RESIDUALS
    limited: bool = False
    shares: Array = field(default_factory=QUANTITIES["shares"].absent)
    limit_names: tuple[str, ...] = ()
    step_size: Array = field(default_factory=QUANTITIES["step_size"].absent)
    crossed: Integers = field(default_factory=QUANTITIES["crossed"].absent)
    clearance: Array = field(default_factory=QUANTITIES["clearance"].absent)
    clearance_between: Array = field(default_factory=QUANTITIES["clearance_between"].absent)
    clearance_pairs: Integers = field(default_factory=QUANTITIES["clearance_pairs"].absent)
    clearance_points: Array = field(default_factory=QUANTITIES["clearance_points"].absent)
    clearance_names: tuple[str, ...] = ()
    clearance_asked: float = 0.0
    obstacles: tuple[Obstacle, ...] = ()
    kinematics_off: float = float("nan")
    scenario: dict[str, Any] | None = field(default=None)
    events: tuple[Event, ...] = ()
    cameras: tuple[RunCamera, ...] = ()
    surroundings: Surroundings = NO_SURROUNDINGS
    label: str = ""
    made_with: dict[str, str | int] = field(default_factory=made_with)
    more: dict[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, arrays: Mapping[str, Any], **rest: Any) -> Trajectory:
        """With those arrays by name, and what else it has; what is no attribute goes into `more`."""
        own = {name: value for name, value in arrays.items() if name in cls.__dataclass_fields__}
        return cls(**own, **rest, more={name: arrays[name] for name in arrays if name not in own})

    def __getitem__(self, name: str) -> Array:
        """A recorded quantity by its name (`nmm.control.step.quantities`); else `InputError`."""
        expect_known(
            "quantity",
            name,
            [quantity.name for quantity in QUANTITIES.values() if quantity.saved or quantity.of],
        )
        quantity, known = QUANTITIES[name], {**vars(self), **self.more}
        if name in known:
            return known[name]
        if quantity.of is None:
            return quantity.absent(N=len(self))
        return quantity.of(Record(self.robot, {each: known[each] for each in QUANTITIES if each in known}))

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        end = f"{self.t[-1]:g} s in {len(self)} samples" if len(self) else "no samples"
        return f"Trajectory({self.robot.name}, {self.resolver}, {self.outcome}, {end})"

    @property
    def order(self) -> int:
        """2 where the run has accelerations of the inputs, u_dot, else 1."""
        return 1 if self.u_dot is None else 2

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        return self.verdict.outcome

    @property
    def message(self) -> str:
        """Why it ended so, in words; empty where there is nothing to say."""
        return line(self.verdict.reasons)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What else is worth a warning, in words."""
        return tuple(line(findings) for findings in self.verdict.warnings)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What `message` and `warnings` say, as data (docs/api/findings.md lists the codes)."""
        return (*self.verdict.reasons, *(finding for many in self.verdict.warnings for finding in many))

    @property
    def complete(self) -> bool:
        """Whether the run reached its end, and its task error decayed as its gain asks."""
        return self.outcome is Outcome.COMPLETED

    @property
    def called(self) -> str:
        """What tables, legends and messages call it."""
        return self.label or self.resolver.upper()

    @property
    def error_norm(self) -> Array:
        """‖e‖ of the tasks active at each sample, (N,), in the mixed units of the rows."""
        return self["error_norm"]

    @property
    def switched(self) -> list[int]:
        """The samples from which RG has another partition."""
        return np.flatnonzero(self["partition_changes"]).tolist()

    @property
    def switches(self) -> int:
        """How often RG changed its partition."""
        return len(self.switched)

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
        new = [x for i, x in enumerate(points) if not any(np.allclose(x, other) for other in points[:i])]
        return np.array(new).reshape(-1, 3)

    @property
    def marks(self) -> Array:
        """(K, 3) m in the world: the fixed points that figures and playback show, looked at or held."""
        return self.held if self.target is None else self.target[np.newaxis]

    @property
    def _stretches(self) -> list[Array]:
        if self.desired is None:
            return []
        events = np.searchsorted(self.t, sorted({event.t for event in self.events}))
        return [part for part in np.split(self.desired, events) if len(part)]

    def with_scenario(
        self,
        scenario: dict[str, Any],
        warnings: Sequence[Finding] = (),
        surroundings: Surroundings = NO_SURROUNDINGS,
    ) -> Trajectory:
        """The same trajectory with the scenario that it came from, what that warns of and draws beside it."""
        verdict = self.verdict.after(warnings)
        return replace(self, scenario=scenario, verdict=verdict, surroundings=surroundings)

    def summary(self, motors: bool = True) -> dict[str, Any]:
        """The run in numbers, ready for JSON; `motors`: also motors over their limits, and a robot that tips,
        as findings of the line "motors"."""
        return lazy_call("nmm.motion.diagnosis.summary:summarise")(self, motors)

    def save(
        self, folder: str | Path, *, figures: Drawn = True, html: bool = False, ellipsoids: Wanted = False
    ) -> Path:
        """Write the run's folder (`nmm.views.folders.run.save`): arrays, tables, summary, figures, page."""
        return lazy_call("nmm.views.folders.run:save")(
            self, folder, figures=figures, html=html, ellipsoids=ellipsoids
        )

    def save_mcap(self, path: str | Path, start: float = 0.0) -> Path:
        """Write the motion as a log of ROS 2's messages (.mcap), for Foxglove, Rerun and `ros2 bag`: joint
        states, TF, odometry, poses, twist, inputs, task error, paths, events, the whole robot's description
        (docs/ros.md). `start`: the clock's time of t = 0, s.

        Raises
        ------
        InputError : without the extra `ros`, another suffix, a run without samples, a place that cannot be
            written; no part of a file is left then
        """
        written: Path = lazy_call("nmm.plugins.robot.ros.log:save_mcap")(self, path, start)
        return written

    @staticmethod
    def load(folder: str | Path, robot: Robot | None = None, *, trust: bool = False) -> Trajectory:
        """Read a run's folder; with the robot it ran on, if that was put together in Python. `trust`: of the
        robot's file, as of `nmm.load`.

        Raises
        ------
        InputError : it is no run's folder, or its robot cannot be loaded, or is another one
        """
        with trusting(trust):
            run: Trajectory = lazy_call("nmm.views.folders.run:load")(folder, robot)
            return run

    def plot(self, **options: float) -> Figure:
        """One figure that shows the run: the motion from above, errors, objective, inputs; `width`, in."""
        return lazy_call("nmm.views.figures:overview")(self, **options)

    def plot_ellipses(self, path: str | Path | None = None, options: Wanted = True) -> Figure:
        """The end-effector's path with manipulability ellipses; with a path, as a file, too."""
        return lazy_call("nmm.views.figures.ellipses:ellipses")(self, options, path)

    def torques(self, payload: Mapping[str, Any] | None = None) -> Torques:
        """What the motion asks of the motors, with masses carried, kg by frame (see `nmm.Dynamics`); what the
        scenario says is carried when not given."""
        payload = self.surroundings.payload if payload is None else payload
        torques: Torques = lazy_call("nmm.model.dynamics.torques:torques_along")(
            self.robot, self.t, self.q, self.u, payload, u_dot=self.u_dot
        )
        return torques

    def motion(self, label: str | None = None) -> Motion:
        """What playback shows of it."""
        near = self.clearance_points, self.clearance, self.clearance_pairs
        return Motion(
            robot=self.robot,
            t=self.t,
            q=self.q,
            u=self.u,
            path=self.path,
            desired=self.moving,
            planned=self.planned,
            believed=self.believed,
            target=self.marks if len(self.marks) else None,
            label=self.called if label is None else label,
            frame=self.frame,
            bodies=tuple(
                Body(obstacle.name, obstacle.shape.drawn(), obstacle_places(obstacle, self.t))
                for obstacle in self.obstacles
            ),
            nearest=Nearest(*near, self.clearance_names, self.clearance_asked)
            if len(self) and len(self.clearance_points) == len(self)
            else None,
            surroundings=self.surroundings,
            cameras=()
            if self.seen is None
            else tuple(camera.on(self.seen, self.r_d) for camera in self.cameras),
        )

    def play(self, *, port: int | None = None, open_browser: bool = True, ellipsoids: Wanted = False) -> None:
        """Play the motion in a browser with MeshCat; returns when the user ends it (Ctrl-C)."""
        lazy_call("nmm.views.playback:play")(
            [self], port=port, open_browser=open_browser, ellipsoids=ellipsoids
        )

    def _repr_html_(self) -> str | None:
        """In a notebook: the page that plays it."""
        page: str | None = lazy_call("nmm.views.playback.html:of_run")(self)
        return page


def _stays(path: Array) -> bool:
    return float(np.ptp(path, axis=0).max()) <= 1e-9
