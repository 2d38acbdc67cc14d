"""Pictures as Rerun takes them: live to its viewer, or in an .rrd file."""

from __future__ import annotations

import tempfile
import uuid
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.streams.pictures import RobotPicture, Said, Still, Trail, Triangles, axes
from nmm.plugins.streams.sensed_surfaces import SensedSurfaces
from nmm.plugins.streams.tools import RERUN, imported

#: What the end of a whole file begins with.
END = b"RRF2FOOT"
#: Entities: what is in the world's frame, and the robot, each shape in its link's.
WORLD, ROBOT = "world", "robot"
#: Timelines: of the run, s, and of the clock.
RUN_TIME, CLOCK = "t", "time"
Parts = tuple[str, ...]
DRIVEN, ODOMETRY, DESIRED = ((WORLD, "path", name) for name in ("driven", "odometry", "desired"))
NEAREST, TARGET, TARGETS, BASE = ((WORLD, name) for name in ("nearest", "target", "targets", "odometry"))
DISTANCE: Parts = ("distance",)
BLUE, ORANGE, GREEN, RED = (31, 119, 180), (255, 127, 14), (44, 160, 44), (214, 39, 40)
COLORS = {DRIVEN: BLUE, ODOMETRY: ORANGE, DESIRED: GREEN, NEAREST: RED, TARGET: GREEN}
THING = (150, 150, 150, 160)
#: Length of the axes of odometry, m; radius of a target, m.
LENGTH, RADIUS = 0.3, 0.03
#: The surface of what is not drawn any more.
NOTHING = Triangles(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))


class RerunSink:
    """A recording; `file`, or the `address` of a viewer, says where to. A viewer may take `patience`, s, for
    what is left in the end.

    It sends columns, of as many pictures as there are: a call takes as long for one as for a hundred.
    """

    def __init__(self, still: Still, file: Path | None, address: str = "", patience: float = 0.0) -> None:
        self._rr, self._still = imported(RERUN), still
        self._trails: dict[Parts, Trail] = defaultdict(Trail)
        self._known: set[Parts] = set()
        self._surfaces = SensedSurfaces(still)
        self._recording = self._rr.RecordingStream("nmm", recording_id=uuid.uuid4())
        self._file = file
        self._flushed: dict[str, float] = {} if file is not None else {"timeout_sec": patience}
        if file is None:
            self._recording.connect_grpc(address)
        else:
            self._recording.save(str(file))
        self._recording.send_recording_name(still.title)
        self._recording.send_recording_start_time_nanos(still.start)
        self._recording.send_blueprint(self._blueprint(live=file is None))
        self._draw_still()

    def take(self, items: Sequence[RobotPicture | Said]) -> None:
        """Send pictures and lines of text."""
        if lines := [one for one in items if isinstance(one, Said)]:
            self._say(lines)
        if pictures := [one for one in items if isinstance(one, RobotPicture)]:
            self._show(pictures)

    def _say(self, lines: list[Said]) -> None:
        rr = self._rr
        levels = [rr.TextLogLevel.WARN if line.warns else rr.TextLogLevel.INFO for line in lines]
        texts = [f"{line.who}: {line.text}" if line.who else line.text for line in lines]
        self._send(("log",), lines, rr.TextLog.columns(text=texts, level=levels))

    def close(self, about: Mapping[str, str]) -> None:
        """Send what is left, and the recording's property nmm; a file is whole then."""
        try:
            self._recording.send_property("nmm", self._rr.AnyValues(**about))
            self._recording.flush(**self._flushed)
        finally:
            self._recording.disconnect()
        if self._file is not None and not ends_whole(self._file):
            raise RuntimeError("its end is missing")  # the package logs that, and raises nothing

    def _path(self, parts: Parts) -> str:
        """An entity's path, in which characters of names that mean something to Rerun are escaped."""
        return str(self._rr.new_entity_path([*parts]))

    def _send(self, parts: Parts, at: Sequence[RobotPicture | Said], columns: Any) -> None:
        stamps = np.array([one.stamp for one in at], dtype="datetime64[ns]")
        elapsed = np.array([round(1e9 * one.t) for one in at], dtype="timedelta64[ns]")
        times = [
            self._rr.TimeColumn(RUN_TIME, duration=elapsed),
            self._rr.TimeColumn(CLOCK, timestamp=stamps),
        ]
        self._recording.send_columns(self._path(parts), times, columns)

    def _log(self, parts: Parts, *what: Any) -> None:
        self._recording.log(self._path(parts), *what, static=True)

    def _is_new(self, parts: Parts, *what: Any) -> bool:
        """Whether nothing of this entity was sent; what it is like in the world's frame is sent now, then."""
        if parts in self._known:
            return False
        self._known.add(parts)
        self._log(parts, self._rr.CoordinateFrame(self._still.world), *what)
        return True

    def _blueprint(self, live: bool) -> Any:
        blueprint = imported(f"{RERUN}.blueprint")
        information = blueprint.SpatialInformation(self._still.world)
        space = blueprint.Spatial3DView(
            origin=f"/{WORLD}",
            contents=[f"/{WORLD}/**", f"/{ROBOT}/**"],
            name="robot",
            spatial_information=information,
        )
        curves = [blueprint.TimeSeriesView(origin=name, name=name)
                  for name in ("inputs", "error", "distance", "joints")]  # fmt: skip
        beside = blueprint.Vertical(*curves, blueprint.TextLogView(origin="log", name="log"))
        panel = blueprint.TimePanel(timeline=CLOCK if live else RUN_TIME)
        return blueprint.Blueprint(blueprint.Horizontal(space, beside, column_shares=[3, 2]), panel)

    def _draw_still(self) -> None:
        rr, still = self._rr, self._still
        self._is_new((WORLD,), rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        self._draw_robot()
        for parent, child, position, turn in still.fixed:
            place = {"translation": position, "quaternion": turn, "parent_frame": parent}
            self._log((WORLD, "frames", child), rr.Transform3D(**place, child_frame=child))
        if len(still.desired):
            self._is_new(DESIRED, rr.LineStrips3D([still.desired], colors=[GREEN]))
        if len(still.marks):
            self._is_new(TARGETS, rr.Points3D(still.marks, colors=[GREEN], radii=[RADIUS]))
        self._is_new(BASE, rr.Arrows3D.from_fields(colors=[(255, 0, 0), (0, 160, 0), (0, 0, 255)]))
        curves = {"inputs": still.inputs, "error": still.errors, "joints": still.coordinates}
        for of, named in curves.items():
            for name, unit in named:
                self._log((of, name), rr.SeriesLines(names=[f"{name}, {unit}" if unit else name]))

    def _draw_robot(self) -> None:
        """What the description draws, each shape in its link's frame, without transforms of its own."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "robot.urdf"
            file.write_text(self._still.description, encoding="utf-8", errors="replace")
            tree = imported(f"{RERUN}.urdf").UrdfTree.from_file_path(file, entity_path_prefix=ROBOT)
            self._recording.send_chunks(tree.stream(include_joint_transforms=False))

    def _show(self, pictures: list[RobotPicture]) -> None:
        moving: dict[str, list[tuple[RobotPicture, str, Array, Array]]] = defaultdict(list)
        for picture in pictures:
            for parent, child, position, turn in picture.transforms:
                moving[child].append((picture, parent, position, turn))
        for child, rows in moving.items():
            at, parents, positions, turns = zip(*rows, strict=True)
            columns = self._rr.Transform3D.columns(
                translation=np.array(positions),
                quaternion=np.array(turns),
                parent_frame=[*parents],
                child_frame=[child] * len(rows),
            )
            self._send((WORLD, "frames", child), at, columns)
        self._plot("inputs", self._still.inputs, pictures, [one.u for one in pictures])
        self._plot("error", self._still.errors, pictures, [one.error for one in pictures])
        self._plot("joints", self._still.coordinates, pictures, [one.q for one in pictures])
        self._show_paths(pictures)
        self._show_points(pictures)
        self._show_bodies(pictures)

    def _plot(
        self, of: str, named: list[tuple[str, str]], pictures: list[RobotPicture], values: list[Array]
    ) -> None:
        """Curves of values (K,) at each picture, where they are numbers."""
        for k, (name, _) in enumerate(named):
            known = [i for i, row in enumerate(values) if np.isfinite(row[k])]
            if known:
                columns = self._rr.Scalars.columns(scalars=[float(values[i][k]) for i in known])
                self._send((of, name), [pictures[i] for i in known], columns)

    def _show_paths(self, pictures: list[RobotPicture]) -> None:
        rr, lines = self._rr, defaultdict[Parts, list[tuple[RobotPicture, Array]]](list)
        for picture in pictures:
            ends: dict[Parts, Array | None] = {
                DRIVEN: picture.reached,
                ODOMETRY: picture.seen[0] if picture.seen else None,
            }
            if not len(self._still.desired):
                ends[DESIRED] = picture.wanted
            for parts, point in ends.items():
                if point is not None:
                    line, points = self._trails[parts].add(point)
                    lines[*parts, str(line)].append((picture, points))
        for parts, rows in lines.items():
            self._is_new(parts, rr.LineStrips3D.from_fields(colors=[COLORS[parts[:3]]]))
            strips = rr.LineStrips3D.columns(strips=[points for _, points in rows])
            self._send(parts, [picture for picture, _ in rows], strips)

    def _show_points(self, pictures: list[RobotPicture]) -> None:
        """The target, the line between the nearest points, and the base where odometry has it."""
        rr = self._rr
        wanted = [[] if one.wanted is None else [one.wanted] for one in pictures]
        self._some(TARGET, pictures, rr.Points3D, {"positions": wanted})
        nears = [[one.near] if one.near and one.near.points is not None else [] for one in pictures]
        lines: dict[str, list[list[Any]]] = {
            "strips": [[near.points for near in some] for some in nears],
            "labels": [[f"{one.between}: {one.distance:.3g} m" for one in some] for some in nears],
        }
        self._some(NEAREST, pictures, rr.LineStrips3D, lines)
        known = [(one, one.near.distance) for one in pictures if one.near]
        if known:
            at, distances = zip(*known, strict=True)
            if DISTANCE not in self._known:
                self._known.add(DISTANCE)
                self._log(DISTANCE, rr.SeriesLines(names=["distance, m"]))
            self._send(DISTANCE, at, rr.Scalars.columns(scalars=[*distances]))
        if self._still.wheeled:
            poses = [one.seen or one.stand for one in pictures]
            arrows = rr.Arrows3D.columns(
                vectors=np.vstack([LENGTH * axes(turn) for _, turn in poses]),
                origins=np.repeat([position for position, _ in poses], 3, axis=0),
            )
            self._send(BASE, pictures, arrows.partition([3] * len(poses)))

    def _some(
        self, parts: Parts, pictures: list[RobotPicture], kind: Any, fields: dict[str, list[list[Any]]]
    ) -> None:
        """What some pictures have and others have not; those that have not any more take it away."""
        counts = [len(row) for row in next(iter(fields.values()))]
        if not any(counts) and parts not in self._known:
            return
        self._is_new(parts, kind.from_fields(colors=[COLORS[parts]]))
        flat = {name: [value for row in rows for value in row] for name, rows in fields.items()}
        self._send(parts, pictures, kind.columns(**flat).partition(counts))

    def _show_bodies(self, pictures: list[RobotPicture]) -> None:
        """Obstacles and scenery: where they are at first, and whenever they are elsewhere."""
        rr = self._rr
        for i, body in enumerate(self._still.bodies):
            parts: Parts = (WORLD, "obstacles", body.name)
            poses = [(one, one.moved[i]) for one in pictures if i in one.moved]
            surfaces: list[tuple[RobotPicture, Triangles | None]] = []
            for one in pictures:
                if i in one.changed:
                    made, said = self._surfaces.of(i, one)
                    surfaces.append((one, made))
                    if said is not None:
                        self._say([said])
            if self._is_new(parts, rr.Mesh3D.from_fields(albedo_factor=THING)):
                if i not in pictures[0].moved:
                    poses = [(pictures[0], body.pose), *poses]
                if i not in pictures[0].changed:
                    surfaces = [(pictures[0], body.surface), *surfaces]
            for picture, surface in surfaces:
                fields = NOTHING if surface is None else surface
                for field, rows in (
                    ("vertex_positions", fields.vertices),
                    ("triangle_indices", fields.faces),
                ):
                    self._send(parts, [picture], rr.Mesh3D.columns(**{field: rows}).partition([len(rows)]))
            if poses:
                positions, turns = zip(*(pose for _, pose in poses), strict=True)
                columns = rr.InstancePoses3D.columns(
                    translations=np.array(positions), quaternions=np.array(turns)
                )
                self._send(parts, [picture for picture, _ in poses], columns)


def ends_whole(file: Path) -> bool:
    """Whether a recording's end is there."""
    with file.open("rb") as opened:
        opened.seek(-min(2 * len(END), file.stat().st_size), 2)
        return END in opened.read()
