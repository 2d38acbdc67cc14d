"""What a run amounts to: the error against its promise, J u against the rate, and the reason in words."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from findings import codes, the, why
from numpy import pi
from robot_grid import DATA
from scipy.linalg import expm
from urdf_parts import joint, link, write
from urdf_parts import robot as urdf

import nmm
from nmm.control.directions import in_world_axes, lost_directions
from nmm.control.resolvers import Answer, Problem, Status
from nmm.model.robots.reach import joint_position, reach
from nmm.model.robots.robot import Robot
from nmm.motion.diagnosis.error_bound import Feedback, accumulated, decay, expected_decay
from nmm.motion.diagnosis.jumps import chattering

START = {"x": -1, "y": -1, "theta": pi}
TIP = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, 0.08 * pi, 5 / 4 * pi))
UR3 = DATA + "ur_description/urdf/ur3_robot.urdf"


def plain(problem: Problem) -> np.ndarray:
    return np.linalg.pinv(problem.J) @ problem.rate


def clipped(limit: float) -> nmm.CallableResolver:
    return nmm.CallableResolver(lambda problem: np.clip(plain(problem), -limit, limit))


# The residual


def test_inputs_that_are_clipped_for_good_miss(robot_2r: Robot, tmp_path: Path) -> None:
    run = nmm.simulate(nmm.Controller(robot_2r, TIP, clipped(0.3)), START, 2.0, 0.01)
    assert run.outcome is nmm.Outcome.MISSED
    assert not run.complete
    assert "inputs_fell_short" in why(run)
    assert run.unmet.samples == len(run)
    assert run.unmet.largest == run.residual.max()
    numbers = json.loads((run.save(tmp_path / "run", figures=False) / "summary.json").read_text())
    assert (numbers["outcome"], numbers["unmet_samples"], numbers["unmet_share"]) == ("missed", len(run), 1.0)
    assert numbers["unmet_largest"] == numbers["residual_max"]
    loaded = nmm.Trajectory.load(tmp_path / "run")
    assert loaded.unmet == run.unmet
    assert np.array_equal(loaded.scale, np.ones((len(run), 1)))


@pytest.mark.parametrize(("angle", "told"), [(90.0, {"theta": 90.0, "q1": -30.0}), (7.5, {"q1": -30.0})])
def test_a_start_in_degrees_is_told(angle: float, told: dict[str, float], robot_2r: Robot) -> None:
    """Whole numbers beyond a turn; x is no angle, and nobody means 1 degree."""
    start = {"x": 90.0, "theta": angle, "q1": -30.0, "q2": 1.0}
    run = nmm.simulate(nmm.Controller(robot_2r, TIP, clipped(0.3)), start, 0.02, 0.01)
    assert the(run, "start_in_degrees").values["angles"] == told


def test_inputs_that_are_clipped_at_the_start_are_told(robot_2r: Robot) -> None:
    """The error then follows later than promised, but ends where it was promised."""
    run = nmm.simulate(nmm.Controller(robot_2r, TIP, clipped(1.5)), START, 10.0, 0.01)
    assert run.complete, run.message
    unmet = the(run, "inputs_unmet").values
    assert unmet["samples"] == np.sum(run.residual > 1e-9)
    assert unmet["largest"] == run.residual.max()
    free = nmm.simulate(nmm.Controller(robot_2r, TIP, clipped(10.0)), START, 10.0, 0.01)
    assert free.complete
    assert free.warnings == ()
    assert free.unmet.samples == 0


def test_a_rate_that_is_scaled_on_purpose_is_recorded(robot_2r: Robot) -> None:
    def scaled(problem: Problem) -> Answer:
        u = plain(problem)
        scale = min(1.0, 1.5 / np.abs(u).max())
        return Answer(scale * u, Status.RELAXED if scale < 1 else Status.SOLVED, np.array([scale]), 0.0, 1.0)

    run = nmm.simulate(nmm.Controller(robot_2r, TIP, nmm.CallableResolver(scaled)), START, 10.0, 0.01)
    assert run.complete, run.message
    assert run.scale.shape == (len(run), 1)
    assert np.all(run.scale[run.residual > 1e-9] < 1.0)
    assert np.all(run.scale[run.residual <= 1e-9] == 1.0)
    assert the(run, "inputs_unmet").values["scale"] == run.scale.min()
    assert run.summary()["scale_min"] == run.scale.min() < 1.0


def test_an_older_folder_without_scale_loads(robot_2r: Robot, tmp_path: Path) -> None:
    run = nmm.simulate(nmm.Controller(robot_2r, TIP, nmm.ProjectedGradient()), START, 0.1, 0.01)
    folder = run.save(tmp_path / "run", figures=False)
    with np.load(folder / "trajectory.npz") as file:
        arrays = {name: file[name] for name in file.files if name != "scale"}
    np.savez(folder / "trajectory.npz", **arrays)
    assert np.array_equal(nmm.Trajectory.load(folder).scale, np.ones((len(run), 1)))


# The promise


def feedback(K: np.ndarray, speed: float = np.inf, braking: float = np.inf) -> Feedback:
    """Gains and bounds of one group of rows."""
    s = len(K)
    return Feedback(K, np.full(s, speed), np.full(s, braking), np.zeros(s, dtype=np.int64))


def test_the_promise_is_the_exponential(rng: np.random.Generator) -> None:
    K = rng.normal(size=(3, 3)) + 3 * np.eye(3)
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.35])
    error = np.tile(rng.normal(size=3), (5, 1))
    expected = [np.linalg.norm(expm(-K * one) @ error[0]) for one in t]
    np.testing.assert_allclose(expected_decay(t, error, feedback(K)), expected, rtol=1e-12)
    # An error of 1 that was made along the first step, and what is left of it.
    symmetric = K @ K.T
    left = accumulated(np.array([1.0, 0, 0, 0]), decay(t, error, feedback(symmetric)))
    slowest = np.linalg.eigvalsh(symmetric)[0]
    np.testing.assert_allclose(left[1:], np.exp(-slowest * (t[1:] - t[1])), rtol=1e-9)


def test_the_promise_counts_a_bound_of_the_feedback(rng: np.random.Generator) -> None:
    """From 3 m at 0.5 m/s, braked at 0.4 m/s² from 0.3125 m on, and exponential below 2 b / K² = 0.2 m."""
    K, speed, braking = 2.0, 0.5, 0.4
    direction = rng.normal(size=3)
    error = 3.0 * direction[np.newaxis] / np.linalg.norm(direction)
    t = np.linspace(0.0, 9.0, 901)
    begins = (3.0 - 0.3125) / speed  # ‖e‖ = (√e - √(b/2) t)² from there on
    meets = begins + (np.sqrt(0.3125) - np.sqrt(0.2)) / np.sqrt(braking / 2)
    expected = np.where(
        t < begins, 3.0 - speed * t, (np.sqrt(0.3125) - np.sqrt(braking / 2) * (t - begins)) ** 2
    )
    expected = np.where(t > meets, 0.2 * np.exp(-K * (t - meets)), expected)
    bounded = feedback(K * np.eye(3), speed, braking)
    np.testing.assert_allclose(expected_decay(t, error, bounded), expected, atol=1e-5)
    np.testing.assert_array_equal(bounded.bound(expected[:, np.newaxis] * error / 3.0), t < meets)


@pytest.mark.parametrize("bounds", [{"speed": 0.3}, {"braking": 0.1}, {"speed": {"m": 0.3}, "braking": 0.1}])
def test_a_run_whose_feedback_is_bounded_keeps_its_promise(
    robot_2r: Robot, bounds: dict[str, object]
) -> None:
    """Towards a target metres away: nothing to warn about, and a promise that other inputs do not keep."""
    task = nmm.Task(TIP.function, [4.0, 1.0], 2.0, **bounds)
    run = nmm.simulate(
        nmm.Controller(robot_2r, task, nmm.ReducedGradient()), START, 40.0, 0.01, until=nmm.Goal()
    )
    assert run.outcome == "completed"
    assert run.warnings == ()

    def slow(problem: Problem) -> np.ndarray:
        return 0.7 * np.linalg.pinv(problem.J) @ problem.rate

    late = nmm.simulate(nmm.Controller(robot_2r, task, nmm.CallableResolver(slow)), START, 4.0, 0.01)
    assert [one.code for one in late.verdict.warnings[-1]] == ["promise_left", "inputs_fell_short"]


@pytest.mark.parametrize(
    ("gain", "method"),
    [
        *((None, method) for method in ("euler", "midpoint", "rk4", "zoh")),
        (1.0, "rk4"),
        (5.0, "zoh"),
        (5.0, "adaptive"),
    ],
)
def test_honest_runs_keep_their_promise(robot_2r: Robot, gain: float | None, method: str) -> None:
    task = nmm.Task(TIP.function, TIP.reference, gain)
    for dt in (0.002, 0.02):
        run = nmm.simulate(nmm.Controller(robot_2r, task, nmm.ReducedGradient()), START, 4.0, dt, method)
        assert run.complete, run.message
        assert run.warnings == ()


def test_what_a_motion_does_otherwise_is_no_honest_error(robot_2r: Robot) -> None:
    """Inputs that are wrong so that the error ends elsewhere, at any dt, though the residual says nothing."""

    class Liar(nmm.CallableResolver):
        exact: ClassVar[bool] = False

        def finish(self, problem, dimensions, answer) -> None:  # type: ignore[no-untyped-def]
            super().finish(problem, dimensions, answer)
            answer.residual[()] = 0.0

    def wrong(problem: Problem) -> np.ndarray:
        return 0.8 * plain(problem)

    for method, dt in (("rk4", 0.02), ("euler", 0.02), ("zoh", 0.005)):
        run = nmm.simulate(nmm.Controller(robot_2r, TIP, Liar(wrong)), START, 4.0, dt, method)
        assert run.outcome is nmm.Outcome.MISSED, (method, dt)
        left = the(run, "promise_left").values
        assert [left["initial"], left["errors"][-1]["error"]] == run.error_norm[[0, -1]].tolist()


def test_the_worst_error_is_told_beside_the_last() -> None:
    """Of a run that went far off and came back only in part."""
    run = nmm.Scenario.load("unicycle_3r_out_of_reach", {"resolver.kind": "pg"}).run()
    assert run.outcome is nmm.Outcome.MISSED
    worst, last = the(run, "promise_left").values["errors"]
    assert worst["error"] == run.error_norm[run.t == worst["t"]]
    assert last["error"] == run.error_norm[-1]
    assert worst["error"] > 2.0 * last["error"]


def reference(function: Callable[[float], list[float]]) -> nmm.Task:
    g = nmm.CallableReference(function, 2, rate=lambda t: [0.0, 0.0])
    return nmm.Task(nmm.Position("ee", "xy"), g, 5.0)


def test_a_target_that_jumps_restarts_the_promise(robot_2r: Robot) -> None:
    task = reference(lambda t: [1.0 + 0.3 * (t > 0.5) - 0.2 * (t > 1.3), 0.5])
    run = nmm.simulate(nmm.Controller(robot_2r, task, nmm.ProjectedGradient()), {"q2": 0.7}, 2.0, 0.01)
    assert run.complete, run.message
    assert run.warnings == ()


def test_a_rate_that_is_not_the_targets_is_told(robot_2r: Robot) -> None:
    task = reference(lambda t: [1.0 + 0.3 * np.sin(t), 0.5])
    run = nmm.simulate(nmm.Controller(robot_2r, task, nmm.ProjectedGradient()), {"q2": 0.7}, 2.0, 0.01)
    assert "target_jumps" in codes(run)


def test_a_target_that_moves_as_its_rate_says_is_not_blamed(robot_2r: Robot) -> None:
    """Inputs are clipped while the target goes round: that alone is why the error exceeds its decay."""
    circle = nmm.Circle(center=[2, 2], radius=3, rate=0.25, phase=4.0)
    resolver = nmm.CallableResolver(lambda p: np.clip(np.linalg.pinv(p.J) @ p.rate, -1.0, 1.0))
    controller = nmm.Controller(robot_2r, nmm.Task(nmm.Position("ee", "xy"), circle, 1.0), resolver)
    run = nmm.simulate(controller, {"x": -1, "y": -1, "theta": np.pi}, 15.0, 0.02)
    assert "inputs_fell_short" in codes(run)
    assert "target_jumps" not in codes(run)


@pytest.mark.parametrize("weighted", [False, True])
def test_small_wheels_are_damped_unless_weights_know_their_radius(weighted: bool) -> None:
    """With weights r² a motion does not depend on r; without, small wheels creep, and the run says why."""
    ends = []
    for r in (0.03, 0.1):
        robot = nmm.load("unicycle_3r", platform=nmm.DifferentialDrive(r, 0.5))
        limits = nmm.Limits({"platform": 0.5 / r, "arm": 2.0}, acceleration={"platform": 1.0 / r, "arm": 5.0})
        task = nmm.Task(nmm.Position("ee"), [3.0, 1.0, 1.0], gain=3.0, speed=0.5)
        resolver = nmm.DampedLeastSquares(alpha=1, weights={"platform": r * r} if weighted else None)
        posture = nmm.PreferredPosture({"q2": 0.6, "q3": 0.8})
        controller = nmm.Controller(robot, task, resolver, posture, limits=limits, dt=0.01)
        run = nmm.simulate(controller, {"q2": 0.6, "q3": 0.8}, 15.0, 0.01, "zoh")
        ends.append(run.q[-1])
        assert run.complete == (weighted or r == 0.1)
        if not run.complete:
            values = the(run, "inputs_fell_short").values
            assert values["sigma"] == pytest.approx(run.sigma_min.min(), rel=0.5)
            assert values["sigma"] < values["threshold"] == 0.05
    assert np.allclose(*ends, rtol=0, atol=1e-6) == weighted


# Chattering


def test_chattering_is_counted() -> None:
    t = np.linspace(0, 1, 101)
    smooth = np.column_stack([np.sin(20 * t), np.where(t < 0.5, 1.0, -3.0)])
    assert chattering(t, smooth, ("a", "b")) is None
    jumpy = smooth.copy()
    jumpy[40:51, 1] += np.where(np.arange(11) % 2, 2.0, -2.0)
    found = chattering(t, jumpy, ("a", "b"))
    assert found is not None
    assert (found.values["input"], found.values["size"]) == ("b", pytest.approx(8.0, abs=2.1))
    assert found.where["t"] == pytest.approx(0.4, abs=0.02)
    assert found.values["end"] == pytest.approx(0.5, abs=0.02)


# The reason


def scara(folder: Path, base: bool) -> Robot:
    """RRPR: two upright joints, one that slides down, a wrist that turns about the same axis."""
    upright = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="9"/>'
    slides = '<axis xyz="0 0 -1"/><limit lower="0" upper="0.3" effort="1" velocity="9"/>'
    text = urdf(
        *(link(name) for name in ("column", "inner", "outer", "quill", "tool")),
        joint("j1", "column", "inner", "revolute", upright, '<origin xyz="0 0 0.6"/>'),
        joint("j2", "inner", "outer", "revolute", upright, '<origin xyz="0.4 0 0"/>'),
        joint("j3", "outer", "quill", "prismatic", slides, '<origin xyz="0.3 0 0"/>'),
        joint("j4", "quill", "tool", "revolute", upright, '<origin xyz="0 0 -0.1"/>'),
    )
    arm = nmm.load(write(folder / "scara.urdf", text), platform="fixed")
    return nmm.mount("differential_base", arm, at="arm_mount") if base else arm


def test_a_scara_cannot_tilt_its_tool(tmp_path: Path) -> None:
    robot = scara(tmp_path, base=True)
    frame = next(name for name in robot.frames if name.endswith("tool"))
    q = dict(zip(robot.q_names[3:], (0.3, 0.9, 0.1, 0.2), strict=True))
    here = nmm.Configuration(robot, robot.q(q)).placement(frame)
    goal = nmm.PoseReference(here.translation + 0.05, nmm.rotation_vector(rpy=[0.2, 0.1, 0.3]))
    run = nmm.simulate(
        nmm.Controller(robot, nmm.Task(nmm.Pose(frame), goal), nmm.ProjectedGradient()), q, 1.0
    )
    assert run.outcome is nmm.Outcome.SINGULAR
    assert set(the(run, "singular").values["lost"]) == {f"tilt of {frame} about {axis}" for axis in "xy"}


def test_lost_directions_are_those_that_no_input_moves(rng: np.random.Generator) -> None:
    rows = nmm.Pose("ee").rows(nmm.load("unicycle_3r"))
    words = [f"motion of ee along {axis}" for axis in "xyz"]
    words += ["tilt of ee about x", "tilt of ee about y", "turn of ee about z"]
    full = rng.normal(size=(6, 8))
    assert lost_directions(full, rows, np.ones(6)) == []
    for row, word in enumerate(words):
        assert lost_directions(np.where(np.arange(6)[:, None] == row, 0.0, full), rows, np.ones(6)) == [word]
    # A combination in other scales: y of unit length, yᵀ diag(1 / scales) J = 0.
    y, scales = np.array([0, 0.6, 0.8, 0, 0, 0]), np.array([2.0, 2, 2, 1, 1, 1])
    J = scales[:, None] * (full - np.outer(y, y @ full))
    assert lost_directions(J, rows, scales) == ["motion of ee along 0.6 y + 0.8 z"]
    assert lost_directions(J, [row._replace(name=f"r{i}") for i, row in enumerate(rows)], scales) == [
        "0.6 r1 + 0.8 r2"
    ]


def test_rows_in_world_axes_lose_rank_with_the_tasks_own(tmp_path: Path, rng: np.random.Generator) -> None:
    robots = {scara(tmp_path, base=True): 4, nmm.mount("differential_base", "small_arm", at="arm_mount"): 6}
    for robot, rank in robots.items():
        frame = robot.frames[-1]
        q = rng.uniform(0.1, 0.3, robot.n)
        task = nmm.Task(nmm.Pose(frame), rng.uniform(-0.5, 0.5, 6))
        still = nmm.CallableResolver(lambda problem: np.zeros(problem.J.shape[1]))
        J = nmm.Controller(robot, task, still).evaluate(0.0, q).J
        turned = in_world_axes(J, nmm.Stack.of(task), robot, q)
        for matrix in (J, turned):
            assert np.linalg.matrix_rank(matrix, tol=1e-9) == rank
            assert len(lost_directions(matrix, task.rows(robot), np.ones(6))) == 6 - rank


@pytest.mark.parametrize("name", ["unicycle_3r", "small_arm", "sliding"])
def test_no_configuration_is_beyond_reach(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    robot = scara(tmp_path, base=True) if name == "sliding" else nmm.load(name)
    frame = next(one for one in reversed(robot.frames) if one.endswith(("ee", "tool")))
    arm = reach(robot, frame)
    assert arm is not None
    lower, upper = np.clip(robot.q_limits, -pi, pi).T
    farthest = 0.0
    for q in rng.uniform(lower, upper, (300, robot.n)):
        place = nmm.Configuration(robot, q).placement(frame).translation
        farthest = max(farthest, float(np.linalg.norm(place - joint_position(robot, q, arm.joint))))
    assert 0.5 * arm.length < farthest <= arm.length * (1 + 1e-12)
    assert reach(robot, robot.q_names[0]) is None or robot.platform.n_p == 0


@pytest.mark.parametrize("axes", ["z", "xyz"])
def test_a_target_out_of_reach_is_said_to_be(axes: str) -> None:
    robot = nmm.mount("differential_base", UR3, at="arm_mount")
    frame = next(name for name in robot.frames if name.endswith("tool0"))
    arm = dict(zip(robot.q_names[3:], (0.3, -1.2, 1.5, -1.8, -1.4, 0.0), strict=True))
    task = nmm.Task(nmm.Position(frame, axes), {"z": [1.6], "xyz": [1.0, 0.0, 1.6]}[axes])
    run = nmm.simulate(nmm.Controller(robot, task, nmm.ProjectedGradient()), arm, 3.0, 0.02, "euler")
    assert run.outcome is nmm.Outcome.MISSED
    assert why(run)[:2] == ["promise_left", "out_of_reach"]
    assert "dt_too_long" not in codes(run)
    found = reach(robot, frame)
    assert found is not None
    height = 1.6 - joint_position(robot, robot.q(arm), found.joint)[2]
    far = the(run, "out_of_reach").values
    assert (far["away"], far["side"]) == (pytest.approx(height, rel=1e-9), "above")
    assert (far["joint"], far["length"]) == (found.joint, found.length)
    assert height > found.length


# Advice


@pytest.mark.parametrize(
    ("method", "alpha"), [("euler", 300.0), ("midpoint", 1000.0), ("rk4", 300.0), ("zoh", 1000.0)]
)
def test_advice_on_dt_holds(method: str, alpha: float) -> None:
    changes = {"resolver.alpha": alpha, "dt": 0.01, "method": method, "duration": 2}
    run = nmm.Scenario.load("unicycle_2r_position", changes).run()
    assert not run.complete
    advised = the(run, "dt_too_long").values["tried"]["dt"]
    for share in (0.99, 0.5):
        better = nmm.Scenario.load("unicycle_2r_position", changes | {"dt": share * advised}).run()
        assert better.complete, better.message
        assert "dt_too_long" not in codes(better)


def test_the_angle_of_an_error_wraps(robot_2r: Robot) -> None:
    """A heading almost half a turn away, with a target that turns: no departure where the value passes π."""
    task = nmm.Task(nmm.Heading("ee"), nmm.CallableReference(lambda t: [3.0 + 0.8 * t], 1), 1.0)
    run = nmm.simulate(nmm.Controller(robot_2r, task, nmm.ProjectedGradient()), {}, 5.0, 0.02)
    assert run.complete, run.message
    assert np.abs(run.error).max() <= pi
