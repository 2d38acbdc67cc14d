"""What a user sees of a camera: points in the scene, its picture, and both in a run's folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from findings import refused
from playback_browser import UPRIGHT, WALK, Window
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from ports import MOST, served

import nmm
from nmm.control.step.quantities import QUANTITIES
from nmm.plugins.live.driving import ScenarioSetup, drive
from nmm.plugins.live.driving.driven import Driven
from nmm.plugins.live.driving.things import Things
from nmm.plugins.live.running import Growing
from nmm.views.playback import write_html

PIXELS = [525.0, 500.0, 320.0, 240.0]


@pytest.fixture(scope="module")
def run() -> nmm.Trajectory:
    """A ball that goes round is followed, from beside the picture's middle."""
    return nmm.Scenario.load("pan_tilt_follow", {"duration": 2, "dt": 0.02}).run()


def ball(t: np.ndarray) -> np.ndarray:
    return np.column_stack([1.5 + np.cos(0.3 * t), np.sin(0.3 * t), np.full_like(t, 0.4)])


def test_a_run_has_what_its_camera_sees(run: nmm.Trajectory) -> None:
    assert run.seen is not None
    np.testing.assert_allclose(run.seen[:, 0], ball(run.t), atol=1e-12)
    (camera,) = run.motion().cameras
    assert camera.frame == "camera_optical_frame"
    assert not camera.bounded
    # Two tasks look at the ball, and it is one.
    assert camera.points.shape[1] == 1
    # Placed by Pinocchio, it is where the task's own kernel sees it.
    np.testing.assert_allclose(camera.picture(run.robot, run.q)[:, 0], run.r[:, :2], atol=1e-12)
    np.testing.assert_allclose(camera.goals[:, 0], run.r_d[:, :2])


def test_a_folder_has_it_and_older_ones_have_none(run: nmm.Trajectory, tmp_path: Path) -> None:
    folder = run.save(tmp_path / "run", figures=False)
    again = nmm.Trajectory.load(folder)
    assert again.cameras == run.cameras
    assert np.array_equal(again.seen, run.seen)
    summary = json.loads((folder / "summary.json").read_text("utf-8"))
    goal = {"point": 0, "x": 7, "y": 1, "intrinsics": [1, 1, 0, 0]}
    for key, value, where in (("points", [1], "cameras.0"), ("goals", [goal], "cameras.0.goals")):
        damaged = {**summary, "cameras": [{**summary["cameras"][0], key: value}]}
        (folder / "summary.json").write_text(json.dumps(damaged), "utf-8")
        with refused(f"{folder / 'summary.json'}: {where}"):
            nmm.Trajectory.load(folder)
    del summary["cameras"]
    (folder / "summary.json").write_text(json.dumps(summary), "utf-8")
    with np.load(folder / "trajectory.npz") as file:
        kept = {name: file[name] for name in file.files if name != "seen"}
    np.savez(folder / "trajectory.npz", **kept)
    older = nmm.Trajectory.load(folder)
    assert older.seen is None
    assert older.motion().cameras == ()
    assert QUANTITIES["seen"].since > 8


def test_limits_are_the_border_and_rows_in_pixels_have_their_place() -> None:
    robot = nmm.load("unicycle_pan_tilt")
    here = [2.0, 0.3, 0.6]
    seen = nmm.ImagePoints([here, [2.0, -0.2, 0.6]], intrinsics=PIXELS)
    edge = nmm.Bound(nmm.ImagePoints([here], intrinsics=PIXELS), [20.0, 40.0], [620.0, np.inf])
    task = nmm.Task(seen, [300.0, 200.0, 340.0, 210.0])
    controller = nmm.Controller(
        robot, task, nmm.DampedLeastSquares(), limits=nmm.Limits(bounds=edge), dt=0.02
    )
    (camera,) = nmm.simulate(controller, robot.rest, 0.1, 0.02).motion().cameras
    assert camera.points.shape[1] == 2
    fx, fy, cx, cy = camera.intrinsics
    assert [fx, fy, cx, cy] == PIXELS
    x, y = camera.goals[0].T
    np.testing.assert_allclose([fx * x + cx, fy * y + cy], [[300.0, 340.0], [200.0, 210.0]])
    left, top, right, bottom = camera.border
    # Below there is no limit: the principal point is taken for the picture's middle.
    expected = [20.0, 40.0, 620.0, 2.0 * cy]
    np.testing.assert_allclose([fx * left + cx, fy * top + cy, fx * right + cx, fy * bottom + cy], expected)
    assert camera.bounded


def test_of_tasks_that_come_and_go_goals_do() -> None:
    robot = nmm.load("unicycle_pan_tilt")
    turn = nmm.Task(nmm.Posture("pan"), [0.3], name="turn", when=nmm.Between(end=0.1))
    look = nmm.Task(nmm.ImagePoints([[2.0, 0.3, 0.6]]), [0.1, 0.0], name="look", when=nmm.Between(0.1))
    controller = nmm.SequencedController(robot, [turn, look], nmm.DampedLeastSquares(), dt=0.02)
    run = nmm.simulate(controller, robot.rest, 0.2, 0.02)
    (camera,) = run.motion().cameras
    assert np.array_equal(np.isnan(camera.goals[:, 0, 0]), run.t < 0.1 - 1e-9)
    assert len(camera.points) == len(run)


@pytest.mark.browser
def test_the_page_shows_the_ball_where_it_is_and_where_it_is_seen(
    run: nmm.Trajectory, window: Window, tmp_path: Path
) -> None:
    page = window.open(write_html([run], tmp_path / "page.html").as_uri())
    for k in (0, 40, len(run) - 1):
        page.evaluate(f"nmm.seek({run.t[k]})")
        nodes = page.evaluate(WALK)
        drawn = UPRIGHT.T @ np.reshape(nodes["/nmm/motion 0/seen 0 0"], (4, 4)).T
        np.testing.assert_allclose(drawn[:3, 3], ball(run.t[k : k + 1])[0], atol=1e-3)
        (lens,) = (path for path in nodes if path.endswith("/camera 0"))
        expected = nmm.Configuration(run.robot, run.q[k]).placement("camera_optical_frame").homogeneous
        np.testing.assert_allclose(UPRIGHT.T @ np.reshape(nodes[lens], (4, 4)).T, expected, atol=2e-3)
        # The colour of the dot is where the task says that it is seen, and nowhere else on that line later.
        x, y = run.r[k, :2].tolist()
        assert page.evaluate(DOT, [x, y]), (k, x, y)
    assert page.inner_text("#sights p") == "in the picture"
    page.click("#unsee")
    assert not page.is_visible("#sights")
    page.keyboard.press("i")
    assert page.is_visible("#sights")
    page.set_viewport_size({"width": 420, "height": 800})
    card, heading = (page.locator(one).bounding_box() for one in ("#sights", "#heading"))
    assert card is not None
    assert heading is not None
    assert heading["x"] + heading["width"] <= card["x"]
    assert card["x"] + card["width"] <= 420


#: Whether the dot is at normalised coordinates of the picture: its colour in the pixels around there.
DOT = """([x, y]) => {
  const { canvas, range: [x0, y0, x1] } = nmm.sights.figures[0];
  const scale = (canvas.clientWidth - 37) / (x1 - x0);
  const [left, top] = [30 + scale * (x - x0), 6 + scale * (y - y0)];
  const { data } = canvas.getContext("2d").getImageData(left - 2, top - 2, 4, 4);
  const wanted = nmm.sights.all[0].color.map((c) => Math.round(255 * c));
  return data.every((value, i) => i % 4 === 3 || Math.abs(value - wanted[i % 4]) <= 12);
}"""


@pytest.mark.browser
def test_what_leaves_the_picture_is_told_by_its_number(
    run: nmm.Trajectory, window: Window, tmp_path: Path
) -> None:
    motion = run.motion()
    (camera,) = motion.cameras
    lens = nmm.Configuration(run.robot, run.q[0]).placement("camera_optical_frame")
    apart = [lens.act(np.array(place)) for place in ([0.0, 0.0, 1.0], [0.9, 0.0, 1.0], [0.0, 0.0, -1.0])]
    points = np.tile(np.array(apart), (len(run), 1, 1))
    told = replace(camera, points=points, goals=np.full((len(run), 3, 2), np.nan))
    page = window.open(write_html([replace(motion, cameras=(told,))], tmp_path / "page.html").as_uri())
    page.evaluate("nmm.player.seek(0)")
    assert page.inner_text("#sights p") == "outside the picture: 2; behind the camera: 3"


def test_figures_have_the_path_of_what_is_seen(run: nmm.Trajectory) -> None:
    """One that moves has a path, with its places at the instants drawn; one that stands has a mark."""
    figure = nmm.figures.stroboscopic(run, [0.0, 1.0])
    lines = {str(line.get_label()): line for line in figure.axes[0].get_lines()}
    np.testing.assert_allclose(lines["path of what is seen"].get_xydata(), ball(run.t)[:, :2])
    dots = [np.asarray(line.get_xydata()) for line in figure.axes[0].get_lines()]
    expected = ball(np.array([0.0, 1.0]))[:, :2]
    assert any(one.shape == expected.shape and np.allclose(one, expected) for one in dots)
    standing = np.tile(np.array([2.0, 0.3, 0.6]), (len(run), 1, 1))
    figure = nmm.figures.stroboscopic(replace(run, seen=standing), [0.0, 1.0])
    lines = {str(line.get_label()): line for line in figure.axes[0].get_lines()}
    assert "path of what is seen" not in lines
    np.testing.assert_allclose(lines["seen point"].get_xydata(), [[2.0, 0.3]])


def test_a_comparison_has_what_all_runs_see(run: nmm.Trajectory) -> None:
    elsewhere = replace(run, seen=None if run.seen is None else run.seen + 1.0)
    for other, shown in ((run, True), (elsewhere, False)):
        axes = nmm.figures.comparison([run, other]).axes[0]
        assert ("path of what is seen" in [line.get_label() for line in axes.get_lines()]) is shown


def test_a_live_page_gets_what_is_seen_as_it_is_recorded() -> None:
    scenario = nmm.Scenario.load("pan_tilt_follow")
    controller, q0 = scenario.controller(), scenario.parts.q0
    growing, recorders = Growing(controller), []
    run = nmm.simulate(controller, q0, 0.2, 0.02, watch=recorders.append)
    values = growing.values(recorders[0], growing.active_rows(), np.array([0, 4, 10]))[:, -7:]
    assert run.seen is not None
    whole = np.hstack([run.seen[:, 0], run.r[:, :2], run.r_d[:, :2]])
    np.testing.assert_allclose(values, whole[[0, 4, 10]], atol=1e-12)
    (camera,) = growing.cameras(run.q[0])
    assert camera.frame == "camera_optical_frame"


def test_a_ball_is_dragged_on_its_way_and_the_camera_follows_it() -> None:
    setup = ScenarioSetup(nmm.Scenario.load("pan_tilt_follow"))
    driven = Driven(setup)
    (thing,) = driven.things
    goals = driven.targets[0].signal.value
    where, far = thing.middle(0.0), np.array([0.3, 0.2, 0.1])
    driven.aim(len(driven.targets), where + far)
    np.testing.assert_allclose(driven.places[-1], where + far, atol=1e-12)
    made = driven.with_choice("resolver.kind", "pg")
    driven.use(made)  # a controller made afterwards sees the same ball
    for _ in range(round(8.0 / setup.dt)):
        assert driven.step()
    step = driven.look().step
    np.testing.assert_allclose(step.r, [*goals, np.log(1.5)], atol=2e-3)
    there = nmm.evaluate(
        nmm.Circle([1.5, 0.0, 0.4], 1.0, 0.3), driven.t, nmm.Configuration(setup.robot, driven.q)
    ).value
    np.testing.assert_allclose(driven.things[0].middle(driven.t), there + far, atol=1e-12)
    driven.restart()
    np.testing.assert_allclose(driven.places[-1], where, atol=1e-12)
    with refused("task"):
        driven.aim(len(driven.targets) + 1, where)


def test_corners_of_a_board_are_dragged_as_one_thing() -> None:
    robot = nmm.load("unicycle_pan_tilt")
    board = np.array([[2.0, y, z] for y in (-0.2, 0.2) for z in (0.5, 0.8)])
    far = np.array([0.5, 0.1, 0.0])
    edge = nmm.Limits(bounds=nmm.Bound(nmm.ImagePoints(list(board[:2])), -0.6, 0.6))
    task = nmm.Task(nmm.ImageMoments(list(board)), [0.0, 0.0, -1.5])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=edge, dt=0.01)
    things = Things(controller)
    (thing,) = things.all
    thing.drag(np.array([2.5, 0.1, 0.65]), 0.0)
    moved = things.seen_by(controller)
    apart = nmm.Controller(
        robot,
        nmm.Task(nmm.ImageMoments(list(board + far)), [0.0, 0.0, -1.5]),
        nmm.ProjectedGradient(),
    )
    found = moved.evaluate(0.0, robot.rest)
    np.testing.assert_allclose(found.r, apart.evaluate(0.0, robot.rest).r, atol=1e-12)
    bound = moved.given.limits.bounds[0].function
    here = nmm.Configuration(robot, robot.rest)
    seen = nmm.ImagePoints(list(board[:2] + far))
    values = [nmm.evaluate(one, 0.0, here).value for one in (bound, seen)]
    np.testing.assert_allclose(*values, atol=1e-12)


#: Where normalised coordinates of the picture are in the window, px.
SPOT = """([x, y]) => {
  const { canvas, range: [x0, y0, x1] } = nmm.sights.figures[0];
  const box = canvas.getBoundingClientRect();
  const scale = (box.width - 37) / (x1 - x0);
  return [box.left + 30 + scale * (x - x0), box.top + 6 + scale * (y - y0)];
}"""


@pytest.mark.browser
def test_a_goal_is_dragged_in_the_picture_and_the_ball_comes_there(window: Window) -> None:
    setup = ScenarioSetup(nmm.Scenario.load("pan_tilt_follow"))
    with served(drive, setup) as url:
        page = window.open(url)
        page.wait_for_function(
            "nmm.sights.figures.length && nmm.sights.figures[0].range && nmm.drive.time > 0"
        )
        page.evaluate("nmm.viewer.scene.visible = false")  # the processor that draws it is slow
        page.mouse.move(*page.evaluate(SPOT, [0.0, 0.0]))
        page.mouse.down()
        page.mouse.move(*page.evaluate(SPOT, [0.2, -0.15]), steps=3)
        page.mouse.up()
        wanted = np.array([0.2, -0.15])
        aimed = page.evaluate("nmm.drive.targets[0].value")
        np.testing.assert_allclose(aimed, wanted, atol=0.02)  # a pixel is 0.01
        page.wait_for_function(
            """([x, y]) => {
              const { pictures } = nmm.sights.all[0];
              const [dx, dy] = [pictures.at(-2) - x, pictures.at(-1) - y];
              return Math.hypot(dx, dy) < 2e-3;
            }""",
            arg=aimed,
            timeout=1000.0 * MOST,
        )
        box = page.get_by_label("What is seen: z in m, as a number")
        box.fill("0.65")
        box.press("Enter")
        page.wait_for_function("Math.abs(nmm.sights.all[0].places[2] - 0.65) < 1e-9")
        # The ball goes round: its slider's ends go with it.
        page.wait_for_function(
            "Math.abs(nmm.drive.targets[2].value[0] - 2.5) > 1.2 * nmm.drive.targets[2].reach"
        )
        slider = page.get_by_label("What is seen: x in m", exact=True)
        away = slider.evaluate("one => Number(one.value) - nmm.drive.targets[2].value[0]")
        assert abs(away) < 0.02
