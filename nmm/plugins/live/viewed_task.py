"""What a robot can do for a task at its present place: numbers, ellipsoids and lost directions for a page."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from nmm.analysis.singular.ellipsoids import ARM, drawn_scale, ellipsoids_along
from nmm.analysis.singular.jacobians import Jacobians
from nmm.analysis.singular.parts import WHOLE, columns_of, part
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.base.arrays import Array
from nmm.base.ellipsoid_options import EllipsoidOptions
from nmm.base.errors import InputError, SingularError, expect
from nmm.base.resolver_style import looks
from nmm.control.directions import WORLD_PARTS, direction_words, in_world_axes, readable_basis
from nmm.control.functions.function import Function
from nmm.control.functions.tasks.task import Task
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.plugins.live.server import Visitor
from nmm.plugins.live.session import message
from nmm.views.playback.drawing import Command, Drawing, encode
from nmm.views.playback.ellipsoids import ARM_COLOR, OPACITY, THINNEST, draw_legend
from nmm.views.playback.extent import extent_of

#: A direction is nearly lost where σ_min is below this share of σ_max, rows in natural sizes.
NEAR = 0.05
FAR = 1e6
#: Shares of a direction below this have no arrow of their own.
SEEN = 0.05


class Frame(NamedTuple):
    """A frame of the task, and the rows of its translation and rotation by world axis."""

    name: str
    moves: dict[int, int]
    turns: dict[int, int]


class ViewedTask:
    """A task of a robot that sliders move from q (n,), by J = (∂f/∂q) S, for a page; `InputError` for a task
    of more rows than the robot has inputs."""

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
        color = looks([""])[0].rgb
        moved = {f"/nmm/task {i}": frame.name for i, frame in enumerate(self._frames) if frame.moves}
        for group in moved:
            for after, name in enumerate(reversed(self._parts)):
                shade, path = list(ARM_COLOR if name == ARM else color), f"{group}/{name}"
                drawing.add("ellipsoid", path=path, color=shade, opacity=OPACITY[name], after=after)
        if moved:
            nodes = {name: [f"{group}/{name}" for group in moved] for name in self._parts}
            draw_legend(drawing, [*moved], ", ".join(moved.values()), nodes, color, self._scale)
        rows = [f"{row.name} [{row.unit}]" for row in self._jacobians.rows]
        drawing.add("viewed_task", rows=rows, parts=list(self._parts), length=0.22 * self._extent)

    def asked(self, text: str | bytes) -> tuple[int, Array]:
        """The number of a page's question and its coordinates (n,); else `InputError`."""
        data = message(text, {"at": ("number", "q")})
        number, q = data["number"], data["q"]
        expect(type(number) is int and 0 <= number < 2**53, "message at: number", "a count")
        expect(isinstance(q, list) and len(q) == self._robot.n, "message at: q", f"{self._robot.n} numbers")
        known = all(type(x) in (int, float) and abs(x) <= FAR for x in q)
        expect(known, "message at: q", f"numbers from {-FAR:g} to {FAR:g}")
        return number, self._robot.following.placed(np.array(q, dtype=np.float64))

    def answer(self, q: Array, number: int = 0) -> Command:
        """The answer to question `number`: what the robot can do for the task at q (n,)."""
        robot, jacobians = self._robot, self._jacobians
        answer: Command = {"type": "task", "number": number, "problem": "", "state": "fine", "words": []}
        try:
            J = jacobians.J(0.0, q)
        except SingularError as error:
            return answer | {"problem": str(error.placed("")), "parts": [], "ellipsoids": [], "arrows": []}
        world = in_world_axes(J, jacobians.task, robot, q)
        lost, near = _directions(world / jacobians.scales[:, np.newaxis])
        directions = lost if len(lost) else near
        configuration = Configuration(robot, q)
        places = [np.array(configuration.placement(frame.name).translation) for frame in self._frames]
        return answer | {
            "state": "lost" if len(lost) else "near" if len(directions) else "fine",
            "words": [direction_words(y, jacobians.rows) for y in directions],
            "parts": [self._numbers(name, J) for name in self._parts],
            "ellipsoids": list(self._ellipsoids(world, places)),
            "arrows": [arrow for y in directions for arrow in self._arrows(y, places)],
        }

    def _numbers(self, name: str, J: Array) -> dict[str, Any]:
        natural, rows = self._jacobians.natural(np.ones(len(J))), self._jacobians.row_names
        result = part(name, J, self._parts[name], self._robot, rows, TOLERANCE, natural)
        # Singular values that count as zero are shown as zero.
        values = np.where(np.arange(len(J)) < result.rank, result.singular_values, 0.0)
        return {
            "name": name,
            "rank": result.rank,
            "sigma_min": float(values[-1]),
            "sigma_max": float(values[0]),
            "condition": result.condition if math.isfinite(result.condition) else None,
            "manipulability": float(np.prod(values)),
        }

    def _ellipsoids(self, world: Array, places: Sequence[Array]) -> Iterator[list[Any]]:
        """Nodes and placements of each part's ellipsoid at each frame, by J's rows of its translation."""
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
                # A flat one is drawn, too.
                least = THINNEST * (largest or self._extent / self._scale)
                node = np.eye(4)
                node[:3, :3] = U * np.sign(np.linalg.det(U)) * self._scale * np.maximum(radii, least)
                node[:3, 3] = place
                yield [f"/nmm/task {i}/{name}", node.T.ravel().tolist()]

    def _arrows(self, y: Array, places: Sequence[Array]) -> Iterator[dict[str, Any]]:
        """Where and along which unit vector, in world axes, a direction (s,) moves and turns frames."""
        for frame, place in zip(self._frames, places, strict=True):
            for kind, rows in (("moves", frame.moves), ("turns", frame.turns)):
                way = np.zeros(3)
                way[list(rows)] = y[list(rows.values())]
                size = float(np.linalg.norm(way))
                if size > SEEN:
                    yield {"kind": kind, "at": place.tolist(), "along": (way / size).tolist()}

    def visitor(self) -> Visitor:
        """A page that asks; of questions that outpace the answers, only the last is answered."""
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
            return encode(self.answer(q, number))

        return Visitor(latest, heard)


def _frames(robot: Robot, jacobians: Jacobians) -> list[Frame]:
    frames: dict[str, Frame] = {}
    for i, row in enumerate(jacobians.rows):
        name, _, last = row.name.rpartition(".")
        if name in robot.frames and last in WORLD_PARTS:
            frame = frames.setdefault(name, Frame(name, {}, {}))
            axis = WORLD_PARTS[last]
            (frame.moves if axis < 3 else frame.turns)[axis % 3] = i
    return list(frames.values())


def _directions(J: Array) -> tuple[Array, Array]:
    """Directions (k, s) that no input moves, and those that hardly any does; J (s, m) in natural sizes."""
    U, values, _ = np.linalg.svd(J)
    values = np.concatenate([values, np.zeros(len(J) - len(values))])
    largest = max(1.0, float(values[0]))
    rank = int(np.sum(values > TOLERANCE * largest))
    near = values <= NEAR * values[0]
    return readable_basis(U[:, rank:].T), readable_basis(U[:, near].T)
