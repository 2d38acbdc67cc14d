"""What is true of every run, whatever it was asked for and however it ended."""

from __future__ import annotations

import json

import numpy as np

from nmm.motion.trajectory import Outcome, Trajectory

from .hunting import LONGEST_LINE

#: Rounding, beside the size of what was added up.
ROUNDED = 1e-9
#: What a promise of the error leaves to the integrator at most, of 1 + the first error (docs/outcomes.md).
ALLOWED = 0.11


def truthful(run: Trajectory) -> str:
    """The outcome of a run of which the laws hold; `AssertionError` says which does not."""
    robot = run.robot
    for text in (run.message, *run.warnings):
        assert len(text) <= LONGEST_LINE, f"{len(text)} characters: {text[:200]} …"
    assert run.message.strip() or run.outcome is Outcome.COMPLETED, f"{run.outcome} without a word"
    if not len(run):
        assert run.outcome is not Outcome.COMPLETED
        return str(run.outcome)
    assert np.all(np.diff(run.t) > 0.0), "times that do not grow"
    regular = np.all(np.isfinite(run.u), axis=1)
    if run.outcome in (Outcome.COMPLETED, Outcome.MISSED, Outcome.UNSTABLE):
        assert regular.all(), f"{run.outcome} with inputs that are not finite"
        assert np.all(np.isfinite(run.q)), f"{run.outcome} with coordinates that are not finite"
    for k in np.linspace(0, len(run) - 1, 5).astype(int):
        if regular[k] and np.all(np.abs(run.q[k]) < 1e6):
            assert_admissible(run, int(k))
    if run.outcome is Outcome.COMPLETED:
        norm = run.error_norm
        told = bool(run.warnings) or bool(run.events) or run.limited
        bound = norm[0] + ALLOWED * (1.0 + norm[0])
        assert norm[-1] <= bound or told, f"completed, with an error of {norm[-1]:.3g} after {norm[0]:.3g}"
    summary = run.summary()
    json.dumps(summary)
    assert summary["outcome"] == str(run.outcome)
    assert robot.n == run.q.shape[1]
    return str(run.outcome)


def assert_admissible(run: Trajectory, k: int) -> None:
    """q_dot = S(q) u, and A(qp) qp_dot = 0."""
    robot, q, u = run.robot, run.q[k], run.u[k]
    size = 1.0 + float(np.abs(run.q_dot[k]).max(initial=0.0))
    S = robot.S(q)
    reach = 1.0 + float(np.abs(S).max(initial=0.0)) * float(np.abs(u).max(initial=0.0))
    np.testing.assert_allclose(run.q_dot[k], S @ u, rtol=0, atol=ROUNDED * reach, err_msg="q_dot = S u")
    n_p = robot.platform.n_p
    across = robot.platform.A(q[:n_p]) @ run.q_dot[k, :n_p]
    assert np.all(np.abs(across) <= ROUNDED * max(size, reach)), f"sideways: {across}"
