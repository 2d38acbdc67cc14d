"""How the time of nmm's step grows with rows, inputs, frames and priority levels, on snake arms."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from step import microseconds
from tables import Section

import nmm

#: Limits of all joints, rad and rad/s: watched at each step, and far.
RANGE, FASTEST = 6.0, 100.0
#: The arm on which rows, frames and levels grow: 16 inputs with the base's.
JOINTS = 14
ROUNDS, SECONDS = 15, 0.02
COLUMNS = (
    ("pinocchio", False, "Pinocchio"),
    ("pinocchio", True, "with limits"),
    ("compiled", False, "compiled"),
    ("compiled", True, "with limits"),
)
Tasks = list[nmm.Task]
Calls = list[Callable[[], object]]


def snakes(folder: Path, *lengths: int) -> tuple[nmm.Robot, np.ndarray]:
    """Arms of so many joints, about z and y in turn, side by side on a unicycle, and a bent configuration.

    Joints a1, a2, ... and b1, b2, ...; links named after the joint that moves them; hands a and b.
    """
    parts = ['<link name="base_footprint"/>']
    for arm, count in zip("ab", lengths, strict=False):
        parent, at = "base_footprint", f"0.1 {0.2 if arm == 'a' else -0.2} 0.3"
        for k in range(1, count + 1):
            axis = "0 0 1" if k % 2 else "0 1 0"
            limit = f'<limit lower="{-RANGE}" upper="{RANGE}" velocity="{FASTEST}" effort="9"/>'
            parts.append(
                f'<link name="{arm}{k}_link"/><joint name="{arm}{k}" type="revolute">'
                f'<parent link="{parent}"/><child link="{arm}{k}_link"/>'
                f'<origin xyz="{at}"/><axis xyz="{axis}"/>{limit}</joint>'
            )
            parent, at = f"{arm}{k}_link", "0.2 0 0.05"
        parts.append(
            f'<link name="{arm}"/><joint name="{arm}_hand" type="fixed"><parent link="{parent}"/>'
            f'<child link="{arm}"/><origin xyz="{at}"/></joint>'
        )
    path = folder / "snakes.urdf"
    path.write_text(f'<robot name="snakes">{"".join(parts)}</robot>')
    robot = nmm.load(path, platform="unicycle")
    q = robot.q({name: 0.6 * np.cos(1.7 * k) + 0.4 for k, name in enumerate(robot.q_names[3:])})
    return robot, q


def task(robot: nmm.Robot, q: np.ndarray, function: nmm.extending.Function, priority: int = 1) -> nmm.Task:
    """A task whose target is near where the function is at q."""
    value = nmm.evaluate(function, 0.0, nmm.Configuration(robot, q)).value
    return nmm.Task(function, value + 0.01, priority=priority)


def calls(robot: nmm.Robot, q: np.ndarray, tasks: Tasks) -> Calls:
    """u = controller(t, q) for each of `COLUMNS`, and a compiled Euler step with limits."""
    resolver = nmm.ProjectedGradient()
    objective = nmm.PreferredPosture(dict.fromkeys(robot.q_names[3:], 0.0))
    found: Calls = []
    for kinematics, limits, _ in COLUMNS:
        kept = nmm.Limits({"platform": FASTEST}) if limits else None
        given = robot, tasks, resolver, objective
        controller = nmm.Controller(*given, limits=kept, dt=0.01, kinematics=kinematics)
        step = controller.evaluate(0.0, q)
        if step.residual > 1e-8 or step.scale.min() < 1.0:
            raise SystemExit(
                f"{robot.n_u} inputs, {len(step.r)} rows: expected the whole rate, got {step.scale}"
            )
        found.append(lambda c=controller: c(0.0, q))
    found.append(lambda c=controller: c.step(0.0, q, 0.01, "euler"))
    return found


def timed(table: list[tuple[str, Calls]]) -> list[list[str]]:
    """µs of all rows' calls, the least of rounds in which each has its turn."""
    found: list[list[list[float]]] = [[[] for _ in row] for _, row in table]
    for _ in range(ROUNDS):
        for (_, row), times in zip(table, found, strict=True):
            for call, own in zip(row, times, strict=True):
                own.append(microseconds(call, SECONDS))
    return [
        [said, *(f"{min(own):.1f}" for own in times)] for (said, _), times in zip(table, found, strict=True)
    ]


def functions() -> list[nmm.extending.Function]:
    """12 rows of two frames: position and orientation of the hand, and of a link in the middle."""
    middle = f"a{JOINTS // 2}_link"
    return [nmm.Position("a"), nmm.Orientation("a"), nmm.Position(middle), nmm.Orientation(middle)]


def rows(folder: Path) -> Iterator[tuple[str, Calls]]:
    """1 to 12 rows."""
    robot, q = snakes(folder, JOINTS)
    for axes in ("x", "xy"):
        yield str(len(axes)), calls(robot, q, [task(robot, q, nmm.Position("a", axes))])
    for count in range(1, 5):
        tasks = [task(robot, q, one) for one in functions()[:count]]
        yield str(3 * count), calls(robot, q, tasks)


def inputs(folder: Path) -> Iterator[tuple[str, Calls]]:
    """4 to 60 inputs: the position of one arm's hand, then of two arms' hands."""
    for lengths in ((2,), (6,), (14,), (28,), (58,), (3, 3), (7, 7), (14, 14), (29, 29)):
        robot, q = snakes(folder, *lengths)
        tasks = [task(robot, q, nmm.Position(hand)) for hand in "ab"[: len(lengths)]]
        said = "one arm" if len(lengths) == 1 else "two arms"
        yield f"{robot.n_u}, {said}", calls(robot, q, tasks)


def frames(folder: Path) -> Iterator[tuple[str, Calls]]:
    """12 rows of 4, 6 and 12 frames."""
    robot, q = snakes(folder, JOINTS)
    for count, axes in ((4, "xyz"), (6, "xy"), (12, "x")):
        links = np.linspace(3, JOINTS, count).round().astype(int)
        tasks = [task(robot, q, nmm.Position(f"a{k}_link", axes)) for k in links]
        yield str(count), calls(robot, q, tasks)


def levels(folder: Path) -> Iterator[tuple[str, Calls]]:
    """12 rows of 2 frames in 1 to 4 levels."""
    robot, q = snakes(folder, JOINTS)
    for count in (1, 2, 3, 4):
        tasks = [task(robot, q, one, 1 + k * count // 4) for k, one in enumerate(functions())]
        yield str(count), calls(robot, q, tasks)


def growth() -> list[Section]:
    """The tables."""
    heads = [*(head for _, _, head in COLUMNS), "its step"]
    with tempfile.TemporaryDirectory() as temporary:
        return [
            Section(part.__name__, [], [part.__name__, *heads], timed([*part(Path(temporary))]), [])
            for part in (rows, inputs, frames, levels)
        ]
