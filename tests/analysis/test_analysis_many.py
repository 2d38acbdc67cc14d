"""J and singular values of many configurations at once: against numpy and Pinocchio, in any threads."""

from __future__ import annotations

import threading
import time

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from nmm.analysis.maps.reach import ArmReach
from nmm.analysis.maps.search import Grid, Layer
from nmm.analysis.maps.workspace import workspace_map
from nmm.analysis.singular.jacobians import Jacobians
from nmm.base import cores
from nmm.base.kernels.spectra import FEW_ROWS, SIDE_BY_SIDE, spectra, write_spectrum
from nmm.control.functions.tasks import CallableFunction, Pose, Position
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]


def with_cores(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    monkeypatch.setattr(cores, "cores", lambda: count)


@pytest.mark.parametrize("shape", [(1, 4), (2, 4), (3, 8), (6, 10), (FEW_ROWS + 3, 14), (4, 2), (5, 5)])
def test_singular_values_are_numpys(shape: tuple[int, int], rng: np.random.Generator) -> None:
    J = rng.normal(size=(300, *shape))
    J[::3, -1] = J[::3, 0]  # lost ranks
    J[1::3] *= np.logspace(0.0, -9.0, shape[1])
    J[0] = 0.0
    found, expected = spectra(J), np.linalg.svd(J, compute_uv=False)
    assert np.all(np.diff(found, axis=1) <= 0.0)
    assert np.all(np.abs(found - expected) <= 1e-14 * expected[:, :1])


@pytest.mark.parametrize("shape", [(2, 4), (6, 10), (4, 2), (FEW_ROWS + 3, 14)])
def test_singular_values_do_not_depend_on_the_matrices_beside(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    J = rng.normal(size=(3 * SIDE_BY_SIDE + 5, *shape))
    J[::3, -1] = J[::3, 0]
    J[1::4] *= np.logspace(0.0, -9.0, shape[1])
    J[4], J[7, 0, 0], J[9] = 0.0, np.nan, np.eye(*shape)
    found = spectra(J)
    for one, values in zip(J, found, strict=True):
        alone = np.empty(min(shape))
        write_spectrum(one, alone) if np.isfinite(one).all() else alone.fill(np.nan)
        np.testing.assert_array_equal(values, spectra(one[np.newaxis])[0])
        np.testing.assert_array_equal(values, alone)


def test_small_singular_values_are_as_accurate_as_large_ones() -> None:
    """Rows of very different sizes: A = D Q with Q's rows orthonormal has D's entries, however small."""
    Q = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0][:4]
    sizes = np.array([1.0, 1e-6, 1e-12, 1e-18])
    np.testing.assert_allclose(spectra((sizes[:, np.newaxis] * Q)[np.newaxis])[0], sizes, rtol=1e-12)


def test_what_is_not_finite_has_no_singular_values() -> None:
    J = np.ones((3, 2, 3))
    J[0, 0, 0], J[2, 1, 2] = np.nan, np.inf
    found = spectra(J)
    assert np.isnan(found[[0, 2]]).all()
    np.testing.assert_allclose(found[1], [np.sqrt(6.0), 0.0], atol=1e-15)
    assert spectra(np.zeros((0, 2, 3))).shape == (0, 2)


def test_J_of_many_is_pinocchios(ur5: Robot, rng: np.random.Generator) -> None:
    q = rng.uniform(-3.0, 3.0, (40, ur5.n))
    data, frame = ur5.model.createData(), ur5.frame_id("tool0")
    expected = [pin.computeFrameJacobian(ur5.model, data, one, frame, pin.LOCAL) @ ur5.S(one) for one in q]
    np.testing.assert_allclose(Jacobians((ur5, Pose("tool0"))).batch(q), expected, rtol=0.0, atol=1e-13)


def test_a_python_function_is_evaluated_one_by_one(robot_2r: Robot, rng: np.random.Generator) -> None:
    """The same function in Python and compiled: the first one's derivatives are differences."""

    def point(configuration: Configuration) -> Array:
        return np.asarray(configuration.placement("ee").translation[:2])

    q, seen = rng.uniform(-1.0, 1.0, (30, robot_2r.n)), list[float]()
    ours = Jacobians((robot_2r, CallableFunction(point, ["x", "y"], units=["m", "m"])))
    found = ours.batch(q, progress=seen.append)
    np.testing.assert_allclose(found, Jacobians((robot_2r, Position("ee", "xy"))).batch(q), atol=1e-9)
    np.testing.assert_array_equal(found, [ours.J(0.0, one) for one in q])
    assert seen == sorted(seen)
    assert len(seen) == 30


def test_the_number_of_threads_changes_no_bit(
    robot_3r: Robot, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    jacobians = Jacobians((robot_3r, Position("ee", "xy")))
    q = rng.uniform(-3.0, 3.0, (3500, robot_3r.n))
    moving = np.flatnonzero([name in ("q1", "q2", "q3") for name in robot_3r.q_names])
    reach = ArmReach(robot_3r, "ee", "xy", None, robot_3r.rest, moving, None)
    postures = reach.postures(4096)
    targets = reach.positions(postures)[:, :2] + 0.1

    def found() -> list[Array]:
        J = jacobians.batch(q)
        return [J, spectra(J), *reach.onto(postures, targets, 1e-9), reach.towards(postures, targets)]

    with_cores(monkeypatch, 1)
    alone = found()
    for count in (2, 5):
        with_cores(monkeypatch, count)
        for one, other in zip(alone, found(), strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.thorough
def test_a_map_of_the_workspace_is_the_same_with_any_number_of_threads(
    robot_3r: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    for count in (1, 3):
        with_cores(monkeypatch, count)
        made.append(workspace_map((robot_3r, Position("ee", "xy")), samples=50, configurations=4096))
    first, second = made
    np.testing.assert_array_equal(first.values["sigma_min"], second.values["sigma_min"])
    np.testing.assert_array_equal(first.best_q["sigma_min"], second.best_q["sigma_min"])
    np.testing.assert_array_equal(first.singular.points, second.singular.points)


@pytest.mark.parametrize("slab", [None, (0.3, 0.9)])
def test_newtons_steps_put_the_frame_where_pinocchio_has_it(
    slab: tuple[float, float] | None, ur5: Robot, rng: np.random.Generator
) -> None:
    moving = ur5.arm_coordinates[:3]
    reach = ArmReach(ur5, "tool0", "xy", slab, ur5.rest, moving, None)
    start = reach.postures(256)
    joints = start[:, moving] + rng.uniform(-0.1, 0.1, (256, 3))
    goals = reach.positions(reach.placed(np.clip(joints, reach.lower, reach.upper)))
    targets = np.ascontiguousarray(goals[:, :2])  # each is in reach, and near
    q, places, left = reach.onto(start, targets, 1e-10)
    there = left <= 1e-10
    assert there[reach.held(goals)].mean() > 0.95
    for one, place, target, far in zip(q, places, targets, left, strict=True):
        if np.isinf(far):
            continue
        own = Configuration(ur5, one).placement("tool0").translation
        np.testing.assert_allclose(own, place, rtol=0.0, atol=1e-13)
        assert np.linalg.norm(own[:2] - target) == pytest.approx(far, abs=1e-12)
    np.testing.assert_array_equal(q[np.isinf(left)], start[np.isinf(left)])
    assert np.all((q[:, moving] >= reach.lower) & (q[:, moving] <= reach.upper))
    if slab is not None:
        assert np.all((places[there, 2] >= slab[0]) & (places[there, 2] <= slab[1]))


def test_the_best_offered_are_those_of_a_plain_loop(rng: np.random.Generator) -> None:
    """Few values, so that many are as good: of these the last counts, and one that is there already stays."""
    cells, central = rng.integers(-1, 40, 400), rng.random(400) < 0.4
    signed = rng.integers(0, 4, 400).astype(np.float64)
    signed[rng.random(400) < 0.1] = np.nan
    values, centrals = rng.integers(0, 4, 40).astype(np.float64), rng.random(40) < 0.4
    values[:5], centrals[:5] = -np.inf, False
    best: dict[int, int] = {}
    for i, cell in enumerate(cells):
        if cell >= 0 and np.isfinite(signed[i]):
            other = best.get(int(cell), i)
            if (central[i], signed[i]) >= (central[other], signed[other]):
                best[int(cell)] = i
    expected = {i for c, i in best.items() if (central[i], signed[i]) > (centrals[c], values[c])}
    layer = Layer(Grid(np.zeros(2), 1.0, 8, 5), 1, 1.0)
    layer.values[:], layer.central[:] = values, centrals
    layer.offer(cells, central, signed, np.arange(400.0)[:, np.newaxis])
    # A value that is not in the middle never takes the place of one that is, nor does an equal one.
    assert set(layer.q[np.isfinite(layer.q)].astype(int)) == expected


def test_the_best_cell_of_a_block_is_that_of_a_plain_loop(rng: np.random.Generator) -> None:
    columns, rows, block = 10, 7, 4
    values = rng.integers(0, 3, columns * rows).astype(np.float64)
    values[rng.random(columns * rows) < 0.5] = -np.inf
    values[: 4 * columns].reshape(4, columns)[:, :4] = -np.inf  # a whole block
    grid = values.reshape(rows, columns)
    layer = Layer(Grid(np.zeros(2), 1.0, columns, rows), 1, 1.0)
    layer.values[:] = values
    chosen = dict(zip(*layer.best_of_blocks(block), strict=True))
    for k in range(6):
        row, column = k // 3 * block, k % 3 * block
        own = [
            (grid[r, c], r * columns + c)
            for r in range(row, min(row + block, rows))
            for c in range(column, min(column + block, columns))
            if np.isfinite(grid[r, c])
        ]
        assert chosen.get(k, -1) == (max(own)[1] if own else -1)


def test_ctrl_c_leaves_the_pieces_that_have_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[int] = []

    def progress(fraction: float) -> None:
        if fraction > 0.1:
            raise KeyboardInterrupt

    for count in (1, 2):
        with_cores(monkeypatch, count)
        done.clear()

        def work(first: int, last: int) -> None:
            time.sleep(0.002)
            done.append(first)

        with pytest.raises(KeyboardInterrupt):
            cores.over_cores(1000, 1, lambda: work, progress)
        assert 90 <= len(done) < 500


def test_what_fails_in_another_thread_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    with_cores(monkeypatch, 2)
    here = threading.current_thread()

    def work(first: int, last: int) -> None:
        if threading.current_thread() is not here:
            raise ArithmeticError
        time.sleep(0.001)

    with pytest.raises(ArithmeticError):
        cores.over_cores(2000, 1, lambda: work)


def test_work_within_work_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    with_cores(monkeypatch, 2)
    done = np.zeros((6, 7), dtype=np.int64)

    def outer(first: int, last: int) -> None:
        def inner(a: int, b: int) -> None:
            time.sleep(0.001)
            done[first:last, a:b] += 1

        cores.over_cores(7, 1, lambda: inner)

    cores.over_cores(6, 1, lambda: outer)
    assert np.all(done == 1)


def test_progress_is_told_piece_by_piece_whoever_does_them(monkeypatch: pytest.MonkeyPatch) -> None:
    with_cores(monkeypatch, 2)
    here, seen = threading.current_thread(), list[float]()

    def work(first: int, last: int) -> None:
        time.sleep(0.05 if threading.current_thread() is here else 0.0)

    cores.over_cores(40, 1, lambda: work, seen.append)
    assert seen == [k / 40 for k in range(40)]
