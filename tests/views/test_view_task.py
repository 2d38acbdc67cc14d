"""`nmm view --task` without a browser: what the program answers about where the sliders are."""

from __future__ import annotations

import json
import math
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from command_line import page_of, refused
from gripping import folding
from live_pages import LivePage
from places import UR5
from ports import MOST, free_port, listening, wait_for

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot
from nmm.plugins.live.viewed_task import ViewedTask
from nmm.plugins.live.viewer import asked_for
from nmm.scenario.short_task import short_task
from nmm.views.playback import view


@pytest.fixture(scope="module", params=["unicycle_3r", "car with an arm", "folding", "fixed UR5"])
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    if request.param == "car with an arm":
        return nmm.mount("car_base", "small_arm")
    if request.param == "folding":
        return folding()
    if request.param == "fixed UR5":
        return nmm.load(UR5, platform="fixed")
    return nmm.load(request.param)


def end_of(robot: Robot) -> str:
    return str(short_task("position", robot).frame)  # type: ignore[union-attr]  # of a robot with an arm


def frame_jacobian(robot: Robot, frame: str, q: np.ndarray) -> np.ndarray:
    """Pinocchio's, (6, m): through S, as the wheels admit it, with what follows carried along."""
    model = robot.model
    J = pin.computeFrameJacobian(
        model, model.createData(), q, robot.frame_id(frame), pin.LOCAL_WORLD_ALIGNED
    )  # fmt: skip
    return np.asarray(J) @ robot.S(q)


def random_q(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    lower, upper = np.clip(robot.q_limits, -np.pi, np.pi).T
    return np.asarray(robot.following.placed(rng.uniform(lower, upper)[np.newaxis])[0])


@contextmanager
def viewed(robot: Robot, *tasks: Any) -> Iterator[str]:
    stop, port = threading.Event(), free_port()
    options = {"task": tasks, "port": port, "open_browser": False, "stop": stop}
    viewer = threading.Thread(target=view, args=(robot,), kwargs=options)
    viewer.start()
    wait_for(lambda: port in listening() or not viewer.is_alive())
    try:
        yield f"http://127.0.0.1:{port}/"
    finally:
        stop.set()
        viewer.join(timeout=MOST)
        assert port not in listening()


def asks(page: LivePage, q: Sequence[float], number: int) -> dict[str, Any]:
    page.says(json.dumps({"type": "at", "number": number, "q": list(q)}))
    wait_for(lambda: any(one["number"] == number for one in page.of("task")))
    return next(one for one in page.of("task") if one["number"] == number)


def test_the_numbers_are_those_of_pinocchios_jacobian(robot: Robot) -> None:
    """At random sliders, through the WebSocket, by NumPy's SVD: of the whole robot and of its arm."""
    rng, frame = np.random.default_rng(3), end_of(robot)
    task = short_task("position", robot)
    rows = [row.name.rpartition(".")[2] for row in task.rows(robot)]  # type: ignore[union-attr]
    axes = ["xyz".index(row) for row in rows]
    arm = [i for i, name in enumerate(robot.u_names) if i >= robot.platform.p]
    with viewed(robot, task) as url, LivePage(url) as page:
        for number in range(1, 6):
            q = random_q(robot, rng)
            told = asks(page, q, number)
            J = frame_jacobian(robot, frame, q)[axes]
            parts = {part["name"]: part for part in told["parts"]}
            assert set(parts) == ({"robot", "arm"} if robot.platform.p else {"robot"})
            for name, part in parts.items():
                own = J if name == "robot" else J[:, arm]
                values = np.zeros(len(own))  # fewer columns than rows: the last are 0
                values[: own.shape[1]] = np.linalg.svd(own, compute_uv=False)
                assert part["rank"] == np.linalg.matrix_rank(own, tol=1e-9)
                assert part["sigma_min"] == pytest.approx(values[-1], rel=1e-7, abs=1e-10)
                assert part["sigma_max"] == pytest.approx(values[0], rel=1e-7)
                condition = pytest.approx(values[0] / max(values[-1], 1e-12), rel=1e-6)
                assert part["condition"] == (condition if part["rank"] == len(own) else None)
                volume = math.sqrt(max(np.linalg.det(own @ own.T), 0.0))
                assert part["manipulability"] == pytest.approx(volume, rel=1e-6, abs=1e-7)  # a root


def test_the_ellipsoid_is_the_image_of_the_unit_ball(robot: Robot) -> None:
    """As drawn: its matrix times its transpose is J Jᵀ to scale, about the frame's origin."""
    rng, frame = np.random.default_rng(5), end_of(robot)
    shown = ViewedTask(robot, [nmm.Position(frame)], robot.rest)
    for _ in range(5):
        q = random_q(robot, rng)
        J = frame_jacobian(robot, frame, q)[:3]
        told = shown.answer(q)
        nodes = {path.rsplit("/", 1)[1]: np.reshape(matrix, (4, 4)).T for path, matrix in told["ellipsoids"]}
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, q)
        for name, node in nodes.items():
            own = J if name == "robot" else J[:, robot.platform.p :]
            np.testing.assert_allclose(node[:3, 3], data.oMf[robot.frame_id(frame)].translation, atol=1e-9)
            half = node[:3, :3]
            assert np.linalg.det(half) > 0.0
            # A flat one keeps a least thickness, which one sees.
            thin = 0.012 * shown._scale * np.linalg.svd(J, compute_uv=False)[0]
            np.testing.assert_allclose(half @ half.T, shown._scale**2 * own @ own.T, atol=1.1 * thin**2)


def planar_arm(folder: Path) -> Robot:
    """Two links of 0.5 m in a horizontal plane, on a base that stands."""
    link = '<link name="{}"/>'
    joint = (
        '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="{} 0 0"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
    )
    parts = [link.format(name) for name in ("base", "upper", "fore", "hand")]
    parts += [
        joint.format("q1", "revolute", "base", "upper", 0),
        joint.format("q2", "revolute", "upper", "fore", 0.5),
        joint.format("tip", "fixed", "fore", "hand", 0.5),
    ]
    file = folder / "planar.urdf"
    file.write_text(f'<robot name="planar">{"".join(parts)}</robot>', encoding="utf-8")
    return nmm.load(file, platform="fixed")


def test_a_stretched_planar_arm_has_lost_the_radial_direction(tmp_path: Path) -> None:
    robot = planar_arm(tmp_path)
    shown = ViewedTask(robot, [nmm.Position("hand", "xy")], robot.q())
    for angle in (0.0, 0.4, -2.0):
        radial = np.array([math.cos(angle), math.sin(angle), 0.0])
        for bend, state in ((0.0, "lost"), (np.pi, "lost"), (0.02, "near"), (1.2, "fine")):
            told = shown.answer(robot.q([angle, bend]))
            assert told["state"] == state
            if state == "fine":
                assert told["words"] == told["arrows"] == []
                continue
            (arrow,) = told["arrows"]
            assert arrow["kind"] == "moves"
            assert abs(np.dot(arrow["along"], radial)) == pytest.approx(1.0, abs=2e-3 if bend < 3.0 else 1e-9)
            assert told["parts"][0]["rank"] == (1 if state == "lost" else 2)
    assert shown.answer(robot.q())["words"] == ["motion of hand along x"]
    assert shown.answer(robot.q())["parts"][0]["condition"] is None


def test_what_wheels_cannot_do_is_lost() -> None:
    """A unicycle's own reference point goes forwards, not sideways; omnidirectional wheels take it there."""
    for source, lost in (("differential_base", ["motion of base_link along y"]), ("omni_base", [])):
        robot = nmm.load(source)
        frame = next(name for name in robot.frames if name.startswith("base"))
        shown = ViewedTask(robot, [nmm.Position(frame, "xy")], robot.rest)
        told = shown.answer(robot.rest)
        assert [words.replace(frame, "base_link") for words in told["words"]] == lost
        turned = shown.answer(robot.q({"theta": np.pi / 2}))
        assert [words.replace(frame, "base_link") for words in turned["words"]] == [
            words.replace("along y", "along x") for words in lost
        ]


def test_turns_have_rings_and_tasks_without_a_frame_numbers_alone() -> None:
    robot = nmm.load(UR5, platform="fixed")
    frame = end_of(robot)
    shown = ViewedTask(robot, [nmm.Pose(frame)], robot.rest)
    told = shown.answer(robot.q({"elbow_joint": 1.0, "shoulder_lift_joint": -0.7}))  # the wrist is stretched
    assert told["state"] == "lost"
    J = frame_jacobian(robot, frame, robot.q({"elbow_joint": 1.0, "shoulder_lift_joint": -0.7}))
    U = np.linalg.svd(J)[0][:, -1]
    for arrow in told["arrows"]:
        part = U[:3] if arrow["kind"] == "moves" else U[3:]
        assert abs(np.dot(arrow["along"], part)) == pytest.approx(np.linalg.norm(part), rel=1e-6)
    assert {arrow["kind"] for arrow in told["arrows"]} <= {"moves", "turns"}
    assert any(arrow["kind"] == "turns" for arrow in told["arrows"])
    mobile = nmm.load("unicycle_3r")
    told = ViewedTask(mobile, [nmm.LinearCoordinates("q1", "q2")], mobile.rest).answer(mobile.rest)
    assert told["ellipsoids"] == told["arrows"] == []
    assert [part["rank"] for part in told["parts"]] == [2, 2]


def test_where_there_is_no_J_that_is_said() -> None:
    """A root of what is below zero."""
    robot = nmm.load("unicycle_3r")

    def root(here: nmm.Configuration) -> float:
        return math.sqrt(here.q[4]) if here.q[4] >= 0.0 else math.nan

    task = nmm.CallableFunction(root, ["root"])
    there, nowhere = robot.q({"q2": 1.0}), robot.q({"q2": -1.0})
    shown = ViewedTask(robot, [task], there)
    told = shown.answer(nowhere)
    assert told["problem"]
    assert told["parts"] == told["ellipsoids"] == told["arrows"] == []
    assert shown.answer(there)["problem"] == ""


HOSTILE = [
    "", "null", "[]", "{", b"\xff", "[" * 3000, '{"type":"at"}', '{"type":"at","number":1,"q":[]}',
    '{"type":"at","number":1,"q":[0,0,0,0,0]}', '{"type":"at","number":1,"q":[0,0,0,0,0,NaN]}',
    '{"type":"at","number":1,"q":[0,0,0,0,0,Infinity]}', '{"type":"at","number":1,"q":[0,0,0,0,0,1e7]}',
    '{"type":"at","number":1,"q":[0,0,0,0,0,"0"]}', '{"type":"at","number":1,"q":[0,0,0,0,0,true]}',
    '{"type":"at","number":-1,"q":[0,0,0,0,0,0]}', '{"type":"at","number":1.5,"q":[0,0,0,0,0,0]}',
    '{"type":"at","number":true,"q":[0,0,0,0,0,0]}', '{"type":"at","number":1,"q":{"x":0}}',
    '{"type":"at","number":1,"q":[0,0,0,0,0,0],"task":"pose"}',
    '{"type":"load","number":1,"q":[0,0,0,0,0,0]}', '{"type":["at"],"number":1,"q":[0,0,0,0,0,0]}',
    '{"type":"at","number":%s,"q":[0,0,0,0,0,0]}' % ("9" * 400),
]  # fmt: skip


def test_a_hostile_message_changes_nothing() -> None:
    robot = nmm.load("unicycle_3r")
    shown = ViewedTask(robot, [nmm.Position("ee")], robot.rest)
    visitor = shown.visitor()
    for text in HOSTILE:
        assert not visitor.heard(text)
        with pytest.raises(InputError, match="message"):
            shown.asked(text)
    assert visitor.latest() == ""
    with viewed(robot, nmm.Position("ee")) as url, LivePage(url) as page:
        for text in HOSTILE:
            if isinstance(text, str):
                page.says(text)
        assert asks(page, robot.rest, 7)["state"] == "lost"
        assert [one["number"] for one in page.of("task")] == [7]


def test_pages_are_answered_each_for_itself() -> None:
    """The last of many questions counts."""
    robot = nmm.load("unicycle_3r")
    rng = np.random.default_rng(1)
    with viewed(robot, nmm.Position("ee")) as url, LivePage(url) as one, LivePage(url) as other:
        first, second = random_q(robot, rng), random_q(robot, rng)
        for number in range(1, 30):
            one.says(json.dumps({"type": "at", "number": number, "q": first.tolist()}))
        told = asks(one, first, 30)
        assert asks(other, second, 1)["parts"] != told["parts"]
        assert [answer["number"] for answer in one.of("task")][-1] == 30
        assert [answer["number"] for answer in other.of("task")] == [1]


# the command


def test_the_command_takes_a_strangers_robot_and_where_it_is(tmp_path: Path) -> None:
    planar_arm(tmp_path)
    options = ("--platform", "unicycle", "--task", "position:hand:xy", "--at", "theta=pi/2")
    running, url = page_of(tmp_path, "view", "planar.urdf", *options)
    with LivePage(url) as page:
        lines = [json.loads(line) for line in page.hello]
        joints = next(line for line in lines if line["type"] == "joints")
        values = {one["name"]: one["value"] for one in joints["coordinates"]}
        assert values["theta"] == pytest.approx(np.pi / 2)
        told = next(line for line in lines if line["type"] == "task")
        assert told["parts"][0]["rank"] == 2
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=MOST)
    assert (running.returncode, err) == (0, "")


def test_bad_input_is_a_line(capfd: pytest.CaptureFixture[str]) -> None:
    for arguments, words in (
        (["unicycle_2r", "--task", "pose"], "at most 4"),
        (["unicycle_2r", "--task", "position:nowhere"], "nowhere"),
        (["unicycle_2r", "--task", "nothing"], "nothing"),
        (["unicycle_2r", "--at", "q9=1"], "q9"),
        (["unicycle_2r", "--lock", "q1=1", "--at", "q1=1"], "locked"),
        (["small_arm", "--at", "q2=9"], "outside its limits"),
        (["nothing_like_it"], "unknown robot or scenario 'nothing_like_it'"),
        (["unicycle_2r_position", "--platform", "car"], "--platform: of a robot's file"),
        (["unicycle_2r_position", "--arm", "small_arm"], "is a scenario, which has one"),
        (["car_base", "--arm", "small_arm", "--at", "a", "--at", "b"], "one frame that carries the arm"),
        (["car_base", "--arm", "small_arm", "--at", "nowhere"], "nowhere"),
    ):
        done = refused(capfd, "view", *arguments, "--no-open")
        assert done.status == 2, (done.out, done.err)
        (line,) = done.err.splitlines()
        assert words in line


def of(page: LivePage, kind: str) -> list[dict[str, Any]]:
    """The commands of a kind that a page got at first."""
    return [line for line in map(json.loads, page.hello) if line["type"] == kind]


def test_a_scenario_is_shown_where_it_starts_with_what_it_asks_for(tmp_path: Path) -> None:
    scenario = nmm.Scenario.load("unicycle_3r_crossing", {"q0.q1": 0.25})
    running, url = page_of(tmp_path, "view", "unicycle_3r_crossing", "--set", "q0.q1=0.25")
    with LivePage(url) as page:
        (joints,), (told,) = of(page, "joints"), of(page, "task")
        (obstacle,), targets = of(page, "obstacle"), of(page, "target")
    values = [one["value"] for one in joints["coordinates"]]
    robot = scenario.robot()
    np.testing.assert_array_equal(values, robot.q(scenario.parts.q0))
    assert 0.25 in values
    assert told["parts"][0]["rank"] == len(scenario.controller().rows)
    assert len(targets) == 1
    assert obstacle["name"] == scenario.obstacles(robot)[0].name
    running.send_signal(signal.SIGINT)
    assert running.wait(timeout=MOST) == 0


def test_the_desired_path_is_that_of_the_run() -> None:
    """Before it runs; a task that holds a point has a target, one that comes and goes neither."""
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 2})
    run = scenario.run()
    asked = asked_for(scenario, scenario.robot())
    assert run.desired is not None
    assert asked.desired is not None
    way = np.linalg.norm(np.diff(run.desired, axis=0), axis=1).sum()
    nearest = np.linalg.norm(run.desired[:, None] - asked.desired, axis=2).min(axis=1)
    assert nearest.max() < way / 400
    for end in (0, -1):
        np.testing.assert_allclose(asked.desired[end], run.desired[end], atol=1e-9)
    np.testing.assert_array_equal(asked.q[0], run.q[0])
    held = nmm.Scenario.load("unicycle_2r_position", {"task.0.reference": [1.0, 2.0]})
    standing = asked_for(held, held.robot())
    assert standing.desired is None
    np.testing.assert_allclose(np.asarray(standing.target)[:2], [1.0, 2.0])
    timed = nmm.Scenario.load("unicycle_3r_sequence")
    assert asked_for(timed, timed.robot()).desired is None


def test_an_arm_is_mounted_as_for_init(tmp_path: Path) -> None:
    arguments = ("car_base", "--arm", "small_arm", "--at", "arm_mount", "--at", "q1=0.3")
    running, url = page_of(tmp_path, "view", *arguments)
    with LivePage(url) as page:
        (joints,) = of(page, "joints")
    values = {one["name"]: one["value"] for one in joints["coordinates"]}
    assert [*values] == [*nmm.mount("car_base", "small_arm").q_names]
    assert values["q1"] == 0.3
    running.send_signal(signal.SIGINT)
    assert running.wait(timeout=MOST) == 0
