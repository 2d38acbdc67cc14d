"""Random control problems: robots, tasks, starts, gains, resolvers; singular and out of reach among them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st

import nmm
from nmm.base.errors import NmmError
from nmm.base.kinds import RESOLVERS

from .hunting import Hunt, refused
from .truth import truthful

DT = 0.01
#: Of finite differences of a frame's place, beside how fast it moves.
DIFFERENCED = 1e-6

ROBOTS = {
    "unicycle_2r": lambda: nmm.load("unicycle_2r"),
    "unicycle_3r": lambda: nmm.load("unicycle_3r"),
    "small arm on a car": lambda: nmm.mount("car_base", "small_arm", at="arm_mount"),
    "small arm on a trailer": lambda: nmm.mount("trailer_base", "small_arm", at="trailer2_mount"),
    "small arm on mecanum wheels": lambda: nmm.mount("omni_base", "small_arm", at="arm_mount"),
    "small arm alone": lambda: nmm.load("small_arm", platform="fixed"),
}


@cache
def _robot(name: str) -> nmm.Robot:
    return ROBOTS[name]()


@cache
def _frames(name: str) -> list[str]:
    return [frame for frame in _robot(name).frames if frame not in ("x", "y", "theta")]


#: Angles and lengths, with those at which something is singular.
NUMBERS = st.one_of(
    st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi, 1e-9]), st.floats(-3.0, 3.0, allow_nan=False)
)
CASES = st.fixed_dictionaries(
    {
        "robot": st.sampled_from(sorted(ROBOTS)),
        "q0": st.lists(NUMBERS, min_size=10, max_size=10),
        "frame": st.floats(0.0, 1.0, exclude_max=True),
        "axes": st.sampled_from(["x", "xy", "xyz"]),
        "target": st.lists(st.floats(-4.0, 4.0, allow_nan=False), min_size=3, max_size=3),
        "radius": st.one_of(st.none(), st.floats(0.01, 5.0)),
        "rate": st.floats(-5.0, 5.0, allow_nan=False),
        "gain": st.one_of(st.none(), st.sampled_from([0.1, 1.0, 10.0, 500.0])),
        "resolver": st.sampled_from(sorted(set(RESOLVERS) - {"callable"})),
        "alpha": st.sampled_from([0.0, 1.0, 30.0, 1e4]),
        "objective": st.booleans(),
        "limits": st.booleans(),
        "method": st.sampled_from(["rk4", "euler", "zoh"]),
    }
)


def check(case: Any) -> str:
    robot = _robot(case["robot"])
    frames = _frames(case["robot"])
    frame, axes = frames[int(case["frame"] * len(frames))], case["axes"]
    target = np.array(case["target"])
    try:
        reference: Any = nmm.Constant(target[: len(axes)])
        if case["radius"] is not None and axes != "x":
            center = target if axes == "xyz" else target[:2]
            reference = nmm.Circle(center, radius=case["radius"], rate=case["rate"])
        task = nmm.Task(nmm.Position(frame, axes), reference, gain=case["gain"])
        kind = RESOLVERS[case["resolver"]]
        resolver = kind(alpha=case["alpha"]) if case["resolver"] in ("pg", "rg") else kind()
        objective = nmm.JointRange() if case["objective"] and len(robot.arm_coordinates) else None
        options: dict[str, Any] = {"limits": nmm.Limits(), "dt": DT} if case["limits"] else {}
        controller = nmm.Controller(robot, task, resolver, objective, **options)
        q0 = np.resize(case["q0"], robot.n)
        run = nmm.simulate(controller, q0, 0.3, DT, case["method"])
    except NmmError as error:
        return refused(error)
    word = truthful(run)
    if len(run) and word != "singular":
        as_asked(run, frame, axes, case["gain"])
    return word


def as_asked(run: nmm.Trajectory, frame: str, axes: str, gain: float | None) -> None:
    """The residual that is told is that of the frame's motion, by finite differences of where it is."""
    robot, h = run.robot, 1e-6
    rows = ["xyz".index(axis) for axis in axes]
    for k in (0, len(run) - 1):
        q, u = run.q[k], run.u[k]
        if not np.all(np.isfinite(u)) or np.abs(run.q_dot[k]).max() > 1e2 or np.abs(q).max() > 1e2:
            continue
        there = [nmm.Configuration(robot, q + step * run.q_dot[k]) for step in (-h, h)]
        before, after = (np.array(one.placement(frame).translation)[rows] for one in there)
        moved = (after - before) / (2.0 * h)
        here = np.array(nmm.Configuration(robot, q).placement(frame).translation)[rows]
        np.testing.assert_allclose(run.r[k], here, rtol=0, atol=1e-9, err_msg="r")
        np.testing.assert_allclose(run.error[k], run.r_d[k] - here, rtol=0, atol=1e-9, err_msg="e = r_d - r")
        if k + 1 < len(run):
            steps = run.r_d[k + 1] - run.r_d[k], run.t[k + 1] - run.t[k]
            # A circle's velocity from two of its points, wrong by no more than half its acceleration.
            rate = steps[0] / steps[1] + (0.0 if gain is None else gain) * run.error[k]
            bend = 0.5 * float(np.abs(np.diff(run.r_d[:3], 2, axis=0)).max(initial=0.0)) / steps[1]
            off = float(np.linalg.norm(moved - rate))
            size = 1.0 + float(np.linalg.norm(moved)) + float(np.linalg.norm(rate))
            slack = DIFFERENCED * size + 3.0 * bend
            assert abs(off - run.residual[k]) <= slack, (
                f"t = {run.t[k]:g}: the frame is {off:.6g} off its rate, the run says {run.residual[k]:.6g}"
            )


HUNT = Hunt("problems", CASES, check)
