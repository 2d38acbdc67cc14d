"""What a calibration's kernels say, beside odometry, differences, pseudoinverses and a dense Gaussian."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers.simulated_drives import composed, placed, wander

import nmm
from nmm.base.kernels.compiled import checked_by_caller
from nmm.plugins.robot.calibration.innovations import BEGINS, INNOVATIONS, LEFT_OUT, TAKEN, innovations
from nmm.plugins.robot.calibration.planar import along_body
from nmm.plugins.robot.calibration.stretches import COUNTERS, Stretches, stretches
from nmm.plugins.robot.odometry import Counters, counted_wheels

Array = np.ndarray
ROBOTS = ("differential_base", "car_base", "omni_base", "trailer_base")


def counted(name: str, seconds: float = 4.0) -> tuple[Counters, Array, Array, Array]:
    """Counters of a robot, and t (N,), counts (N, k), own joints (N, n_p - 3) that no motion has to
    explain."""
    robot = nmm.load(name)
    counters = Counters(robot, dict.fromkeys(counted_wheels(robot), 0.0), name)
    t = np.arange(0.0, seconds, 0.05)  # as long as a stretch's steps
    k, joints = len(counters.names), robot.platform.n_p - 3
    return counters, t, np.cumsum(0.1 * wander(k)(t), axis=0), 0.3 * wander(max(joints, 1), 3)(t)[:, :joints]


@pytest.mark.parametrize("name", ROBOTS)
def test_a_stretch_is_odometry_from_its_beginning_to_its_end(name: str) -> None:
    counters, t, counts, own = counted(name)
    robot, at = counters.robot, t[20:61:20]
    made = stretches(counters.record, t, counts, own, at)
    n_p = robot.platform.n_p

    def readings(i: int) -> dict[str, float]:
        told = dict(zip(counters.names, counts[i].tolist(), strict=True))
        return told | dict(zip(robot.q_names[3:n_p], own[i].tolist(), strict=True))

    q = robot.rest
    q[3:n_p] = own[20]
    odometry = robot.odometry(q, readings(20), spread=1.0)
    for i in range(21, 41):
        q = odometry.update(readings(i))
    assert made.motions[0] == pytest.approx(q[:3], abs=1e-12)
    R = np.eye(3)
    R[:2, :2] = [[np.cos(q[2]), np.sin(q[2])], [-np.sin(q[2]), np.cos(q[2])]]
    covariance = R @ odometry.covariance @ R.T
    assert made.noise[0, COUNTERS] == pytest.approx(covariance, abs=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_slopes_of_stretches_are_differences_of_their_ends(name: str) -> None:
    counters, t, counts, own = counted(name)
    at = np.array([0.3, 0.71, 1.5])
    made = stretches(counters.record, t, counts, own, at)
    for c in range(counts.shape[1]):
        ends: list[Stretches] = []
        for sign in (1.0, -1.0):
            other = counts.copy()
            other[:, c] *= 1.0 + sign * 1e-5
            ends.append(stretches(counters.record, t, other, own, at))
        slope = along_body(made.motions[:, 2], (ends[0].motions - ends[1].motions) / 2e-5)
        assert made.slopes[:, :, c] == pytest.approx(slope, abs=1e-7)
        assert made.spare_slopes[:, :, c] == pytest.approx((ends[0].spare - ends[1].spare) / 2e-5, abs=1e-7)


def test_what_is_spare_is_what_no_inputs_explain() -> None:
    counters, t, counts, own = counted("omni_base")
    made = stretches(counters.record, t, counts, own, t[[10, 20]])
    M = counters.matrix(own[0])[0]
    went = counts[20] - counts[10]
    assert made.spare[0] == pytest.approx(went - M @ np.linalg.pinv(M) @ went, abs=1e-12)
    assert np.abs(made.spare[0]).max() > 1e-3
    counters, t, counts, own = counted("differential_base")
    assert not stretches(counters.record, t, counts, own, t[[10, 20]]).spare.any()


def test_steps_of_a_stretch_end_at_its_looks() -> None:
    counters, t, counts, own = counted("car_base")
    whole = stretches(counters.record, t, counts, own, np.array([0.5, 2.5]))
    parts = stretches(counters.record, t, counts, own, np.array([0.5, 1.5, 2.5]))
    assert composed(parts.motions)[-1] == pytest.approx(whole.motions[0], abs=1e-12)
    assert parts.counted.sum(axis=0) == pytest.approx(whole.counted[0], abs=1e-12)


#: A drive of four stretches, with their noise, for a reference beside the middle.
MOTIONS = np.array([[0.5, 0.02, 0.3], [0.4, 0.0, -0.2], [0.3, -0.01, 0.6], [0.5, 0.0, 0.1]])
MOUNT = np.array([0.2, -0.1, 0.4])
SIZE = 1e-5


def noises(seed: int = 1) -> Array:
    A = np.random.default_rng(seed).normal(size=(len(MOTIONS), 3, 3))
    return SIZE**2 * (A @ A.transpose(0, 2, 1))


def filtered(z: Array, rows: int, taken: Array, R: Array, n: int = 1, **given: Any) -> tuple[Array, ...]:
    """w, S, W, poses."""
    many = len(z)
    out = np.zeros((many, rows)), np.ones((many, rows)), np.zeros((many, rows, n)), np.zeros((many, 3))
    slopes = given.get("slopes", np.zeros((many - 1, 3, n)))
    columns = given.get("columns", np.full(3, -1))
    mount = given.get("mount", MOUNT)
    call = checked_by_caller(innovations, INNOVATIONS)
    call(
        *(given.get("motions", MOTIONS), slopes, 0.25 * noises()[:, np.newaxis], np.array([4.0]), z, taken),
        *(np.tile(R, (many, 1)), mount, columns, *out),
    )
    return out


def exp(eps: Array) -> Array:
    """The motion of a small error, m and rad."""
    return eps + 0.5 * eps[2] * np.array([-eps[1], eps[0], 0.0])


def compose(a: Array, b: Array) -> Array:
    c, s = np.cos(a[2]), np.sin(a[2])
    return a + np.array([c * b[0] - s * b[1], s * b[0] + c * b[1], b[2]])


@pytest.mark.parametrize(("rows", "left_out"), [(3, -1), (3, 2), (2, -1)])
def test_innovations_have_the_likelihood_of_a_dense_gaussian(rows: int, left_out: int) -> None:
    """All looks after the first are a linear function of small noise: their covariance by differences."""
    R = np.array([4.0, 4.0, 2.0]) * SIZE**2
    if rows == 2:
        R[2] = 1.0  # of the guess
    L = np.linalg.cholesky(noises())
    sizes = np.concatenate([np.sqrt(R), np.ones(3 * len(MOTIONS)), np.tile(np.sqrt(R[:rows]), len(MOTIONS))])
    base = placed(composed(MOTIONS), MOUNT)

    def looks(noise: Array) -> Array:
        """(4, rows) : where the reference is seen, for unit noise of the first look's pose, stretches,
        looks."""
        first, steps = noise[:3] * np.sqrt(R), noise[3:15].reshape(4, 3)
        seen = noise[15:].reshape(4, rows) * np.sqrt(R[:rows])
        z = base[0] - np.array([*first[:2], first[2]])
        pose = np.array([0.0, 0.0, z[2] - MOUNT[2]])
        c, s = np.cos(pose[2]), np.sin(pose[2])
        pose[:2] = z[:2] - np.array([c * MOUNT[0] - s * MOUNT[1], s * MOUNT[0] + c * MOUNT[1]])
        found = []
        for motion, factor, step, look in zip(MOTIONS, L, steps, seen, strict=True):
            pose = compose(compose(pose, motion), exp(factor @ step))
            found.append(placed(pose[np.newaxis], MOUNT)[0, :rows] + look)
        return np.array(found)

    unit, n = 1e-3 if rows == 3 else 1e-7, len(sizes)
    J = np.array([(looks(unit * e) - looks(-unit * e)).ravel() / (2.0 * unit) for e in np.eye(n)]).T
    keep = np.array([m != left_out for m in range(1, 5) for _ in range(rows)])
    covariance = (J @ J.T)[np.ix_(keep, keep)]
    off = (J @ np.random.default_rng(4).normal(size=n))[keep] if rows == 3 else None
    z, taken = base.copy(), np.array([BEGINS, TAKEN, TAKEN, TAKEN, TAKEN])
    if left_out > 0:
        taken[left_out] = LEFT_OUT
    if off is None:  # a heading that is only guessed makes large errors: only small ones are linear
        off = 3.0 * SIZE * np.random.default_rng(4).normal(size=keep.sum())
    full = np.zeros(4 * rows)
    full[keep] = off
    z[1:, :rows] += full.reshape(4, rows)
    w, S, _, _ = filtered(z, rows, taken, R)
    used = np.flatnonzero(taken == TAKEN)
    square = float(np.sum(w[used] ** 2))
    assert square == pytest.approx(off @ np.linalg.solve(covariance, off), rel=2e-3)
    assert np.sum(np.log(S[used])) == pytest.approx(np.linalg.slogdet(covariance)[1], abs=2e-3)


def test_slopes_of_innovations_are_differences_where_nothing_is_off() -> None:
    """Of a mount, and of a number that lengthens all motions."""
    lengthened = MOTIONS * np.array([1.0, 1.0, 0.0])
    turned = MOTIONS[:, 2]
    slopes = np.zeros((4, 3, 4))
    slopes[:, :, 0] = along_body(turned, lengthened)
    columns, R = np.array([1, 2, 3]), np.array([1e-6, 1e-6, 1e-6])
    z, taken = placed(composed(MOTIONS), MOUNT), np.array([BEGINS, TAKEN, LEFT_OUT, TAKEN, TAKEN])
    w, _, W, poses = filtered(z, 3, taken, R, 4, slopes=slopes, columns=columns)
    assert np.abs(w).max() < 1e-9
    assert poses == pytest.approx(composed(MOTIONS), abs=1e-12)
    for i in range(4):
        ends = []
        for step in (1e-6, -1e-6):
            mount = MOUNT + (step * np.eye(3)[i - 1] if i else 0.0)
            motions = MOTIONS + (step * lengthened if i == 0 else 0.0)
            ends.append(filtered(z, 3, taken, R, 1, mount=mount, motions=motions)[0])
        assert W[:, :, i] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-3 * np.abs(W[:, :, i]).max())


def test_a_turn_of_the_reference_counts_for_what_is_beyond_whole_ones() -> None:
    z, R = placed(composed(MOTIONS), MOUNT), np.array([1e-6, 1e-6, 1e-6])
    z[2:, 2] += 2.0 * np.pi
    taken = np.array([BEGINS, TAKEN, TAKEN, TAKEN, TAKEN])
    assert np.abs(filtered(z, 3, taken, R)[0]).max() < 1e-6
