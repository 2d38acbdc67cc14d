"""A log of a drive: what counters said, and what a reference saw meanwhile."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, scalar, unwritable, vector
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.lazy_call import lazy_call
from nmm.base.text_format import apart
from nmm.plugins.robot.calibration.log_checks import expect_forward

if TYPE_CHECKING:
    from nmm.model.robots.robot import Robot

#: Whether counters begin anew: all of them at a turn, which, or after how many of the column's own unit.
Wrapped = bool | str | Collection[str] | Mapping[str, bool | float] | None
Kind = Literal["poses", "positions", "ends"]
#: A log whose counters all moved less, rad or m, stands still.
STILL = 0.01


@dataclass(frozen=True, eq=False)
class DriveLog:
    """What a robot's counters said during a drive, and what a reference saw of it.

    Attributes
    ----------
    name : what errors and tables call it: the file's name
    t (N,) : when the counters were read, s; it increases
    readings : by name, (N,) each, rad or m, counted on without end: wheels, and joints of the platform's own,
        by the file's joints, with the file's signs; or inputs of the platform that were counted: their
        integrals
    reference_t (M,) : when the reference saw the robot, s, as its own clock stamps it
    reference : (M, 3) x, y, heading or (M, 2) x, y, m and rad, in the reference's world frame, of a point
        that is fixed on the robot; headings are counted on
    kind : "poses" (M, 3); "positions" (M, 2); "ends" (2, 3) or (2, 2): only where the drive begins and ends

    Raises
    ------
    InputError : by the log's name: shapes, numbers that are not finite, stamps that go back or come twice,
        clocks that do not overlap, fewer than two samples, a log or a reference that stands still

    Examples
    --------
    >>> t = np.linspace(0.0, 4.0, 5)
    >>> turned = {"left_wheel_joint": 5.0 * t, "right_wheel_joint": 5.0 * t}
    >>> log = nmm.DriveLog("straight on", t, turned, [0.0, 4.0], [[0, 0, 0], [2, 0, 0]], "poses")
    >>> len(log), log.duration, log.moved
    (5, 4.0, {'left_wheel_joint': 20.0, 'right_wheel_joint': 20.0})
    """

    name: str
    t: Array
    readings: Mapping[str, Array]
    reference_t: Array
    reference: Array
    kind: Kind

    def __post_init__(self) -> None:
        where = f"log {self.name}"
        expect_known("kind", self.kind, get_args(Kind), where)
        t = vector(self.t, None, f"{where}: t")
        expect(len(t) > 1, f"{where}: t", "at least two readings", len(t))
        expect_forward(t, f"{where}: t")
        expect(isinstance(self.readings, Mapping) and self.readings, f"{where}: readings", "counters by name")
        readings = {
            str(name): vector(values, len(t), f"{where}: readings of {name}")
            for name, values in self.readings.items()
        }
        seen = vector(self.reference_t, None, f"{where}: reference_t")
        rows = array(self.reference, f"{where}: reference")
        expected = {"poses": (3,), "positions": (2,), "ends": (2, 3)}[self.kind]
        if rows.ndim != 2 or rows.shape[1] not in expected or (self.kind == "ends" and len(rows) != 2):
            numbers = {"poses": "(M, 3)", "positions": "(M, 2)", "ends": "(2, 3) or (2, 2)"}[self.kind]
            raise InputError(where=f"{where}: reference", expected=f"numbers of shape {numbers}", got=rows)
        expect(len(rows) > 1, f"{where}: reference", "at least two samples", len(rows))
        expect(len(seen) == len(rows), f"{where}: reference_t", f"{len(rows)} stamps", len(seen))
        expect_forward(seen, f"{where}: reference_t")
        if self.kind == "poses":
            rows[:, 2] = np.unwrap(rows[:, 2])
        for name, value in (("t", t), ("reference_t", seen), ("reference", rows)):
            object.__setattr__(self, name, unwritable(value))
        object.__setattr__(self, "readings", {name: unwritable(one) for name, one in readings.items()})
        self._expect_moves(where)
        self._expect_overlap(where)

    def __len__(self) -> int:
        """How many readings there are, N."""
        return len(self.t)

    @property
    def duration(self) -> float:
        """From the first reading to the last, s."""
        return float(self.t[-1] - self.t[0])

    @property
    def moved(self) -> dict[str, float]:
        """How far each counter went, to and fro together, rad or m."""
        return {name: float(np.abs(np.diff(values)).sum()) for name, values in self.readings.items()}

    def part(self, t0: float, t1: float) -> DriveLog:
        """The log between two times of the counters' clock, s, with what the reference stamps between them.

        Raises
        ------
        InputError : fewer than two readings or samples there; a log of which only the ends are known
        """
        where = f"log {self.name}: part"
        first, last = scalar(t0, f"{where}: t0"), scalar(t1, f"{where}: t1")
        if self.kind == "ends":
            raise InputError("only where it begins and ends is known", where=where)
        within = (self.t >= first) & (self.t <= last)
        seen = (self.reference_t >= first) & (self.reference_t <= last)
        for what, some, times in (("readings", within, self.t), ("samples", seen, self.reference_t)):
            if some.sum() < 2:
                expected = f"two {what} at least between {first:g} and {last:g} s"
                raise InputError(where=where, expected=expected, got=f"{times[0]:.9g} to {times[-1]:.9g} s")
        readings = {name: values[within] for name, values in self.readings.items()}
        return DriveLog(
            self.name, self.t[within], readings, self.reference_t[seen], self.reference[seen], self.kind
        )

    @classmethod
    def closed(cls, name: str, t: ArrayLike, readings: Mapping[str, ArrayLike]) -> DriveLog:
        """A drive that ends where it began, with the heading that it had: a robot pushed against the same
        marks, as for UMBmark.

        Examples
        --------
        >>> t, turns = np.array([0.0, 10.0]), np.array([0.0, 2 * np.pi])
        >>> log = nmm.DriveLog.closed("on the spot", t, {"left_wheel_joint": -2.5 * turns,
        ...                                              "right_wheel_joint": 2.5 * turns})
        >>> log.kind, log.reference
        ('ends', array([[0., 0., 0.],
               [0., 0., 0.]]))
        """
        times = vector(t, None, f"log {name}: t")
        expect(len(times) > 1, f"log {name}: t", "at least two readings", len(times))
        return cls(name, times, readings, times[[0, -1]], np.zeros((2, 3)), "ends")  # type: ignore[arg-type]  # it makes arrays of them

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        robot: Robot,
        reference: str | Path | None = None,
        *,
        units: Mapping[str, str] | str | None = None,
        time: str = "t",
        reference_time: str | None = None,
        columns: Mapping[str, str] | None = None,
        wrapped: Wrapped = None,
        ends: str | ArrayLike | None = None,
        shift: float = 0.0,
        delimiter: str | None = None,
        name: str | None = None,
    ) -> DriveLog:
        """The log in a text file: a table with a header, whose delimiter is found.

        Counters are columns that have the names of the file's joints, or of the platform's inputs; the
        reference's are x, y and, where there is a heading, theta. Others are left out, and so are rows
        without a number (with a `RuntimeWarning`; a row of one table may be the reference's alone) and rows
        that have the stamp of the next. Rates are integrated.

        Parameters
        ----------
        path : the table of counters, with the reference's columns in it or not
        robot : whose it is
        reference : the reference's table, with stamps of its own
        units : of each group, or of one column by its name, asked for and never guessed: "wheels" (rad, deg,
            rev, ticks:2048 for counts of a turn, m:0.1 for a way by a radius; with /s, or rpm, for rates,
            with /row for what was counted since the row before, as ticks/row:2048), "steering" (of all joints
            that stand at an angle), "position" (m, cm, mm), "heading", "time" (s, ms, us, ns),
            "reference_time" (time's by default). An input's by its name: m/s for v, or m where its way was
            counted. "SI" for s, m and rad throughout
        time, reference_time : the columns of stamps, the latter time's name by default
        columns : the names of other columns, by joint, input, x, y or theta: {"left_wheel_joint": "enc_l"}
        wrapped : counters that begin anew: True, all angles after a turn; names; or by name True, False or
            after how many of the column's unit ({"left_wheel_joint": 65536}). None: as the readings show
            (after a turn, and of ticks after 2^16 and the like), with a warning
        ends : instead of a reference "closed", for a drive that ends where it began, or where it began and
            ended, (2, 3) or (2, 2), m and rad
        shift : added to the reference's stamps, s, which another clock may have made
        delimiter : between columns; found by default
        name : of the log; the file's by default

        Raises
        ------
        InputError : by file, line and column: no table, a column that is missing, a unit that nobody stated
            or that cannot be meant (by how fast wheels would turn, how far steering would go, how far the
            reference went: with what would fit), stamps that go back, counters that may have begun anew or
            not, or that do not determine the platform's inputs; and the causes of the constructor

        Examples
        --------
        >>> robot, t = nmm.load("differential_base"), np.linspace(0.0, 4.0, 9)
        >>> table = np.column_stack([1000 * t, 400 * t, 400 * t, 0.5 * t, 0 * t])
        >>> np.savetxt("drive.csv", table, header="ms,left,right,x,y", delimiter=",", comments="")
        >>> log = nmm.DriveLog.from_csv("drive.csv", robot, time="ms", units={
        ...     "time": "ms", "wheels": "ticks:500", "position": "m"
        ... }, columns={"left_wheel_joint": "left", "right_wheel_joint": "right"})
        >>> log.kind, log.duration, round(log.moved["left_wheel_joint"], 3)
        ('positions', 4.0, 20.106)
        """
        made = lazy_call("nmm.plugins.robot.calibration.log_csv:from_csv")
        log: DriveLog = made(path, robot, reference, units=units, time=time, reference_time=reference_time,
                             columns=columns, wrapped=wrapped, ends=ends, shift=shift, delimiter=delimiter,
                             name=name)  # fmt: skip
        return log

    @classmethod
    def from_bag(
        cls,
        path: str | Path,
        robot: Robot,
        reference: str = "tf",
        *,
        joints: str | Sequence[str] = "joint_states",
        odometry: str = "odom",
        tf: str = "tf",
        map: str = "map",
        odom: str = "odom",
        base: str | None = None,
        namespace: str = "",
        prefix: str | None = None,
        wrapped: Wrapped = None,
        name: str | None = None,
    ) -> DriveLog:
        """The log in a rosbag2 folder, an .mcap, a .db3 or ROS 1's .bag file.

        Wheels and joints of the platform's own are those of JointStates; of a wheel without positions the
        velocities are integrated. Times count from the first of them on, by the messages' headers. What is
        doubtful is a `RuntimeWarning`, as of `nmm.read_bag`.

        Parameters
        ----------
        path, robot : the bag, and whose it is
        reference : "tf", the frame `map` to the platform's reference point by transforms; where map → odom is
            corrected, poses are those at its corrections, since in between they are what wheels counted. Or a
            topic of PoseStamped, PoseWithCovarianceStamped, TransformStamped, Odometry or, without headings,
            PointStamped: of the platform's reference point where messages say a frame that leads to it, else
            of a point fixed on the robot
        joints, odometry, tf, map, odom, base, namespace, prefix : topics and frames, as of `nmm.read_bag`
        wrapped, name : as of `from_csv`

        Raises
        ------
        InputError : no bag; a topic, a wheel or a frame that is missing; a reference that is what the wheels
            counted: odometry in the frame `odom`, transforms that nothing corrects; the causes of `from_csv`

        Examples
        --------
        >>> worn = {"disturbances": {"odometry": True, "slip": {"v": 0.98}}, "method": "zoh", "dt": 0.01}
        >>> run = nmm.Scenario.load("unicycle_2r_position", worn | {"duration": 2}).run()
        >>> log = nmm.DriveLog.from_bag(run.save_mcap("drive.mcap"), run.robot)
        >>> log.kind, [*log.readings]
        ('poses', ['left_wheel_joint', 'right_wheel_joint'])
        """
        made = lazy_call("nmm.plugins.robot.calibration.log_bag:from_bag")
        log: DriveLog = made(path, robot, reference, joints=joints, odometry=odometry, tf=tf, map=map,
                             odom=odom, base=base, namespace=namespace, prefix=prefix, wrapped=wrapped,
                             name=name)  # fmt: skip
        return log

    def _expect_moves(self, where: str) -> None:
        name, way = max(self.moved.items(), key=lambda pair: pair[1])
        if way < STILL:
            what = f"it stands still: of its counters {name} went farthest, {way:.3g} rad (or m)"
            raise InputError(what, where=where, expected=f"at least {STILL:g}")
        if self.kind != "ends" and not np.ptp(self.reference, axis=0).any():
            what = f"the reference stands still in all samples, while {name} went {way:.3g} rad (or m)"
            raise InputError(what, where=where)

    def _expect_overlap(self, where: str) -> None:
        t, seen = self.t, self.reference_t
        within = int(((seen >= t[0]) & (seen <= t[-1])).sum())
        if within > 1:
            return
        by = float(seen[0] - t[0])
        side = "after" if by > 0.0 else "before"
        what = (
            f"the reference's stamps begin {abs(by):.3g} s {side} the counters' and last {np.ptp(seen):.3g} s"
        )
        begin, end = apart(float(t[0]), float(t[-1]))
        expected = f"two of them at least from {begin} to {end} s: one clock, or stamps shifted"
        raise InputError(what, where=where, expected=expected, got=within)
