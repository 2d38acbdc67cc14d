"""Sightings: what a tracker or a camera saw of an arm that stood still, and what its encoders read."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Flags, matrix, unwritable, vector
from nmm.base.errors import expect, expect_kind, expect_known
from nmm.base.lazy_call import lazy_call
from nmm.plugins.robot.calibration.arm.intrinsics import CameraIntrinsics
from nmm.plugins.robot.calibration.arm.seen import checked_seen

if TYPE_CHECKING:
    from nmm.model.robots.robot import Robot

Kind = Literal["points", "poses", "corners"]
#: What stands still: not on the robot.
WORLD = "world"
#: What sees and what is seen are called so, where they have no name, by kind.
SENSORS = {"points": "tracker", "poses": "tracker", "corners": "camera"}
TARGETS = {"points": "point", "poses": "body", "corners": "board"}
#: Beginnings of the names of a robot's numbers.
TAKEN = ("radius", "offset", "ratio", "origin", "noise", "held_out", "whiteness", "findings")


@dataclass(frozen=True, eq=False)
class Sightings:
    """What something saw of a robot's arm in N postures in which all stood still.

    What sees sits on a frame of the robot, or stands in the world; what is seen is on another frame of the
    robot, or in the world: a tracker in the hall and a ball on the hand (by="world", on="tool0"); a camera on
    the hand and a board on a table (by="camera_optical_frame", on="world"); a camera on the head and a marker
    on the hand.

    Attributes
    ----------
    name : what errors and tables call it: the file's name
    readings : by joint, (N,) each, rad or m, of encoders, with the file's names and signs
    seen : what was seen, in the axes of what sees: of "points" (N, 3), m; of "poses" (N, 7), x, y, z, m, and
        a quaternion x, y, z, w, or (N, 4, 4); of "corners" pixels (N, m, 2), NaN for a corner that was not
        seen
    kind : "points", "poses" or "corners"
    on : the frame of the robot that carries what is seen, or "world"
    by : the frame of the robot that sees, which the camera's is, or "world"
    camera : intrinsics, of corners
    board : of corners (m, 3), m, in the board's frame
    base : (N, 3) x, y, theta of the platform, m and rad, where it moved in between
    sensor : what sees, where `by` only carries it: its mount there is <sensor>.x, .y, ...; without, a frame
        that a fixed joint places is the camera's own, and is what is learned, and of the world it is
        "tracker" or "camera"
    target : what is seen, its place on `on` <target>.x, ...; "point", "body" or "board" by default. Logs that
        name the same share it

    Raises
    ------
    InputError : by the log's name: shapes, numbers that are not finite, a pose that is none, an unknown kind,
        corners outside the picture, a board whose points are in a line, fewer than three samples

    Examples
    --------
    >>> turns = np.linspace(-1.0, 1.0, 5)
    >>> seen = np.stack([0.5 * np.cos(turns), 0.5 * np.sin(turns), 0.0 * turns], axis=1)
    >>> log = nmm.Sightings("tracker", {"q1": turns}, seen, "points", on="ee")
    >>> len(log), log.by, log.sensor, log.target
    (5, 'world', 'tracker', 'point')
    """

    name: str
    readings: Mapping[str, Array]
    seen: Array
    kind: Kind
    on: str
    by: str = WORLD
    camera: CameraIntrinsics | None = None
    board: Array | None = None
    base: Array | None = None
    sensor: str = ""
    target: str = ""
    own_frame: bool = field(init=False, repr=False, default=False)

    def __post_init__(self) -> None:
        where = f"sightings {self.name}"
        expect_known("kind", self.kind, get_args(Kind), where)
        for side in ("on", "by"):
            expect_kind(getattr(self, side), str, f"{where}: {side}", "a frame of the robot, or 'world'")
        expect(self.on != self.by, where, "two frames: what sees, and what is seen", self.on)
        expect(
            isinstance(self.readings, Mapping) and self.readings, f"{where}: readings", "readings by joint"
        )
        seen, board = checked_seen(self.seen, self.kind, self.camera, self.board, where)
        many = len(seen)
        expect(many > 2, where, "at least three samples", many)
        readings = {
            str(name): unwritable(vector(values, many, f"{where}: readings of {name}"))
            for name, values in self.readings.items()
        }
        if self.base is not None:
            object.__setattr__(self, "base", unwritable(matrix(self.base, (many, 3), f"{where}: base")))
        object.__setattr__(self, "own_frame", not self.sensor and self.by != WORLD)
        for side, usual in (("sensor", SENSORS), ("target", TARGETS)):
            label = getattr(self, side) or usual[self.kind]
            plain = isinstance(label, str) and label.isidentifier() and label not in TAKEN
            expect(plain, f"{where}: {side}", "a plain name, as 'tracker'", label)
            object.__setattr__(self, side, label)
        expect(self.sensor != self.target, where, "two names: sensor and target", self.sensor)
        object.__setattr__(self, "readings", readings)
        object.__setattr__(self, "seen", unwritable(seen))
        object.__setattr__(self, "board", None if board is None else unwritable(board))

    def __len__(self) -> int:
        """How many samples there are, N."""
        return len(self.seen)

    @property
    def visible(self) -> Flags:
        """What was seen: (N,), of corners (N, m)."""
        if self.kind == "corners":
            return np.isfinite(self.seen[:, :, 0])
        return np.ones(len(self), dtype=bool)

    def part(self, first: int, last: int) -> Sightings:
        """The samples from the first on, before the last."""
        some = slice(first, last)
        made = copy.copy(self)
        readings = {name: values[some] for name, values in self.readings.items()}
        base = None if self.base is None else self.base[some]
        for name, value in (("readings", readings), ("seen", self.seen[some]), ("base", base)):
            object.__setattr__(made, name, value)
        return made

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        robot: Robot,
        on: str,
        by: str = WORLD,
        *,
        units: Mapping[str, str] | str | None = None,
        columns: Mapping[str, str] | None = None,
        camera: CameraIntrinsics | str | Path | None = None,
        board: ArrayLike | str | None = None,
        sensor: str = "",
        target: str = "",
        delimiter: str | None = None,
        name: str | None = None,
    ) -> Sightings:
        """The sightings in a text file: a table with a header, a row for each posture.

        Joints are columns of their names. Points are columns x, y, z; poses x, y, z, qx, qy, qz, qw; corners
        u1, v1, u2, v2, ... in the order of the board's points, empty where a corner was not seen. Where the
        platform moved, base_x, base_y and base_theta say where it stood. Other columns are left out.

        Parameters
        ----------
        path, robot : the table, and whose joints they are
        on, by, sensor, target : as of the constructor
        units : by group or column, asked for and never guessed: "joints" (rad, deg, rev, ticks:4096 for
            counts of a turn), "slides" (of joints that slide: m, cm, mm), "position" (of what is seen),
            "base", "heading"; "SI" for rad and m throughout. Pixels have none
        columns : the names of other columns, by joint, x, y, z, qx, ...: {"x": "X [mm]"}
        camera : intrinsics of corners, or a file of ROS's camera calibration
        board : of corners, points (m, 3), m, or text: "9x6:0.025" for 9 by 6 corners 0.025 m apart, along x
            first, then y
        delimiter : between columns; found by default
        name : of the log; the file's by default

        Raises
        ------
        InputError : by file, line and column: no table, a column that is missing, a unit that nobody stated;
            and the causes of the constructor. Rows without a number are left out, with a `RuntimeWarning`

        Examples
        --------
        >>> robot, turns = nmm.load("unicycle_2r"), np.linspace(-60.0, 60.0, 7)
        >>> table = np.column_stack([turns, 0.5 * turns, 500 + turns, 2 * turns, 300 + 0 * turns])
        >>> np.savetxt("seen.csv", table, header="q1,q2,x,y,z", delimiter=",", comments="")
        >>> log = nmm.Sightings.from_csv("seen.csv", robot, "ee", units={"joints": "deg", "position": "mm"})
        >>> log.kind, log.readings["q1"].round(3)[0], log.seen[0]
        ('points', np.float64(-1.047), array([ 0.44, -0.12,  0.3 ]))
        """
        made = lazy_call("nmm.plugins.robot.calibration.arm.sightings_csv:from_csv")
        log: Sightings = made(path, robot, on, by, units=units, columns=columns, camera=camera, board=board,
                              sensor=sensor, target=target, delimiter=delimiter, name=name)  # fmt: skip
        return log

    @classmethod
    def from_bag(
        cls,
        path: str | Path,
        robot: Robot,
        on: str,
        by: str = WORLD,
        reference: str | None = None,
        *,
        joints: str | Sequence[str] = "joint_states",
        odometry: str = "odom",
        tf: str = "tf",
        map: str = "map",
        odom: str = "odom",
        base: str | None = None,
        namespace: str = "",
        prefix: str | None = None,
        sensor: str = "",
        target: str = "",
        name: str | None = None,
    ) -> Sightings:
        """The sightings in a rosbag2 folder, an .mcap, a .db3 or ROS 1's .bag file, recorded all the while.

        A sample is taken wherever all joints of the arm stand for 0.8 s: means of what they read and of what
        is seen, without its outliers, from a quarter of a second after they stop until a quarter before they
        go on, so that clocks may be as far apart. What moves by less than 0.01 rad in half a second stands.

        Parameters
        ----------
        path, robot : the bag, and whose joints are in it
        on, by, sensor, target : as of the constructor
        reference : the topic of what is seen, of PoseStamped, PoseWithCovarianceStamped, TransformStamped,
            Odometry or, of points, PointStamped; or in TF the frame that sees and the one that is seen,
            "camera_optical_frame:marker_3". Never guessed
        joints, odometry, tf, map, odom, base, namespace, prefix : topics and frames, as of `nmm.read_bag`;
            odometry and transforms tell whether the platform stands, and are looked for where they are asked
            for
        name : of the log; the file's by default

        Raises
        ------
        InputError : no bag; a topic, a frame or a joint that is missing; messages that speak of another frame
            of the robot than `on` and `by`; transforms that the robot's own joints made; an arm that does not
            stand, or is seen moving where its joints stand, or in two places by turns; clocks a second apart;
            a platform that moves. What is left out, and what is in doubt, is a `RuntimeWarning`

        Examples
        --------
        >>> robot = nmm.load("unicycle_2r")
        >>> run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5}).run()
        >>> nmm.Sightings.from_bag(run.save_mcap("run.mcap"), robot, "ee")
        Traceback (most recent call last):
            ...
        nmm.base.errors.InputError: run.mcap: reference: expected what saw it: a topic of poses or points, ...
        """
        made = lazy_call("nmm.plugins.robot.calibration.arm.sightings_bag:from_bag")
        log: Sightings = made(path, robot, on, by, reference, joints=joints, odometry=odometry, tf=tf,
                              map=map, odom=odom, base=base, namespace=namespace, prefix=prefix,
                              sensor=sensor, target=target, name=name)  # fmt: skip
        return log


def named_apart(logs: Sequence[Sightings]) -> list[Sightings]:
    """Logs by names of their own: a second one of a name is numbered, "touched.csv (2)"."""
    made: list[Sightings] = []
    taken = {log.name for log in logs}
    for log in logs:
        name, number = log.name, 1
        while (number > 1 and name in taken) or name in {other.name for other in made}:
            number += 1
            name = f"{log.name} ({number})"
        if number > 1:
            log = copy.copy(log)
            object.__setattr__(log, "name", name)
        made.append(log)
    return made
