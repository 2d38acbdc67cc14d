"""What a robot can do for a task where it stands: numbers, ellipsoids and lost directions for a page."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from nmm.analysis.singular.drawn_ellipsoids import ARM, NAMES, drawn_scale, scale_text
from nmm.analysis.singular.ellipsoids import ellipsoids_along
from nmm.analysis.singular.jacobians import Jacobians
from nmm.analysis.singular.parts import WHOLE, columns_of, part
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.arrays import Array
from nmm.control.directions import readable_basis
from nmm.control.lost_directions import PARTS, direction_words, in_world_axes
from nmm.errors import InputError, SingularError
from nmm.functions.function import Function
from nmm.functions.tasks.task import Task
from nmm.looks import looks
from nmm.playback.drawing import Command, Drawing
from nmm.playback.ellipsoids import ARM_COLOR, OPACITY, THINNEST
from nmm.playback.encoding import encode
from nmm.playback.extent import extent_of
from nmm.playback.server import Visitor
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot
from nmm.runs.ellipsoid_options import EllipsoidOptions

#: A direction is nearly lost where the least singular value is below this share of the largest, rows in their
#: natural sizes.
NEAR = 0.05
#: No slider is farther away than this, m or rad.
FAR = 1e6
#: A part of a direction below this share of it has no arrow of its own.
SEEN = 0.05


class Frame(NamedTuple):
    """A frame that the task is about, and which rows are its motion and its turn along the world's axes."""

    name: str
    moves: dict[int, int]
    turns: dict[int, int]


class ViewedTask:
    """A task of a robot that sliders move: what a page is told of it.

    Of J = (∂f/∂q) S, columns the inputs: what the wheels cannot do is in it.

    Parameters
    ----------
    robot : the robot
    tasks : tasks, or functions alone
    q : (n,) where it stands at first, m and rad

    Raises
    ------
    InputError : a task of more rows than the robot has inputs
    """

    def __init__(self, robot: Robot, tasks: Sequence[Task | Function], q: Array) -> None:
        self._robot = robot
        self._jacobians = Jacobians((robot, tuple(tasks)))
        self._frames = _frames(robot, self._jacobians)
        both = robot.platform.p > 0 and robot.n_u > robot.platform.p
        self._parts = {name: columns_of(robot, name) for name in ((WHOLE, ARM) if both else (WHOLE,))}
        self._extent = extent_of(robot, q)
        moved = [frame.name for frame in self._frames if frame.moves]
        first = [{WHOLE: ellipsoids_along(robot, name, q)} for name in moved]
        self._scale = drawn_scale(EllipsoidOptions(), self._extent, first)

    def draw(self, drawing: Drawing) -> None:
        """Append the commands that draw its ellipsoids, and say what it is."""
        color = looks([""])[0].rgb
        paths: dict[str, list[str]] = {name: [] for name in self._parts}
        for i, frame in enumerate(self._frames):
            for after, name in enumerate(reversed(self._parts) if frame.moves else ()):
                shade = ARM_COLOR if name == ARM else color
                path = f"/nmm/task {i}/{name}"
                paths[name].append(path)
                drawing.add("ellipsoid", path=path, color=list(shade), opacity=OPACITY[name], after=after)
        moved = ", ".join(frame.name for frame in self._frames if frame.moves)
        if moved:
            entries = [
                {
                    "text": f"velocities of {moved}: {NAMES[name]}",
                    "color": list(ARM_COLOR if name == ARM else color),
                    "paths": nodes,
                }
                for name, nodes in paths.items()
            ]
            groups = [f"/nmm/task {i}" for i, frame in enumerate(self._frames) if frame.moves]
            drawing.add("ellipsoids", groups=groups, entries=entries, note=scale_text(self._scale))
        rows = [f"{row.name} [{row.unit}]" for row in self._jacobians.rows]
        drawing.add("viewed_task", rows=rows, parts=list(self._parts), length=0.22 * self._extent)

    def asked(self, text: str | bytes) -> tuple[int, Array]:
        """The number of a page's question, and the coordinates (n,) that it asks about.

        Raises
        ------
        InputError : anything that no page of ours sends
        """
        try:
            data = json.loads(text)
        except (ValueError, RecursionError):
            raise InputError("message: expected JSON") from None
        if not isinstance(data, dict) or data.keys() != {"type", "number", "q"} or data["type"] != "at":
            raise InputError("message: expected type at, a number and q")
        number, q = data["number"], data["q"]
        if type(number) is not int or not 0 <= number < 2**53:
            raise InputError("message: number: expected a count")
        if not isinstance(q, list) or len(q) != self._robot.n:
            raise InputError(f"message: q: expected {self._robot.n} numbers")
        if not all(type(x) in (int, float) and abs(x) <= FAR for x in q):
            raise InputError(f"message: q: expected numbers from {-FAR:g} to {FAR:g}")
        return number, self._robot.following.placed(np.array(q, dtype=np.float64))

    def told(self, q: Array, number: int = 0) -> Command:
        """The answer to question `number`: what the robot can do for the task at q (n,)."""
        robot, jacobians = self._robot, self._jacobians
        answer: Command = {"type": "task", "number": number, "problem": "", "state": "fine", "words": []}
        try:
            J = jacobians.J(0.0, q)
        except SingularError as error:
            reason = str(error).partition(": ")[2] or str(error)
            return answer | {"problem": reason, "parts": [], "ellipsoids": [], "arrows": []}
        world = in_world_axes(J, jacobians.task, robot, q)
        lost, near = _directions(world / jacobians.scales[:, np.newaxis])
        said = lost if len(lost) else near
        here = Configuration(robot, q)
        places = [np.array(here.placement(frame.name).translation) for frame in self._frames]
        return answer | {
            "state": "lost" if len(lost) else "near" if len(said) else "fine",
            "words": [direction_words(y, jacobians.rows) for y in said],
            "parts": [self._numbers(name, J) for name in self._parts],
            "ellipsoids": list(self._ellipsoids(world, places)),
            "arrows": [arrow for y in said for arrow in self._arrows(y, places)],
        }

    def _numbers(self, name: str, J: Array) -> dict[str, Any]:
        """What a page's table says of a part."""
        natural, rows = self._jacobians.natural(np.ones(len(J))), self._jacobians.row_names
        found = part(name, J, self._parts[name], self._robot, rows, TOLERANCE, natural)
        # What counts as zero is told as zero.
        values = np.where(np.arange(len(J)) < found.rank, found.singular_values, 0.0)
        return {
            "name": name,
            "rank": found.rank,
            "sigma_min": float(values[-1]),
            "sigma_max": float(values[0]),
            "condition": found.condition if math.isfinite(found.condition) else None,
            "manipulability": float(np.prod(values)),
        }

    def _ellipsoids(self, world: Array, places: Sequence[Array]) -> Iterator[list[Any]]:
        """Nodes and where they are, of each part's at each frame: J's rows of the frame's motion alone."""
        for i, (frame, place) in enumerate(zip(self._frames, places, strict=True)):
            if not frame.moves:
                continue
            velocity = np.zeros((3, world.shape[1]))
            velocity[list(frame.moves)] = world[list(frame.moves.values())]
            largest = float(np.linalg.svd(velocity, compute_uv=False)[0])
            for name, columns in self._parts.items():
                U, values, _ = np.linalg.svd(velocity[:, columns])
                radii = np.zeros(3)
                radii[: len(values)] = values
                # A flat one is seen, too.
                least = THINNEST * (largest or self._extent / self._scale)
                node = np.eye(4)
                node[:3, :3] = U * np.sign(np.linalg.det(U)) * self._scale * np.maximum(radii, least)
                node[:3, 3] = place
                yield [f"/nmm/task {i}/{name}", node.T.ravel().tolist()]

    def _arrows(self, y: Array, places: Sequence[Array]) -> Iterator[dict[str, Any]]:
        """Where and along what a direction (s,) moves and turns frames: unit vectors in world axes."""
        for frame, place in zip(self._frames, places, strict=True):
            for kind, rows in (("moves", frame.moves), ("turns", frame.turns)):
                way = np.zeros(3)
                way[list(rows)] = y[list(rows.values())]
                size = float(np.linalg.norm(way))
                if size > SEEN:
                    yield {"kind": kind, "at": place.tolist(), "along": (way / size).tolist()}

    def visitor(self) -> Visitor:
        """A page that asks; of questions that come faster than answers the last one counts."""
        waiting: list[tuple[int, Array]] = []

        def heard(text: str | bytes) -> bool:
            try:
                waiting[:] = [self.asked(text)]
            except InputError:
                return False
            return True

        def latest() -> str:
            if not waiting:
                return ""
            number, q = waiting.pop()
            return encode(self.told(q, number))

        return Visitor(latest, heard)


def _frames(robot: Robot, jacobians: Jacobians) -> list[Frame]:
    """The frames whose motion or turn in the world rows are, by the rows' names."""
    found: dict[str, Frame] = {}
    for i, row in enumerate(jacobians.rows):
        name, _, last = row.name.rpartition(".")
        if name in robot.frames and last in PARTS:
            frame = found.setdefault(name, Frame(name, {}, {}))
            axis = PARTS[last]
            (frame.moves if axis < 3 else frame.turns)[axis % 3] = i
    return list(found.values())


def _directions(J: Array) -> tuple[Array, Array]:
    """Directions of the task that no input moves, (k, s), and where there is none those that hardly any does;
    of J (s, m) in natural sizes."""
    U, values, _ = np.linalg.svd(J)
    values = np.concatenate([values, np.zeros(len(J) - len(values))])
    largest = max(1.0, float(values[0]))
    rank = int(np.sum(values > TOLERANCE * largest))
    near = values <= NEAR * values[0]
    return readable_basis(U[:, rank:].T), readable_basis(U[:, near].T)
