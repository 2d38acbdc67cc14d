"""One formula, two forms: what numba makes of it gives what Python gives, is made once, and kept on disk."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from function_grid import ENTRIES, TIMES, Entry, evaluated, modules, random_configuration
from gripping import folding
from numpy.typing import NDArray
from paper_cases import CASES, TIP
from platform_grid import EXAMPLES, random_qp

from nmm.base.kernels.compiled import Compiled, Kernel
from nmm.base.kernels.record_layout import Memory, views
from nmm.base.kernels.records import At, Frames, Rows
from nmm.control.controller import Controller
from nmm.control.functions.function import Stage
from nmm.control.functions.objectives import WeightedSum
from nmm.control.functions.program import Program, evaluate
from nmm.control.functions.tasks import LinearCoordinates, Task
from nmm.control.functions.tasks.task import Comparison
from nmm.control.resolvers import (
    CallableResolver,
    DampedLeastSquares,
    ExtendedJacobian,
    Problem,
    ProjectedGradient,
    ReducedGradient,
    Resolver,
)
from nmm.control.resolvers.answer import SINGULAR_J, SOLVED, AnswerArrays, unanswered
from nmm.control.resolvers.base import ANSWER, resolve_one
from nmm.control.resolvers.saturation import enforce_limits
from nmm.control.step.equations import step
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import CENTER_OF_MASS, Robot

Array = NDArray[np.float64]

#: Both forms do the same operations in the same order; libm's sine may differ from LLVM's in the last bit.
TOLERANCE = 1e-14


def assert_same(plain: Array, compiled: Array, tolerance: float = TOLERANCE, name: str = "") -> None:
    """Of the largest finite number, or of 1; what is no finite number is the same in both forms."""
    scale = np.abs(plain).max(initial=1.0, where=np.isfinite(plain))
    np.testing.assert_allclose(compiled, plain, rtol=0, atol=tolerance * scale, err_msg=name)


@contextmanager
def in_plain_python() -> Iterator[None]:
    """nmm's functions are Python's: else what a plain kernel calls would be compiled for Python alone."""
    with pytest.MonkeyPatch.context() as patch:
        for place, module in list(sys.modules.items()):
            if place.split(".")[0] == "nmm":
                for name, thing in list(vars(module).items()):
                    if isinstance(thing, Compiled):
                        patch.setattr(module, name, thing.py_func)
        yield


def both_forms(*calls: tuple[Kernel, Sequence[Any], Sequence[Any]]) -> None:
    """Call each kernel's plain form with the first arguments, its compiled one with the others."""
    with in_plain_python():
        for kernel, one, _ in calls:
            kernel.plain(*one)
    for kernel, _, other in calls:
        kernel(*other)


def kernels() -> dict[str, Kernel]:
    found = {}
    for module in modules():
        for name, thing in vars(module).items():
            if isinstance(thing, Kernel):
                found[name] = thing
    return found


def kinematics(frame: str, configuration: Configuration) -> tuple[Array, Array, Array]:
    """Placement (3, 4), Jacobian (6, n) and Hessian (6, n, n) of a frame; a mere point has no Hessian."""
    n = configuration.robot.n
    if frame == CENTER_OF_MASS:
        point, jacobian = configuration.center_of_mass()
        return np.c_[np.eye(3), point], np.vstack([jacobian, np.zeros((3, n))]), np.zeros((6, n, n))
    pose = configuration.placement(frame)
    placement = np.c_[pose.rotation, pose.translation]
    return placement, configuration.jacobian(frame), configuration.hessian(frame)


def stage_arguments(stage: Stage, t: float, configuration: Configuration) -> tuple[At, Frames, Array]:
    """What the stage's kernel reads at (t, q), computed here without nmm's program."""
    robot = configuration.robot
    found = [kinematics(frame, configuration) for frame in stage.frames]
    q = configuration.q.copy()
    qp = q[: robot.platform.n_p]
    G_q = np.stack([robot.platform.G_dot(qp, e) for e in np.eye(len(qp))], axis=-1)
    numbers = stage.numbers
    if stage.callback is not None:
        numbers = np.concatenate([part.ravel() for part in stage.callback(t, configuration)])
    k, n = len(stage.frames), robot.n
    frames = Frames(
        np.arange(k),
        np.array([placement for placement, _, _ in found]).reshape(k, 3, 4),
        np.array([jacobian for _, jacobian, _ in found]).reshape(k, 6, n),
        np.array([hessian for _, _, hessian in found]).reshape(k, 6, n, n),
    )
    return At(t, q, robot.platform.G(qp), np.ascontiguousarray(G_q)), frames, numbers


SINGLE = [entry for entry in ENTRIES if not isinstance(entry.function, WeightedSum)]


@pytest.mark.parametrize("entry", SINGLE, ids=[entry.name for entry in SINGLE])
def test_function_kernels(entry: Entry, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    """Each kernel by itself, in both forms, and all of a function's against the program's run."""
    robot = robots[entry.robots[0]]
    q = random_configuration(robot, rng)
    configuration = Configuration(robot, q)
    stages = entry.function.stages(robot)
    rows, count = max(stage.rows for stage in stages), len(entry.function.rows(robot))
    outcomes: dict[float, list[list[Array]]] = {}
    calls: list[tuple[Kernel, Sequence[Any], Sequence[Any]]] = []
    for t in TIMES[:4]:
        outcomes[t] = [[np.zeros(rows), np.zeros(rows), np.zeros((rows, robot.n))] for _ in range(2)]
        for stage in stages:
            at = stage_arguments(stage, t, configuration)
            one, other = (Rows(*(array[: stage.rows] for array in outcome)) for outcome in outcomes[t])
            calls.append((stage.kernel, (*at, one), (*at, other)))
    both_forms(*calls)
    for t, (plain_parts, compiled_parts) in outcomes.items():
        for plain, compiled in zip(plain_parts, compiled_parts, strict=True):
            assert_same(plain, compiled)
        for plain, found in zip(plain_parts, evaluate(entry.function, t, configuration), strict=True):
            assert_same(plain[:count], found)


COMPARED = {type(e.function): e for e in SINGLE if e.function.comparison is not None}.values()


@pytest.mark.parametrize("entry", COMPARED, ids=[entry.name for entry in COMPARED])
def test_comparison_kernels(entry: Entry, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    """On values, targets and derivatives of any kind: a comparison is algebra on its rows."""
    robot, kernel = robots[entry.robots[0]], entry.function.comparison
    assert kernel is not None
    s = len(entry.function.rows(robot))
    nothing = stage_arguments(Stage(kernel, s), 0.0, Configuration(robot, np.zeros(robot.n)))
    shapes = (3 * s, 3 * s, (3 * s, robot.n))
    starts = [[rng.normal(size=shape) for shape in shapes] for _ in range(20)]
    both = [[[part.copy() for part in start] for _ in range(2)] for start in starts]
    both_forms(*((kernel, *((*nothing, Rows(*outcome)) for outcome in outcomes)) for outcomes in both))
    for given, outcomes in zip(starts, both, strict=True):
        for plain, compiled, before in zip(*outcomes, given, strict=True):
            assert_same(plain, compiled)
            assert np.array_equal(plain[: 2 * s], before[: 2 * s])
            assert np.all(plain[2 * s :] != before[2 * s :])


@pytest.mark.parametrize("name", EXAMPLES)
def test_platform_kernels(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    n_p, p, calls = platform.n_p, platform.p, []
    for _ in range(20):
        qp = random_qp(platform, rng, 5.0)
        both = [(np.zeros((n_p, p)), np.zeros((n_p, p, n_p))) for _ in range(2)]
        calls.append((platform.velocity_map, *((qp, platform.parameters, *maps) for maps in both)))
    both_forms(*calls)
    for _, plain, compiled in calls:
        assert_same(*(np.append(*maps[2:]) for maps in (plain, compiled)))


RESOLVERS = [
    ReducedGradient(3.0),
    ReducedGradient(3.0, [("u0", "u1"), ("u2", "u3")]),
    ProjectedGradient(3.0),
    ProjectedGradient(3.0, [1, 2, 3, 4]),
    ReducedGradient(3.0, singular="damped"),
    ReducedGradient(3.0, [("u0", "u1")], weights=[1, 2, 3, 4], singular="damped"),
    ExtendedJacobian(),
    ExtendedJacobian(singular="damped"),
    *(DampedLeastSquares(3.0, law, 0.3, 0.6) for law in ("constant", "variable", "directions")),
    DampedLeastSquares(3.0, weights=[1, 2, 3, 4]),
    CallableResolver(lambda problem: problem.h),
]


@pytest.mark.parametrize("resolver", RESOLVERS, ids=lambda r: r.name)
def test_resolver_kernels(resolver: Resolver, rng: np.random.Generator) -> None:
    for J in (rng.normal(size=(2, 4)), np.ones((2, 4)), np.array([[1.0, 0, 0, 0], [0, 1e-20, 1, 1]])):
        added = 2 if resolver.takes_added_task else 0
        more = {"added_J": rng.normal(size=(added, 4)), "added_rate": rng.normal(size=added)}
        problem = Problem(J, rng.normal(size=2), rng.normal(size=4), row_scales=[0.5, 2.0], **more)
        setup, plain = resolver.setup(problem.dimensions), unanswered(4, 1)
        memory = Memory()  # as a controller's: for arrays by themselves it would be compiled again
        memory.add(problem.arrays)
        memory.add(unanswered(4, 1))
        blocks = memory.blocks()
        one, other = (resolver.start(problem.dimensions).memory for _ in range(2))
        with in_plain_python():
            resolver.kernel.plain(problem.arrays, setup.numbers, setup.options, one, plain)
        resolve_one(resolver.kernel.address, *blocks, setup.numbers, setup.options, other)
        answers = (plain, one), (views(AnswerArrays, *blocks, ANSWER), other)
        assert_same(*(np.concatenate([*map(np.atleast_1d, answer), state]) for answer, state in answers))


def test_limit_kernel(rng: np.random.Generator) -> None:
    """Inputs beyond limits, within them, and none at all; rows that leave no room, and a metric."""
    moved = 0
    for level in (0, 1, 2):
        for _ in range(20):
            problem = Problem(
                *(rng.normal(size=(2, 4)), rng.normal(size=2), rng.normal(size=4)),
                u_lower=-rng.random(4),
                u_upper=rng.random(4),
                limit_rows=rng.normal(size=(2, 4)),
                lower=rng.normal(size=2) - 1.0,
                upper=[2.0, np.inf],
                limit_levels=[level, 0],
            )
            u, status = rng.normal(size=4), rng.choice([SOLVED, SINGULAR_J])
            T = np.diag(1.0 + rng.random(4)) if level else np.zeros((0, 0))
            answers = unanswered(4, 1), unanswered(4, 1)
            for answer in answers:
                answer.u[:], answer.status[()] = u, status
            both_forms((enforce_limits, *((problem.arrays, T, answer) for answer in answers)))
            both = [np.concatenate([*map(np.atleast_1d, answer)]) for answer in answers]
            assert_same(*both)
            moved += not np.array_equal(both[0][:4], u)
    assert moved > 40


def test_no_kernel_is_left_out(robots: dict[str, Robot]) -> None:
    run = {resolver.kernel for resolver in RESOLVERS}
    run |= {EXAMPLES[name].velocity_map for name in EXAMPLES}
    for entry in SINGLE:
        run |= {stage.kernel for stage in entry.function.stages(robots[entry.robots[0]])}
    run |= {entry.function.comparison for entry in COMPARED}
    run |= {enforce_limits, step}  # `step` in whole programs, below
    assert not {name for name, kernel in kernels().items() if kernel not in run}


# Whole programs, in other processes.


@cache
def answers() -> dict[str, Array]:
    """Everything the two forms are compared by: functions, errors, platforms, and the inputs of the cases."""
    found = {}
    rng = np.random.default_rng(7)
    robots = {robot.name: robot for robot in (load("unicycle_2r"), load("unicycle_3r"), folding())}
    for entry in ENTRIES:
        robot = robots[entry.robots[-1]]
        configuration = Configuration(robot, random_configuration(robot, rng))
        parts = evaluated(entry.function, 0.37, configuration)
        found[entry.name] = np.concatenate([part.ravel() for part in parts])
    for name, platform in EXAMPLES.items():
        found[f"platform {name}"] = platform.G(random_qp(platform, rng, 3.0)).ravel()
    for entry in COMPARED:
        robot = robots[entry.robots[-1]]
        task = Task(entry.function, rng.normal(size=len(entry.function.rows(robot))))
        program = Program(robot, [task.function, task.reference, Comparison(task)])
        program.lay_out()
        parts = program.evaluate(0.0, random_configuration(robot, rng))[2]
        found[f"error of {entry.name}"] = np.concatenate([part.ravel() for part in parts])
    for case in CASES:
        robot = robots[case.robot]
        s = 2 if case.name == "case 1" else 3
        added = Task(LinearCoordinates(*("q1", "q2")[: robot.n_u - s]), np.zeros(robot.n_u - s))
        controllers = {
            "rg": case.controller(robot, case.rg()),
            "automatic": case.controller(robot, ReducedGradient()),
            "pg": case.controller(robot, ProjectedGradient()),
            "weighted": case.controller(robot, ProjectedGradient(weights={"v": 3.0})),
            "ej": Controller(robot, case.tasks, ExtendedJacobian(), added_task=added),
        }
        for kind, controller in controllers.items():
            for t in (0.0, 1.0, 12.0):
                q = case.q0 + rng.normal(scale=0.3, size=robot.n)
                step = controller.evaluate(t, q)
                numbers = (step.u, step.q_dot, step.J.ravel(), step.h, [step.measure, step.status])
                found[f"{case.name} {kind} {t}"] = np.concatenate(numbers)
    return found


def dispatchers() -> dict[str, Compiled]:
    """All functions of nmm that numba compiles, by module and name."""
    found = {}
    for place, module in list(sys.modules.items()):
        if place.split(".")[0] != "nmm":
            continue
        for name, thing in vars(module).items():
            function = thing.compiled if isinstance(thing, Kernel) else thing
            if isinstance(function, Compiled) and function.py_func.__module__ == place:
                found[f"{place}.{name}"] = function
    return found


def main(folder: str) -> None:
    """In the other process: save the answers, and how often numba's cache was hit and missed."""
    np.savez(Path(folder) / "answers.npz", **answers())
    counts = {
        name: [sum(made.read is read for made in function.entries.values()) for read in (True, False)]
        for name, function in dispatchers().items()
    }
    (Path(folder) / "cache.json").write_text(json.dumps(counts))


def in_another_process(folder: Path, **environment: str) -> None:
    code = f"import test_compiled_forms as forms; forms.main({str(folder)!r})"
    subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment,
        check=True,
    )


def test_the_whole_step_in_plain_python(tmp_path: Path) -> None:
    in_another_process(tmp_path, NUMBA_DISABLE_JIT="1")
    assert json.loads((tmp_path / "cache.json").read_text()) == {}, "something was compiled after all"
    plain = np.load(tmp_path / "answers.npz")
    compiled = answers()
    assert set(plain) == set(compiled)
    for name, found in compiled.items():
        # The inputs pass the rounding on, multiplied by the condition of what was inverted (below 1e3 here).
        assert_same(plain[name], found, 1e-12 if name.startswith("case") else TOLERANCE, name)


def test_another_process_compiles_nothing(tmp_path: Path) -> None:
    answers()  # so that the cache on disk holds all of them,
    dispatchers()  # and what only those need that look at everything
    in_another_process(tmp_path)
    counts = json.loads((tmp_path / "cache.json").read_text())
    assert {name for name, (_, misses) in counts.items() if misses} == set()
    assert sum(hits > 0 for hits, _ in counts.values()) > len(kernels())
    assert counts["nmm.control.step.equations.step"] == [1, 0]


def test_a_new_controller_compiles_nothing(robot_2r: Robot, robot_3r: Robot) -> None:
    """Whatever is combined: the kernels are called through their addresses."""
    answers()
    before = {name: len(function.entries) for name, function in dispatchers().items()}
    mixed = [TIP, Task(LinearCoordinates("q1"), [0.0])]
    Controller(robot_2r, mixed, ProjectedGradient(), CASES[2].objective)(0.0, np.ones(5))
    Controller(robot_3r, [TIP], ReducedGradient(), CASES[3].objective)(0.0, np.ones(6))
    assert {name: len(function.entries) for name, function in dispatchers().items()} == before
