"""What hitches say of wheels that slip, beside a dense Gaussian of the motion and the hitches together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from nmm.plugins.robot.calibration.hitches import Slipping, told_by_hitches
from nmm.plugins.robot.calibration.planar import along_body
from nmm.plugins.robot.calibration.stretches import COUNTERS

Array = np.ndarray
#: Wheels, hitches, numbers.
WHEELS, HITCHES, FREE = 3, 2, 4
VARIANCES, OWN = np.array([1e-3, 2e-4, 3e-4]), 2e-3


class Given(NamedTuple):
    motions: Array
    ends: Array
    astray: Array
    by: Array
    slips: Slipping


def random_stretch(rng: np.random.Generator) -> Given:
    moved, turned = rng.normal(size=(1, 3, WHEELS)), rng.normal(size=(1, HITCHES, WHEELS))
    roots = rng.normal(size=(1, 3, 3, 3))
    noise = roots @ roots.transpose(0, 1, 3, 2)
    noise[0, COUNTERS] = moved[0] @ moved[0].T
    return Given(
        rng.normal(size=(1, 3)),
        rng.normal(size=(1, 3, FREE)),
        0.1 * rng.normal(size=(1, HITCHES)),
        rng.normal(size=(1, HITCHES, FREE)),
        Slipping(moved, turned, noise),
    )


def test_a_motion_and_its_hitches_have_the_likelihood_of_a_dense_gaussian(rng: np.random.Generator) -> None:
    """Slips x of wheels move the end by S x and turn hitches by A x, and these turn by v themselves: the
    density of both is that of the hitches times that of the motion as they tell it."""
    given = random_stretch(rng)
    S, A, variance = given.slips.moved[0], given.slips.turned[0], VARIANCES[COUNTERS]
    told = told_by_hitches(*given, VARIANCES, OWN)

    rest = np.tensordot(VARIANCES, given.slips.noise[0], (0, 0))
    own = A @ A.T * variance + OWN * np.eye(HITCHES)
    both = np.block([[rest, S @ A.T * variance], [A @ S.T * variance, own]])
    moved = np.array([0.02, -0.01, 0.03])  # the motion beside that by the counters
    dense = multivariate_normal(np.zeros(5), both).logpdf(np.concatenate([moved, given.astray[0]]))

    step = along_body(given.motions[:, 2], told.motions - given.motions)[0]
    noise = np.tensordot(told.variances, told.noise[0], (0, 0))
    by_parts = multivariate_normal(step, noise).logpdf(moved)
    by_parts -= 0.5 * (told.beside.over @ told.beside.over + told.beside.logarithms) + np.log(2.0 * np.pi)
    assert by_parts == pytest.approx(dense, rel=1e-9)


def test_slopes_of_what_hitches_tell_are_differences(rng: np.random.Generator) -> None:
    given, step = random_stretch(rng), 1e-3
    told = told_by_hitches(*given, VARIANCES, OWN)
    for i in range(FREE):
        other = given._replace(astray=given.astray + step * given.by[:, :, i])
        ahead = told_by_hitches(*other, VARIANCES, OWN)
        ends = along_body(given.motions[:, 2], ahead.motions - told.motions) / step
        assert ends == pytest.approx((told.ends - given.ends)[:, :, i], rel=1e-9)
        rows = (ahead.beside.over - told.beside.over) / step
        assert rows == pytest.approx(told.beside.slopes[:, i], rel=1e-9)


def test_what_is_left_of_wheels_that_slip_is_noise(rng: np.random.Generator) -> None:
    """Hitches that turn by nothing else tell two of three slips at most: no variance is below zero."""
    given = random_stretch(rng)
    told = told_by_hitches(*given, VARIANCES * [1e3, 0.0, 0.0], 1e-12)
    left = np.linalg.eigvalsh(told.noise[0, 0])
    assert left == pytest.approx([0.0, 0.0, left[2]], abs=1e-9 * left[2])
    assert left[2] > 0.0
