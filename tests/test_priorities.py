"""Levels of priority: each gets all that the levels above leave, and takes nothing from them."""

from __future__ import annotations

import numpy as np
import pytest
from level_problems import Off, compared, problems

import nmm
from nmm.resolvers.problem import Problem

RESOLVERS = {
    "pg": nmm.ProjectedGradient(alpha=0.5),
    "rg": nmm.ReducedGradient(alpha=0.5),
    "dls": nmm.DampedLeastSquares(alpha=0.5),
}


@pytest.mark.parametrize("if_possible", [False, True])
def test_no_program_finds_more_for_any_level(if_possible: bool) -> None:
    """Linear ones for the rates and for limits that are kept if possible, a quadratic one for the rest."""
    offs = [compared(problem) for problem in problems(60, 2, if_possible=if_possible)]
    worst = Off(*np.array(offs).max(axis=0).tolist())
    assert worst.rate <= 1e-8
    assert worst.kept <= 1e-8
    assert worst.nearer <= 1e-9
    assert worst.broken <= 1e-11


@pytest.mark.parametrize("name", RESOLVERS)
def test_a_level_below_changes_nothing_above(name: str) -> None:
    scaled = 0
    for problem in problems(60, 3, if_possible=False):
        levels = tuple(problem.levels or ())
        rates = []
        for kept in (1, 2, 3):
            s = sum(levels[:kept])
            J, rate = np.asarray(problem.J)[:s], np.asarray(problem.rate)[:s]
            limits = {
                name: getattr(problem, name)
                for name in ("u_lower", "u_upper", "limit_rows", "lower", "upper")
            }
            answer = RESOLVERS[name].resolve(Problem(J, rate, problem.h, levels=levels[:kept], **limits))
            rates.append(J @ answer.u)
            scaled += answer.scale[0] < 1.0
        first, second = levels[0], levels[0] + levels[1]
        np.testing.assert_allclose(rates[1][:first], rates[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rates[2][:second], rates[1], rtol=0, atol=1e-9)
    assert scaled > 30
