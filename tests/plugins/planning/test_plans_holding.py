"""Plans along which a hand is held: by Pinocchio it stays, by Coal nothing touches, and limits are kept."""

import json

import numpy as np
import pinocchio as pin
import pytest
from places import UR5
from test_plans import LIMITS, check

import nmm
from nmm.cli.exit_status import status_of

HAND = "ur5_ee_link"
#: A hand before and above the platform, where the arm has room to every side.
AT_WORK = {
    "ur5_shoulder_lift_joint": -1.2,
    "ur5_elbow_joint": 1.5,
    "ur5_wrist_1_joint": -1.5,
    "ur5_wrist_2_joint": -1.2,
}
ASIDE = {"x": 0.2, "y": 0.15, "theta": 0.6}


@pytest.fixture(scope="module")
def ur5_unicycle():
    return nmm.mount(nmm.load("differential_base", platform="unicycle"), nmm.load(UR5), prefix="ur5_")


def drift(plan, frame, samples=600):
    """How far a frame is from where it was at the start, at most: m and rad."""
    model = plan.robot.model
    data, number = model.createData(), model.getFrameId(frame)
    placed = []
    for q in plan(np.linspace(0.0, plan.duration, samples))[0]:
        pin.framesForwardKinematics(model, data, q)
        placed.append(pin.SE3(data.oMf[number]))
    moved = [pin.log6(placed[0].inverse() * one) for one in placed]
    far = [np.linalg.norm(one.translation - placed[0].translation) for one in placed]
    return max(far), max(float(np.linalg.norm(one.angular)) for one in moved)


def check_held(plan, pose=ASIDE):
    check(plan)
    assert max(drift(plan, HAND)) < 1e-4
    assert np.allclose(plan.end[:2], (pose["x"], pose["y"]), atol=1e-9)
    assert np.isclose(np.cos(plan.end[2] - pose["theta"]), 1.0)


def test_a_hand_stays_while_a_platform_that_rolls_is_brought_round_a_post(ur5_unicycle):
    straight = nmm.plan(ur5_unicycle, AT_WORK, ASIDE, limits=LIMITS, hold=HAND)
    check_held(straight)
    assert np.abs(straight.end[3:] - straight.corners[0, 3:]).max() > 0.1  # for which its arm has to move
    post = nmm.Obstacle(nmm.Cylinder(0.05, 0.4), [-0.55, -0.05, 0.2], name="post")
    plan = nmm.plan(ur5_unicycle, AT_WORK, ASIDE, [post], limits=LIMITS, hold=HAND)
    check_held(plan)
    assert plan.motions > 1  # the straight way is blocked
    assert not plan.smooth
    with pytest.raises(nmm.InputError):
        nmm.replan(plan, plan.corners[0])


@pytest.mark.parametrize("base", ["car_base", "omni_base"])
def test_a_hand_stays_while_other_platforms_are_brought_to_a_pose(base):
    robot = nmm.mount(nmm.load(base), nmm.load(UR5), prefix="ur5_")
    plan = nmm.plan(robot, AT_WORK, ASIDE, limits=LIMITS, hold=HAND)
    check_held(plan)
    within = LIMITS.on(robot)
    t = np.linspace(0.0, plan.duration, 400)
    used = np.abs(plan(t)[1]) / within.inputs[:, 1]
    assert used.max() > 0.5  # it does not creep


def test_poses_of_the_platform_are_passed_on_the_way(ur5_unicycle):
    on_the_way = {"x": -0.1, "y": 0.1, "theta": 0.2}
    plan = nmm.plan(
        ur5_unicycle, AT_WORK, [ASIDE, on_the_way], through=[on_the_way], limits=LIMITS, hold=HAND
    )
    assert np.linalg.norm(plan.corners[:, :2] - [-0.1, 0.1], axis=1).min() < 1e-9
    assert max(drift(plan, HAND)) < 1e-4
    assert nmm.plan(ur5_unicycle, AT_WORK, {"x": 0, "y": 0, "theta": 0}, hold=HAND).duration == 0.0


def test_a_position_is_held_by_a_task_and_followed(robot_3r):
    q = robot_3r.q({"q1": 0.5, "q2": 0.5, "q3": 0.4})
    place = nmm.evaluate(nmm.Position("ee"), 0.0, nmm.Configuration(robot_3r, q)).value
    plan = nmm.plan(robot_3r, q, ASIDE, limits=LIMITS, hold=nmm.Task(nmm.Position("ee"), place))
    check(plan)
    metres, radians = drift(plan, "ee")
    assert metres < 1e-4
    assert radians > 0.1
    controller = nmm.Controller(robot_3r, plan.reference(), nmm.ProjectedGradient())
    run = nmm.simulate(controller, q, plan.duration / 0.8, 0.01)
    assert np.linalg.norm(run.path - place, axis=1).max() < 2e-4


def test_the_arm_has_the_torques_asked_for(ur5_unicycle):
    given = ur5_unicycle, AT_WORK, ASIDE
    fast = nmm.plan(*given, limits=LIMITS, hold=HAND)
    loaded = nmm.plan(*given, limits=LIMITS, hold=HAND, effort={HAND: 1.0})
    assert loaded.duration >= fast.duration - 1e-9
    assert max(drift(loaded, HAND)) < 1e-4
    aside = nmm.plan(
        *given, limits=LIMITS, hold=HAND, margin=0.05
    )  # as a controller that follows it asks for
    assert max(drift(aside, HAND)) < 1e-4


@pytest.mark.parametrize(
    ("goal", "hold", "where"),
    [
        (ASIDE, 3, "plan: hold"),
        (ASIDE, nmm.Task(nmm.Position(HAND), [1.0, 1.0, 1.0]), "plan: hold"),
        (ASIDE | AT_WORK, HAND, "plan: goal"),
        ({"x": 0.2}, HAND, "plan: goal"),
        (ASIDE, "base_link", "plan: hold"),
    ],
)
def test_what_cannot_be_held_is_refused(ur5_unicycle, goal, hold, where):
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(ur5_unicycle, AT_WORK, goal, hold=hold)
    assert found.value.where == where


def test_what_does_not_go_with_holding_is_refused(ur5_unicycle, robot_3r):
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(ur5_unicycle, AT_WORK, ASIDE, hold=HAND, smooth=True)
    assert "smooth" in found.value.what
    with pytest.raises(nmm.InputError) as found:  # three joints for a pose
        nmm.plan(robot_3r, robot_3r.rest, ASIDE, hold="ee")
    assert "3 of the 5" in found.value.what


def test_a_goal_out_of_the_arms_reach_and_one_without_a_way_say_so(ur5_unicycle):
    far = {"x": -2.0, "y": 0.0, "theta": 0.0}
    with pytest.raises(nmm.RunError) as found:
        nmm.plan(ur5_unicycle, AT_WORK, far, hold=HAND)
    assert HAND in str(found.value)
    assert "out of reach" in str(found.value)
    around = [
        nmm.Obstacle(nmm.Box([0.1, 2.0, 0.3]), [-0.75, 0.0, 0.15], name="behind"),
        nmm.Obstacle(nmm.Box([0.1, 2.0, 0.3]), [0.75, 0.0, 0.15], name="before"),
    ]
    with pytest.raises(nmm.RunError) as found:
        nmm.plan(ur5_unicycle, AT_WORK, {"x": 0.0, "y": 0.0, "theta": np.pi}, around, hold=HAND, seconds=0.3)
    assert "reach" in str(found.value)


@pytest.mark.thorough
def test_the_command_line_holds_a_frame(tmp_path, capsys):
    settings = ("--hold", HAND, "--to", "x=0.1,y=0.1,theta=0.3", "--out", str(tmp_path / "out"), "--json")
    assert status_of(("plan", "ur5_unicycle_pose", *settings)) == 0
    run = nmm.Trajectory.load(json.loads(capsys.readouterr().out)["folder"])
    assert nmm.Scenario.load(tmp_path / "out" / "scenario.yaml").parts.plan.hold == HAND
    assert np.allclose(run.q[-1, :3], [0.1, 0.1, 0.3])
    assert np.ptp(run.path, axis=0).max() < 2e-4
