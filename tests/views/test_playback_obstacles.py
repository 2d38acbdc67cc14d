"""Obstacles and nearest points: recorded, read back, and drawn where they were."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pytest
from playback_browser import PROJECT, UPRIGHT, WALK, Window, file_url
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window

import nmm
from nmm.model.collisions.obstacle import Passed, obstacle_as_json, obstacle_from_json, shape_from_json
from nmm.motion.clearance import ROUNDING, swept
from nmm.views.figures.motion import outlines
from nmm.views.playback import Motion, Surroundings
from nmm.views.playback.obstacles import REACH
from nmm.views.playback.scene import playback_scene

WEDGE = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.4], [0.1, 0.05, 0.1]])


def crossing(t: float) -> list[float]:
    return [1.6, 1.2 - 0.3 * t, 0.4, 0.0, 0.2 * t, 0.7 * t]


def obstacles() -> list[nmm.Obstacle]:
    return [
        nmm.Obstacle(nmm.Box([0.3, 0.2, 0.6]), [1.2, 0.8, 0.3, 0.0, 0.0, 0.4], name="crate"),
        nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [0.4 + 0.1 * t, -1.0, 0.5], name="ball"),
        nmm.Obstacle(nmm.Cylinder(0.1, 0.6), motion=crossing, name="roller"),
        nmm.Obstacle(nmm.Capsule(0.05, 0.4), [0.5, -1.5, 0.4], name="pill"),
        nmm.Obstacle(nmm.HalfSpace([0.0, -1.0, 0.0]), [0.0, 1.8, 0.0], name="wall"),
        nmm.Obstacle(nmm.Hull(WEDGE), [2.6, -0.9, 0.0], name="wedge"),
    ]


@pytest.fixture(scope="module")
def run() -> nmm.Trajectory:
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee", "xy"), [2.4, 0.3], gain=1.0, speed=0.5)
    collisions = nmm.Collisions(0.03, obstacles=obstacles())
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), collisions=collisions, dt=0.02)
    return nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 4.0, 0.02, "zoh")


# The record


def test_nearest_points_are_as_far_apart_as_the_distance_and_on_the_shapes(run: nmm.Trajectory) -> None:
    near = run.clearance_pairs >= 0
    assert near.all()
    one, other = run.clearance_points[:, :3], run.clearance_points[:, 3:]
    assert np.linalg.norm(other - one, axis=1) == pytest.approx(run.clearance, abs=1e-7)
    by_name = {obstacle.name: obstacle for obstacle in run.obstacles}
    seen = set()
    for k in range(0, len(run), 7):
        name = run.clearance_names[run.clearance_pairs[k]].split(" and ")[1]
        if name not in by_name:
            continue
        seen.add(name)
        obstacle = by_name[name]
        place = obstacle.placement(run.t[k])
        point = coal.Transform3s(np.eye(3), run.clearance_points[k, 3:])
        there = coal.Transform3s(place[:3, :3], place[:3, 3])
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        found = coal.distance(*(coal.Sphere(1e-9), point, obstacle.shape.geometry(), there), request, result)
        assert abs(found) < 1e-6
    assert seen


def test_a_folder_has_the_obstacles_where_they_were(run: nmm.Trajectory, tmp_path: Path) -> None:
    """No scenario says so here; without pickle; a moving one between samples, too."""
    run.save(tmp_path / "run", figures=False)
    again = nmm.Trajectory.load(tmp_path / "run", run.robot)
    assert [one.name for one in again.obstacles] == [one.name for one in run.obstacles]
    assert np.array_equal(again.clearance_points, run.clearance_points)
    for was, read in zip(run.obstacles, again.obstacles, strict=True):
        assert read.moves == was.moves
        for t in run.t[::50]:
            assert np.array_equal(read.placement(t), was.placement(t))
        assert read.placement(1.234) == pytest.approx(was.placement(1.234), abs=1e-5)
        assert obstacle_as_json(read.shape)[0] == obstacle_as_json(was.shape)[0]
    hull = {one.name: one.shape for one in again.obstacles}["wedge"]
    assert isinstance(hull, nmm.Hull)
    assert np.unique(hull.points, axis=0).tolist() == np.unique(WEDGE[:4], axis=0).tolist()


def test_an_older_folder_has_its_scenarios_obstacles(tmp_path: Path) -> None:
    scenario = nmm.Scenario.load("unicycle_3r_crossing").override("duration", "0.1")
    folder = scenario.run().save(tmp_path / "run", figures=False)
    text = (folder / "summary.json").read_text("utf-8").replace('"obstacles": [', '"once": [')
    (folder / "summary.json").write_text(text, "utf-8")
    (cart,) = nmm.Trajectory.load(folder).obstacles
    assert cart.name == "cart"


@pytest.mark.parametrize(
    "shape",
    [
        nmm.Box([1.0, 2.0, 3.0]),
        nmm.Sphere(0.3),
        nmm.Cylinder(0.1, 0.2),
        nmm.Capsule(0.1, 0.2),
        nmm.HalfSpace([0.0, 3.0, 4.0]),
    ],
)
def test_a_shape_is_made_again_of_what_describes_it(shape: nmm.extending.Shape) -> None:
    assert shape_from_json(*obstacle_as_json(shape)) == shape


def test_what_is_set_from_outside_is_recorded_where_it_was() -> None:
    """A ball that another obstacle's path sets while the run lasts: distances are those to where it was."""
    robot = nmm.load("unicycle_3r")
    ball = nmm.Obstacle(nmm.Sphere(0.1), [2.0, -2.0, 0.4], name="ball")

    def clockwork(t: float) -> list[float]:
        ball.move_to([2.0, -2.0 + 0.5 * max(t, 0.0), 0.4], [0.0, 0.5, 0.0])
        return [9.0, 9.0, 9.0]

    clock = nmm.Obstacle(nmm.Sphere(0.01), motion=clockwork, velocity=lambda t: [0.0, 0.0, 0.0], name="clock")
    task = nmm.Task(nmm.Position("ee", "xy"), [1.2, 0.0], gain=1.0, speed=0.5)
    collisions = nmm.Collisions(0.03, self_collisions=False, obstacles=[clock, ball], horizon=0.0)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), collisions=collisions, dt=0.02)
    run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 2.0, 0.02, "zoh")
    ball.move_to([50.0, 0.0, 0.0])  # what comes after the run changes nothing in it
    was = {one.name: one for one in run.obstacles}["ball"]
    way = np.array([was.placement(t)[1, 3] for t in run.t])
    assert was.moves
    # The ball is set where the clock is asked: at the sample's own time, or at a look ahead of it.
    assert np.all(np.diff(way) >= -0.5 * 0.5)
    assert way[-1] - way[0] > 0.8
    at = [run.obstacles[run.obstacles.index(was)].placement(t)[:3, 3] for t in run.t]
    on_ball = np.array([run.clearance_names[pair].endswith("ball") for pair in run.clearance_pairs])
    assert on_ball.any()
    gap = np.linalg.norm(run.clearance_points[:, 3:] - np.array(at), axis=1)
    assert gap[on_ball] == pytest.approx(0.1, abs=1e-6)


def test_between_two_places_the_shortest_way_is_taken() -> None:
    import pinocchio as pin

    one = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2.0, 3.0]))
    turned = np.array([0.4, -0.5, 0.6])
    other = pin.SE3(one.rotation @ pin.exp3(turned), np.array([2.0, 0.0, 3.0]))
    passed = Passed(np.array([1.0, 3.0]), np.array([one.homogeneous, other.homogeneous]))
    middle = passed(1.5)
    assert middle[:3, 3] == pytest.approx([1.25, 1.5, 3.0])
    assert middle[:3, :3] == pytest.approx(one.rotation @ pin.exp3(0.25 * turned))
    assert np.array_equal(passed(0.0), one.homogeneous)
    assert np.array_equal(passed(4.0), other.homogeneous)
    assert not obstacle_from_json(nmm.Sphere(1.0), "ball", np.array([0.0, 1.0]), one.homogeneous[None]).moves


# The page

NEAREST = """() => nmm.obstacles.shown.map(({ group, line, ends, text, item, words, material }) => ({
  visible: group.visible, ends: ends.map((end) => end.position.toArray()), text: text.text,
  read: words.textContent, far: item.classList.contains("far"),
  color: material.color.clone().convertLinearToSRGB().toArray(),
  line: line.localToWorld(new MeshCat.THREE.Vector3(0, 0.5, 0)).toArray(),
}))"""


def placed(window: Window) -> dict[str, np.ndarray]:
    """Placement of each obstacle's node, world axes."""
    return {
        path.rsplit("/", 1)[1]: UPRIGHT.T @ np.reshape(elements, (4, 4)).T
        for path, elements in window.page.evaluate(WALK).items()
        if path.startswith("/nmm/obstacle ") and path.count("/") == 2
    }


def test_obstacles_stand_and_move_where_they_were(
    run: nmm.Trajectory, window: Window, tmp_path: Path
) -> None:
    page = window.open(file_url([run.motion()], tmp_path))
    assert page.locator("#legend").get_by_text("obstacles").count() == 1
    for t in (0.0, 0.5, 1.234, 2.01, 4.0):
        page.evaluate(f"nmm.player.seek({t})")
        drawn = placed(window)
        assert len(drawn) == len(run.obstacles)
        for i, one in enumerate(run.obstacles):
            np.testing.assert_allclose(drawn[f"obstacle {i}"], one.placement(t), atol=1e-4, err_msg=one.name)


def test_the_line_is_between_the_recorded_points(run: nmm.Trajectory, window: Window, tmp_path: Path) -> None:
    page = window.open(file_url([run.motion()], tmp_path))
    near = run.clearance < run.clearance_asked + REACH
    assert near.any()
    for k in [*np.flatnonzero(near)[[0, -1]], *np.flatnonzero(near)[::40], *np.flatnonzero(~near)[::60]]:
        page.evaluate(f"nmm.player.seek({run.t[k]})")
        page.evaluate("viewer.scene.updateMatrixWorld(true)")
        (shown,) = page.evaluate(NEAREST)
        assert shown["visible"] == (not shown["far"]) == near[k]
        if not near[k]:
            continue
        points = run.clearance_points[k].reshape(2, 3)
        np.testing.assert_allclose(shown["ends"], points, atol=1e-6)
        end = (UPRIGHT[:3, :3] @ points[1]).tolist()
        np.testing.assert_allclose(shown["line"], end, atol=1e-6)
        assert shown["text"].startswith(f"{run.clearance[k]:.3f} m")
        assert shown["read"] == run.clearance_names[run.clearance_pairs[k]]


def test_the_line_is_red_below_the_distance_asked(window: Window, tmp_path: Path) -> None:
    """Without a guard: a ball that goes through the robot."""
    robot = nmm.load("unicycle_3r")
    ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [-0.2, 1.0 - 0.6 * t, 0.2], name="ball")
    setting = nmm.Collisions(0.05, self_collisions=False, obstacles=[ball]).on(robot)
    t = np.linspace(0.0, 2.0, 101)
    q, u = np.tile(robot.q(), (101, 1)), np.zeros((101, robot.n_u))
    found = swept(setting, t, q, u, [setting.places(time) for time in t])
    nearest = nmm.model.robots.motion.Nearest(
        found.points, found.clearance, found.pairs, tuple(map(" and ".join, setting.names)), 0.05
    )
    page = window.open(file_url([nmm.playback.Motion(robot, t, q, u, nearest=nearest)], tmp_path))
    colors: dict[bool, set[tuple[float, ...]]] = {True: set(), False: set()}
    for k in np.flatnonzero(found.clearance < 0.3)[::4]:
        page.evaluate(f"nmm.player.seek({t[k]})")
        color = tuple(np.round(page.evaluate(NEAREST)[0]["color"], 3).tolist())
        colors[bool(found.clearance[k] < 0.05 - ROUNDING)].add(color)
    assert colors[True] == {(0.83, 0.1, 0.22)}
    assert len(colors[False]) == 1
    assert not colors[True] & colors[False]


def test_runs_that_are_compared_share_their_obstacles(
    run: nmm.Trajectory, window: Window, tmp_path: Path
) -> None:
    shorter = {name: getattr(run.motion("RG"), name)[:90] for name in ("t", "q", "u", "path")}
    own = run.motion()
    other = nmm.playback.Motion(
        run.robot,
        **shorter,
        label="RG",
        bodies=tuple(nmm.extending.Body(one.name, one.geometry, one.places[:90]) for one in own.bodies),
    )
    page = window.open(file_url([other, own], tmp_path))
    assert len(placed(window)) == len(run.obstacles)
    page.evaluate("nmm.player.seek(3.5)")
    assert placed(window)["obstacle 1"][0, 3] == pytest.approx(0.75, abs=1e-4)


def test_obstacles_and_distances_can_be_hidden(run: nmm.Trajectory, window: Window, tmp_path: Path) -> None:
    page = window.open(file_url([run.motion()], tmp_path))
    visible = "nmm.node('/nmm/obstacle 2').visible"
    page.get_by_role("button", name="obstacles").click()
    assert page.evaluate(visible) is False
    page.get_by_role("button", name="obstacles").click()
    assert page.evaluate(visible) is True
    page.keyboard.press("d")
    assert page.evaluate("nmm.obstacles.lines[0].visible") is False
    page.keyboard.press("d")
    assert page.evaluate("nmm.obstacles.lines[0].visible") is True


def test_the_camera_holds_near_obstacles_and_not_the_far_ones(window: Window, tmp_path: Path) -> None:
    robot = nmm.load("unicycle_3r")
    t = np.linspace(0.0, 1.0, 11)
    q, u = np.tile(robot.q(), (11, 1)), np.zeros((11, robot.n_u))

    def moved(bodies: list[Any]) -> nmm.playback.Motion:
        return nmm.playback.Motion(robot, t, q, u, bodies=tuple(bodies))

    def size(bodies: list[Any]) -> float:
        return float(playback_scene([moved(bodies)], title="")[0]["size"])

    def body(shape: nmm.extending.Shape, xyz: list[float]) -> Any:
        place = np.eye(4)
        place[:3, 3] = xyz
        return nmm.extending.Body("thing", shape.geometry(), place[None])

    alone = size([])
    assert size([body(nmm.HalfSpace(), [0, 0, 0])]) == alone
    assert size([body(nmm.Box([1, 1, 1]), [300.0, 0, 0])]) == alone
    near = body(nmm.Box([0.2, 0.2, 0.6]), [0.8, 0.6, 0.3])
    assert alone < size([near]) < 3.0 * alone
    page = window.open(file_url([moved([near])], tmp_path))
    assert np.abs(page.evaluate(PROJECT, [[0.9, 0.7, 0.6]])).max() < 1.0
    assert size([body(nmm.Box([200.0, 0.1, 3.0]), [0, 1.0, 0])]) < 4.0 * alone


@pytest.mark.parametrize("several", [False, True])
def test_nothing_that_is_held_is_behind_a_card(window: Window, tmp_path: Path, several: bool) -> None:
    """At 900 x 560 the target's ball was half behind the tools, and tags lay under the legend."""
    run = nmm.Scenario.load("unicycle_2r_pointing").override("duration", "4").run()
    motions = [run.motion(label) for label in (("PG", "RG", "EJ") if several else ("PG",))]
    window.page.set_viewport_size({"width": 900, "height": 560})
    page = window.open(file_url(motions, tmp_path))
    cards = page.evaluate(
        """() => ["heading", "tools", "bar"].map((id) => {
          const { left, right, top, bottom } = document.getElementById(id).getBoundingClientRect();
          return [left, right, top, bottom];
        })"""
    )
    roots = np.column_stack([run.q[:, :2], np.full(len(run), page.evaluate("nmm.motions[0].height"))])
    tags = roots[::20].tolist() if several else []
    points = [*run.path[::20].tolist(), run.target.tolist(), *tags]
    seen = np.array(page.evaluate(PROJECT, points))[:, :2]
    pixels = np.column_stack([0.5 * (1 + seen[:, 0]) * 900, 0.5 * (1 - seen[:, 1]) * 560])
    margin = np.array([12.0] * (len(points) - len(tags)) + [30.0] * len(tags))
    assert np.all((pixels > 0) & (pixels < [900, 560]))
    for left, right, top, bottom in cards:
        beside = np.maximum(left - pixels[:, 0], pixels[:, 0] - right)
        away = np.maximum(top - pixels[:, 1], pixels[:, 1] - bottom)
        assert np.all(np.maximum(beside, away) > margin)


def test_what_moves_and_then_rests_is_drawn_once_there() -> None:
    """And twice where it comes back, as it was elsewhere in between."""
    goes = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [min(t, 1.0), 0.0, 0.0], name="goes")
    returns = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [abs(t - 1.0), 0.0, 0.0], name="returns")
    stands = nmm.Obstacle(nmm.Sphere(0.1), name="stands")
    run: Any = SimpleNamespace(obstacles=[goes, returns, stands], surroundings=nmm.playback.Surroundings())
    found = outlines(run, np.array([0.0, 1.0, 2.0, 3.0]))
    spans = [(0.0, 0.0), (1.0, 3.0), (0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0), None]
    assert [one.times for one in found] == spans
    assert [one.strength for one in found if one.times and one.times[1] == 3.0] == [1.0, 1.0]


def test_what_stands_before_the_robot_is_seen_through(window: Window, tmp_path: Path) -> None:
    """A wall between eye and robot, one behind it, and the first one again from its other side."""
    robot = nmm.load("unicycle_2r")
    q = np.tile(robot.rest, (2, 1))
    places = []
    for y in (-1.0, 1.0):
        place = np.eye(4)
        place[:3, 3] = 0.0, y, 1.0
        places.append(place[None])
    wall = nmm.Box([4.0, 0.1, 2.0]).geometry()
    around = Surroundings(scenery=tuple(nmm.extending.Body("wall", wall, at) for at in places))
    motion = Motion(robot, [0.0, 1.0], q, np.zeros((2, robot.n_u)), surroundings=around)
    page = window.open(file_url([motion], tmp_path) + "#view=front")
    opacity = """() => [0, 1].map((i) => {
      let found = null;
      nmm.viewer.render();
      nmm.node(`/nmm/obstacle ${i}`).traverse((part) => part.isMesh && (found = part.material.opacity));
      return found;
    })"""
    assert page.evaluate(opacity) == [0.3, 1.0]
    page.evaluate("nmm.camera.put([0, 6, 1, 0, 0, 0.5])")
    assert page.evaluate(opacity) == [1.0, 0.3]
    page.evaluate("nmm.camera.put([6, 0, 1, 0, 0, 0.5])")
    assert page.evaluate(opacity) == [1.0, 1.0]


def test_among_obstacles_the_distance_to_one_is_written_not_a_robots_own() -> None:
    robot = nmm.load("unicycle_2r")
    nearest = nmm.playback.Nearest(
        np.zeros((1, 6)), np.array([0.2]), np.array([0]), ("link1 and base_link", "link2 and wall"), 0.1
    )
    wall = nmm.extending.Body("wall", nmm.Sphere(0.1).geometry(), np.eye(4)[None])
    told = []
    for bodies in ((), (wall,)):
        motion = Motion(
            robot, [0.0], robot.rest[None], np.zeros((1, robot.n_u)), bodies=bodies, nearest=nearest
        )
        told += [one["told"] for one in playback_scene([motion], title="") if one["type"] == "nearest"]
    assert told == [[True, True], [False, True]]
