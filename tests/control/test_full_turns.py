"""Joints that go round: the short way, as a formula modulo 2π and the file's own words say it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from findings import codes

import nmm
from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.difference import difference

TURN = 2.0 * np.pi
LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 2.0}, acceleration=4.0)
LINK = '<link name="{0}"/>'
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{0}_link"/><origin xyz="0.2 0 0.2"/>'
    '<axis xyz="0 0 1"/>{3}</joint>'
)
RANGE = '<limit lower="-3" upper="3" effort="9" velocity="2"/>'
FREE = '<limit effort="9" velocity="2"/>'


def written(folder: Path, joints: Mapping[str, tuple[str, str]]) -> Path:
    """A chain of joints: their types and what more they hold, by name."""
    parent, parts = "base", ['<robot name="chain">', LINK.format("base")]
    for name, (kind, more) in joints.items():
        parts += [LINK.format(f"{name}_link"), JOINT.format(name, kind, parent, more)]
        parent = f"{name}_link"
    path = folder / "chain.urdf"
    path.write_text("\n".join([*parts, "</robot>"]), "utf-8")
    return path


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    path = written(tmp_path, {"j1": ("continuous", FREE), "j2": ("revolute", RANGE)})
    return nmm.load(path, platform="unicycle")


def wrapped(q: Array, column: int) -> Array:
    found = q.copy()
    found[..., column] = np.arctan2(np.sin(q[..., column]), np.cos(q[..., column]))
    return found


def way(q: Array) -> float:
    return float(np.abs(np.diff(q)).sum())


def test_which_joints_go_round_is_what_the_file_says(tmp_path: Path) -> None:
    follow = '<mimic joint="{}" multiplier="{}"/>'.format
    path = written(
        tmp_path,
        {
            "j1": ("continuous", FREE),
            "j2": ("revolute", RANGE),
            "j3": ("prismatic", RANGE),
            "j4": ("continuous", ""),
            "geared": ("continuous", FREE + follow("j4", -2)),
            "j5": ("continuous", FREE),
            "halved": ("continuous", FREE + follow("j5", 0.5)),
        },
    )
    robot = nmm.load(path, platform="omnidirectional")
    says = {joint.get("name"): joint.get("type") for joint in ElementTree.parse(path).iter("joint")}
    alone = {name for name, kind in says.items() if kind == "continuous"} - {"geared", "j5", "halved"}
    found = {name for name, one in zip(robot.q_names, robot.continuous, strict=True) if one}
    assert found == alone | {"theta"}
    # Of a full turn of its leader a joint with twice its rate makes two.
    off = np.zeros(robot.n)
    off[[robot.coordinate("j4"), robot.coordinate("geared")]] = 6.0, -12.0
    short = robot.short_way(off)
    assert short[robot.coordinate("j4")] == pytest.approx(6.0 - TURN)
    assert short[robot.coordinate("geared")] == pytest.approx(-12.0 + 2.0 * TURN)
    off = np.where(np.array(robot.q_names) == "j5", 6.0, 0.0)
    assert np.array_equal(robot.short_way(off), off)


def test_an_unlimited_hinge_of_mjcf_goes_round(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><joint name="j1" axis="0 0 1"/><geom size="0.1"/>'
        '<body name="b" pos="0.5 0 0"><joint name="j2" axis="0 1 0" range="-90 90"/><geom size="0.1"/></body>'
        "</body></worldbody></mujoco>",
        "utf-8",
    )
    assert nmm.load(path, platform="fixed").continuous.tolist() == [True, False]


@pytest.mark.parametrize(("start", "goal"), [(3.1, -3.1), (-3.0, 2.9), (0.5, 7.0)])
def test_plans_turn_the_short_way(robot: Robot, start: float, goal: float) -> None:
    end = {"x": 0, "y": 0, "theta": 0, "j2": 0}
    for smooth in (False, True):
        plan = nmm.plan(robot, {"j1": start}, {**end, "j1": goal}, limits=LIMITS, smooth=smooth)
        q, _ = plan(np.linspace(0.0, plan.duration, 400))
        least = abs((goal - start + np.pi) % TURN - np.pi)
        assert way(q[:, 3]) == pytest.approx(least, abs=1e-3)
        assert np.cos(q[-1, 3] - goal) == pytest.approx(1.0, abs=1e-9)
    # Limits of one's own cannot be crossed.
    kept = nmm.Limits(velocity={"platform": 1.0}, acceleration=4.0, position={"j1": [-10.0, 10.0]})
    plan = nmm.plan(robot, {"j1": start}, {**end, "j1": goal}, limits=kept)
    assert plan.end[3] == pytest.approx(goal)


def test_a_goal_of_a_frame_is_planned_to_at_the_nearest_turn(robot: Robot) -> None:
    goal = nmm.Task(nmm.Posture("theta", "j1"), [0.0, -3.1])
    plan = nmm.plan(robot, {"j1": 3.1}, goal, limits=LIMITS)
    assert way(plan(np.linspace(0.0, plan.duration, 300))[0][:, 3]) < 0.2


def test_a_plan_is_followed_from_another_turn(robot: Robot) -> None:
    plan = nmm.plan(robot, robot.rest, {"x": 0, "y": 0, "theta": 0, "j1": 1.0, "j2": 0.5}, limits=LIMITS)
    controller = nmm.Controller(robot, plan.reference(), nmm.ProjectedGradient())
    start = {"j1": TURN + 0.05, "theta": -TURN}
    run = nmm.simulate(controller, start, plan.duration / 0.8 + 3.0, 0.02)
    assert run.q[-1] - plan.end == pytest.approx([0, 0, -TURN, TURN, 0], abs=2e-3)
    assert "left_plan" not in codes(run)


@pytest.mark.parametrize("name", ["j1", "theta"])
@pytest.mark.parametrize("order", [1, 2])
def test_a_posture_is_reached_the_short_way_or_by_the_turns_that_count(
    robot: Robot, name: str, order: int
) -> None:
    column = robot.coordinate(name)
    for turns, end in ((False, TURN - 3.1), (True, -3.1)):
        task = nmm.Task(nmm.Posture(name, turns=turns), [-3.1], gain=2.0)
        controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), order=order)
        run = nmm.simulate(controller, {name: 3.1}, 12.0, 0.02)
        assert run.complete
        assert run.q[-1, column] == pytest.approx(end, abs=1e-5)


def test_a_posture_of_a_joint_with_limits_of_ones_own_does_not_cross_them(robot: Robot) -> None:
    limits = nmm.Limits(position={"j1": [-3.12, 3.12]})
    task = nmm.Task(nmm.Posture("j1"), [-3.1], gain=2.0)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
    run = nmm.simulate(controller, {"j1": 3.1}, 12.0, 0.01)
    assert run.complete
    assert way(run.q[:, 3]) == pytest.approx(6.2, abs=1e-3)


def test_scenarios_say_whether_turns_count() -> None:
    task = {"kind": "posture", "of": ["theta", "q1"], "reference": {"kind": "constant", "value": [7.0, 0.5]}}
    for turns, end in ((True, 7.0), (False, 7.0 - TURN)):
        more = {"duration": 12, "q0.theta": 0.0, "resolver": {"kind": "pg"}}
        settings = {"task": [{**task, "turns": turns}], **more}
        run = nmm.Scenario.load("unicycle_2r_position", settings).run()
        assert run.q[-1, 2] == pytest.approx(end, abs=1e-3)


@pytest.mark.parametrize("name", ["j1", "theta"])
def test_a_loop_takes_measurements_that_wrap(robot: Robot, name: str) -> None:
    column = robot.coordinate(name)
    task = nmm.Task(nmm.Posture(name), nmm.Line([2.9], [3.6], 2.0), gain=2.0)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=LIMITS, dt=0.01)
    loop, q = nmm.Loop(controller, period=0.01), robot.q({name: 2.9})
    for k in range(300):
        q = q + robot.S(q) @ loop.step(0.01 * k, wrapped(q, column), 0.01 * k) * 0.01
    assert (loop.state.value, loop.refused) == ("running", {})
    assert q[column] == pytest.approx(3.6, abs=0.02)


def test_what_looks_ahead_turns_the_short_way(tmp_path: Path) -> None:
    path = written(tmp_path, {"j1": ("continuous", FREE), "j2": ("revolute", RANGE)})
    robot = nmm.load(path, platform="omnidirectional")
    horizon = nmm.Horizon(robot, {"x": 0.3, "y": 0, "theta": -3.0, "j1": -3.1, "j2": 0.4}, limits=LIMITS)
    run = horizon.run({"theta": 3.0, "j1": 3.1}, 8.0, nmm.Goal(0.01, 0.01))
    assert run.complete
    assert way(run.q[:, 2]) < 0.5
    assert way(run.q[:, 3]) < 0.5


def test_a_retreat_goes_home_the_short_way(robot: Robot) -> None:
    task = nmm.Task(nmm.Position("j2_link", "xy"), [0.0, 0.1])
    retreat = nmm.Retreat(posture={"j1": -3.0})
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=LIMITS, dt=0.01, retreat=retreat)
    state = controller.solver.retreat_state
    assert state is not None
    q = robot.q({"j1": 3.0})
    controller(0.0, q)
    u = state.inputs(q, controller.solver.program.buffers.G, controller.solver.step_memory.problem)
    assert u[robot.input("j1")] > 0.0


def test_recordings_that_wrap_are_compared_by_the_short_way(robot: Robot, tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    task = nmm.Task(nmm.Posture("theta", "j1"), nmm.Line([2.0, 2.0], [5.0, 5.0], 2.0), gain=5.0)
    run = nmm.simulate(nmm.Controller(robot, task, nmm.ProjectedGradient()), {"theta": 2.0, "j1": 2.0}, 2.0)
    seen = replace(run, q=wrapped(run.q, 3))
    assert way(seen.q[:, 3]) > 6.0
    bag = nmm.read_bag(seen.save_mcap(tmp_path / "run.mcap"), robot)
    np.testing.assert_allclose(bag.q[:, 3], run.q[:, 3], rtol=0.0, atol=1e-9)
    assert difference(run, bag)["differences"]["j1"]["max"] < 1e-9
    shifted = replace(bag, q=bag.q + TURN * (np.array(robot.q_names) == "j1"))
    assert difference(run, shifted)["differences"]["j1"]["max"] < 1e-9
