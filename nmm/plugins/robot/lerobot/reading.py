"""Data sets of LeRobot's read back: an episode as a trajectory."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, vector
from nmm.base.errors import InputError, expect, expect_known, one_or_several
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.motion.trajectory import Trajectory
from nmm.plugins.robot.lerobot.doubts import of_joints, of_velocities
from nmm.plugins.robot.lerobot.layout import ACTION, INFO, PLACE, RATE, STATE
from nmm.plugins.robot.lerobot.stored import DataSet, Episode, EpisodeFrames
from nmm.plugins.robot.lerobot.units import ColumnUnits, Ranges, stated_units
from nmm.plugins.robot.ros.bag import along, as_trajectory, velocity_maps
from nmm.plugins.robot.ros.tracks import by_differences
from nmm.views.folders.whole import steady

#: The platform's velocities along its own axes, as `columns` names them, with LeKiwi's columns and SI units.
TWIST = {"vx": ("x.vel", "m/s"), "vy": ("y.vel", "m/s"), "omega": ("theta.vel", "rad/s")}
#: Actions beyond what was measured by more than this are told.
BEYOND = 1.1


def read_lerobot(
    folder: str | Path,
    robot: Robot,
    *,
    episodes: int | Sequence[int] | None = None,
    units: Mapping[str, str] | None = None,
    ranges: Ranges = None,
    calibration: str | Path | None = None,
    columns: Mapping[str, str] | None = None,
    start: ArrayLike = (0.0, 0.0, 0.0),
    frame: str | None = None,
) -> tuple[Trajectory, ...]:
    """The episodes of a data set of LeRobot's, v3.0, as the motion of a robot (docs/data_sets.md).

    q is made of `observation.state`: a coordinate of "q1.pos", or "q1"; the platform of "x.pos", "y.pos" and
    "theta.pos", or else of its velocities along its own axes, "x.vel", "y.vel" and "theta.vel", from `start`
    on. Other columns are left out, and on a fixed base the platform's. Joints are coordinates where the data
    set states its units, as nmm's do; in any other they are what encoders read, to which the robot's
    corrections apply (shares of a range that `ranges` gives are the coordinate's). Inputs are the actions of
    a data set all of whose episodes nmm wrote; in any other they are the nearest to the velocities that were
    measured, and to differences of q: actions are what was asked of the robot, not what it did. What is
    doubtful is a warning of the trajectory, and a `RuntimeWarning`.

    Parameters
    ----------
    folder : the data set
    robot : whose coordinates are read
    episodes : which; all when not given
    units : of columns whose units the data set does not state, by name or pattern: {"x.vel": "m/s",
        "theta.vel": "deg/s", "*.pos": "deg"}. m, mm, rad, deg, each also per second; "-100..100" and
        "0..100" are shares of a joint's range. A name counts before a pattern, a later pattern before an
        earlier one
    ranges : where such a range ends, rad or m, by coordinate, column or motor; "limits", of one or of all: at
        the robot's
    calibration : LeRobot's file, for the other ones: 0 is in the middle of a motor's range, as of LeRobot's
        degrees
    columns : of coordinates, and of vx, vy, omega, by name, where they are called otherwise
    start : x, y, theta of the platform at each episode's first frame, if only velocities are known, m and rad
    frame : the end-effector's frame, whose path is shown

    Returns
    -------
    tuple of Trajectory : labelled "episode 0", ...; without a task: r, errors and objective are empty or zero

    Raises
    ------
    InputError : no data set, another version, a damaged one; a column or an episode that it has not; a unit
        or a range that nobody states

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()
    >>> (episode,) = nmm.read_lerobot(nmm.write_lerobot(run, "circles", fps=100), run.robot, frame="ee")
    >>> bool(np.abs(episode.q - run.q[::2]).max() < 1e-6)
    True
    """
    several = None if episodes is None else one_or_several(episodes, int, "episodes", "numbers of episodes")
    begin = vector(start, 3, "start")

    def stored() -> tuple[_Measured, list[tuple[Episode, EpisodeFrames]]]:
        there = DataSet(Path(folder))
        given = Given(units, ranges, calibration, columns)
        measured = _Measured(there, robot, given, begin)
        features = [STATE, *([ACTION] if measured.actions else [])]
        return measured, [*there.frames([*there.episodes] if several is None else several, features)]

    measured, kept = steady(Path(folder), stored)
    read = []
    for episode, frames in kept:
        name = f"episode {episode.number}"
        try:
            q, u, findings = measured.motion(frames)
        except InputError as error:
            raise error.at(f"{folder}: {name}") from None
        for finding in findings:
            warnings.warn(f"{Path(folder).name}: {name}: {finding}", RuntimeWarning, stacklevel=2)
        made = as_trajectory(robot, frames.t, q, u, findings, frame=frame, label=name, resolver="lerobot")
        read.append(made)
    return tuple(read)


class Given(NamedTuple):
    """What the caller says of the columns."""

    units: Mapping[str, str] | None
    ranges: Ranges
    calibration: str | Path | None
    columns: Mapping[str, str] | None


class _Measured:
    """What of a robot the columns of a data set say, in SI units."""

    def __init__(self, stored: DataSet, robot: Robot, given: Given, start: Array) -> None:
        self.robot, self.start = robot, start
        self.where = f"{stored.folder / INFO}: features.{STATE}"
        self.known = stored.columns(STATE)
        expect(self.known, self.where, "names of what was observed")
        self.actions = stored.columns(ACTION)
        columns = {} if given.columns is None else given.columns
        expect(isinstance(columns, Mapping), "columns", "columns by coordinate", columns)
        names = dict(columns)
        for name in names:
            expect_known("coordinate", name, (*robot.q_names, *TWIST), "columns")
        self.joints = self._joints(names)
        self.twist: dict[str, tuple[str, str]] = {}
        if robot.platform.n_p:
            self._platform(names)
        features = stored.info.features
        stated = stated_units({STATE: features[STATE]}, stored.folder / INFO)
        available = [*dict.fromkeys([*self.known, *self.actions])]
        self.units = ColumnUnits(robot, stated, given.units, given.ranges, given.calibration, available)
        unit_of = dict(zip(robot.q_names, robot.q_units, strict=True))
        self.wanted = {column: unit_of[name] for name, column in self.joints.items()}
        self.wanted |= dict(self.twist.values())
        try:
            self.units.check(self.wanted)
        except InputError as error:
            raise (error if error.where.startswith("units") else error.at(self.where)) from None
        own = [f"{name}{RATE}" for name in robot.u_names]
        self.inputs = stored.ours and self.actions == own and features[ACTION].units == [*robot.u_units]

    def _joints(self, names: dict[str, str]) -> dict[str, str]:
        """The column of each coordinate that no other one leads, but x, y and theta."""
        robot, first = self.robot, min(3, self.robot.platform.n_p)
        asked = [robot.q_names[i] for i in robot.following.independent.tolist() if i >= first]
        found = {name: self._column(name, names) for name in asked}
        if missing := [name for name, column in found.items() if column is None]:
            expected = f"a column {missing[0]}{PLACE}, or columns={{{missing[0]!r}: its name}}"
            what = f"nothing says where {missing[0]} of {robot.name} is"
            raise InputError(what, where=self.where, expected=expected, available=self.known)
        return {name: column for name, column in found.items() if column is not None}

    def _column(self, name: str, names: dict[str, str], end: str = PLACE) -> str | None:
        if name in names:
            expect_known("column", names[name], self.known, f"columns: {name}")
            return names[name]
        return next((column for column in (f"{name}{end}", name) if column in self.known), None)

    def _platform(self, names: dict[str, str]) -> None:
        """The columns of x, y and theta, or else of the platform's velocities."""
        base = self.robot.q_names[:3]
        pose = {name: self._column(name, names) for name in base}
        if all(pose.values()):
            self.joints |= {name: column for name, column in pose.items() if column is not None}
            return
        if asked := [name for name in base if name in names]:
            missing = [name for name, column in pose.items() if column is None]
            expected = f"a column of {' and '.join(missing)}, too"
            raise InputError(where=f"columns: {asked[0]}", expected=expected, available=self.known)
        for name, (column, unit) in TWIST.items():
            known = names.get(name, column)
            if known in self.known:
                self.twist[name] = known, unit
        if len(self.twist) < len(TWIST):
            what = f"nothing says where the platform of {self.robot.name} is, nor how it moved"
            if self.actions:
                what += " (actions are what was asked of it)"
            expected = "columns x.pos, y.pos, theta.pos or x.vel, y.vel, theta.vel"
            raise InputError(what, where=self.where, expected=expected, available=self.known)

    def motion(self, frames: EpisodeFrames) -> tuple[Array, Array, list[Finding]]:
        """q (N, n), u (N, n_u) and what is doubtful of an episode."""
        robot, t, state = self.robot, frames.t, frames.rows[STATE]
        q, findings = np.zeros((len(t), robot.n)), list[Finding]()
        for name, column in self.joints.items():
            i = robot.q_names.index(name)
            q[:, i] = self._values(state, column, name)
            if robot.endless[i] and not self.inputs:
                q[:, i] = np.unwrap(q[:, i])
        twist = None
        if self.twist:
            known = [self._values(state, column, "") for column, _ in self.twist.values()]
            twist = np.column_stack(known)
            q[:, :3] = driven(self.start, t, twist)
            findings += [*self._beyond(frames, twist), *of_velocities(robot, q, twist)]
        if robot.mimic_joints:
            q = np.array([robot.following.placed(row) for row in q])
        findings += of_joints(robot, q)
        if self.inputs:
            return q, self._finite(frames.rows[ACTION], self.actions), findings
        return q, self._nearest(t, q, twist), findings

    def _values(self, state: Array, column: str, coordinate: str) -> Array:
        values = self._finite(state[:, [self.known.index(column)]], [column])[:, 0]
        return self.units.converted(values, column, self.wanted[column], coordinate)

    @staticmethod
    def _finite(rows: Array, names: Sequence[str]) -> Array:
        wrong = np.argwhere(~np.isfinite(rows))
        if len(wrong):
            k, i = wrong[0].tolist()
            what = f"{names[i]} is no finite number in {len({*wrong[:, 0].tolist()})} of {len(rows)} frames"
            raise InputError(f"{what}, first in frame {k}", got=float(rows[k, i]))
        return rows

    def _nearest(self, t: Array, q: Array, twist: Array | None) -> Array:
        """The inputs nearest to differences of q and to the platform's velocities."""
        if len(t) == 1 and twist is None:
            return np.zeros((1, self.robot.n_u))
        q_dot = by_differences(t, q, np.zeros(len(t) - 1, dtype=bool))
        if twist is not None:
            q_dot[:, :3] = along(twist, q[:, 2])
        maps = velocity_maps(self.robot, q)
        least = np.linalg.pinv(maps, rcond=np.finfo(float).eps * max(maps.shape[1:]))
        return np.einsum("kij,kj->ki", least, q_dot)

    def _beyond(self, frames: EpisodeFrames, twist: Array) -> list[Finding]:
        """Where the actions asked for more than the platform did: a robot's wheels are no faster than they
        are, whatever it is told."""
        columns = [column for column, _ in self.twist.values()]
        if not {*columns} <= {*self.actions}:
            return []
        asked = np.column_stack([frames.rows[ACTION][:, self.actions.index(column)] for column in columns])
        state = np.column_stack([frames.rows[STATE][:, self.known.index(column)] for column in columns])
        shares = [(_most(asked, part) / most) for part in ([0, 1], [2]) if (most := _most(state, part)) > 0.0]
        if not shares or not max(shares) > BEYOND:
            return []
        return [Finding("actions_beyond", {"times": float(max(shares))})]


def _most(rows: Array, part: list[int]) -> float:
    return float(np.nanmax(np.linalg.norm(rows[:, part], axis=1), initial=0.0))


def driven(start: Array, t: Array, twist: Array) -> Array:
    """Poses (N, 3) of a platform that begins at `start` and moves with velocities (N, 3) along its own axes,
    linear between the times; each stretch is an arc of the mean velocity."""
    dt = np.diff(t)
    mean = 0.5 * (twist[1:] + twist[:-1])
    turns = mean[:, 2] * dt
    theta = start[2] + np.concatenate([[0.0], np.cumsum(turns)])
    chord = np.sinc(turns / (2.0 * np.pi)) * dt * (mean[:, 0] + 1j * mean[:, 1])
    steps = chord * np.exp(1j * (theta[:-1] + 0.5 * turns))
    z = start[0] + 1j * start[1] + np.concatenate([[0.0], np.cumsum(steps)])
    return np.column_stack([z.real, z.imag, theta])
