"""Collisions in scenarios: keys that are read, errors that name them, and the bundled ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from findings import the
from small_pictures import draw_only
from urdf_parts import inertial, joint, link, robot, shape, write

import nmm
from nmm import Scenario
from nmm.base.errors import ScenarioError

TEXT = """
robot: unicycle_3r
q0: {q1: 0.3, q2: 0.6}
duration: 0.1
dt: 0.02
task: {kind: position, frame: ee, axes: xy, reference: [3, 0.2], gain: 1}
resolver: {kind: pg}
collisions:
"""
PILLAR = "{name: pillar, shape: {kind: box, size: [0.3, 0.6, 1]}, xyz: [1.6, 0, 0.5]}"


def written(folder: Path, collisions: str) -> Scenario:
    path = folder / "own.yaml"
    path.write_text(TEXT.rstrip() + f" {collisions}\n", encoding="utf-8")
    return Scenario.load(path)


def test_keys_are_the_constructors(tmp_path: Path) -> None:
    keys = "distance: 0.05, self_collisions: false, gain: 2, ignore: [[caster, pillar]]"
    given = f"{{{keys}, obstacles: [{PILLAR}]}}"
    scenario = written(tmp_path, given)
    found = scenario.controller()
    pillar = nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="pillar")
    kept = nmm.Collisions(
        0.05, self_collisions=False, obstacles=[pillar], ignore=[("caster", "pillar")], gain=2.0
    )
    ours = nmm.Controller(found.robot, found.task, found.resolver, collisions=kept, dt=0.02)
    assert found.solver.scene is not None
    assert ours.solver.scene is not None
    assert found.solver.scene.names == ours.solver.scene.names
    q = found.robot.q({"q1": 0.3, "q2": 0.6, "x": 0.4})
    assert np.array_equal(found(0.0, q), ours(0.0, q))
    again = scenario.override("collisions.distance", "0.02").controller()
    assert again.solver.scene is not None
    assert again.solver.scene.distance == 0.02


def test_true_keeps_the_robot_off_itself(tmp_path: Path) -> None:
    setting = written(tmp_path, "true").controller().solver.scene
    assert setting is not None
    assert not setting.obstacles
    assert setting.distance == nmm.Collisions().distance
    assert written(tmp_path, "false").controller().solver.scene is None


@pytest.mark.parametrize(
    ("shape", "made"),
    [
        ("{kind: sphere, radius: 0.1}", nmm.Sphere(0.1)),
        ("{kind: cylinder, radius: 0.1, length: 1}", nmm.Cylinder(0.1, 1.0)),
        ("{kind: capsule, radius: 0.1, length: 1}", nmm.Capsule(0.1, 1.0)),
        ("{kind: plane, normal: [0, -3, 4]}", nmm.HalfSpace([0.0, -0.6, 0.8])),
    ],
)
def test_shapes(tmp_path: Path, shape: str, made: nmm.extending.Shape) -> None:
    setting = (
        written(tmp_path, f"{{obstacles: [{{shape: {shape}, xyz: [5, 9, 0]}}]}}").controller().solver.scene
    )
    assert setting is not None
    (one,) = setting.obstacles
    assert one.shape == made
    assert one.name == type(made).__name__.lower()


@pytest.mark.parametrize(
    ("motion", "value", "velocity"),
    [
        ("{kind: line, start: [5, 0, 1], end: [9, 2, 1], duration: 8}", [6.5, 0.75, 1.0], [0.5, 0.25, 0.0]),
        (
            "{kind: circle, center: [5, 5, 1], radius: 2, rate: pi/6}",
            [5.0, 7.0, 1.0],
            [-np.pi / 3, 0.0, 0.0],
        ),
    ],
)
def test_a_motion_is_a_reference_value_and_velocity(
    tmp_path: Path, motion: str, value: list[float], velocity: list[float]
) -> None:
    given = f"{{obstacles: [{{shape: {{kind: sphere, radius: 0.1}}, rpy: [0, 0, pi/2], motion: {motion}}}]}}"
    setting = written(tmp_path, given).controller().solver.scene
    assert setting is not None
    (one,) = setting.obstacles
    assert one.placement(3.0)[:3, 3] == pytest.approx(value, abs=1e-14)
    turned = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert one.placement(3.0)[:3, :3] == pytest.approx(turned, abs=1e-14)
    assert one.twist(3.0) == pytest.approx([*velocity, 0.0, 0.0, 0.0], abs=1e-14)


def test_ignored_pairs_by_patterns(tmp_path: Path) -> None:
    """All that two patterns match, links and obstacles, and nothing else; a name is itself."""

    def names(collisions: str) -> list[tuple[str, str]]:
        scene = written(tmp_path, f"{{{collisions}, obstacles: [{PILLAR}]}}").controller().solver.scene
        assert scene is not None
        return [*scene.names]

    every = names("ignore: []")
    left = names("ignore: [['link?', 'p*r']]")
    assert left == [pair for pair in every if not (pair[0].startswith("link") and pair[1] == "pillar")]
    assert 0 < len(left) < len(every)
    assert names("ignore: [['*', pillar]]") == [pair for pair in every if pair[1] != "pillar"]


def test_links_that_touch_at_the_start_are_told_as_the_robots_own(tmp_path: Path) -> None:
    """Two balls on slides, 0.1 m apart at the start: what helps is not another obstacle."""
    ball, at = inertial() + shape('<sphere radius="0.2"/>', "collision"), '<origin xyz="0 0 0.05"/>'
    slide = '<axis xyz="1 0 0"/><limit lower="0" upper="3" effort="1" velocity="1"/>'
    joints = [
        joint(name, parent, name + "_", "prismatic", slide, at) for name, parent in (("b", "a"), ("c", "b_"))
    ]
    write(tmp_path / "balls.urdf", robot(link("a", ball), link("b_"), link("c_", ball), *joints))
    text = TEXT.replace("unicycle_3r", "balls.urdf").replace("{q1: 0.3, q2: 0.6}", "{b: 0.01}")
    text = text.replace("frame: ee", "frame: c_").replace("collisions:\n", "collisions: true\n")
    run = Scenario.load(write(tmp_path / "own.yaml", text)).run()
    found = the(run, "start_too_near").values
    assert (found["name"], found["own"]) == ("a and c_", True)
    assert found["clearance"] < 0.0


OBSTACLES = "{obstacles: [%s]}"


@pytest.mark.parametrize(
    ("collisions", "said"),
    [
        ("{distance: -0.1}", "collisions.distance: expected a number from 0, got -0.1"),
        ("{distanse: 0.1}", "collisions.distanse: unknown key"),
        ("{self: false}", "collisions.self: unknown key 'self'; available: srdf, self_collisions"),
        ("{band: 0.01}", "collisions.band: expected above distance"),
        ("{ignore: [[link1, nobody]]}", "collisions.ignore: unknown link, shape or obstacle 'nobody'"),
        ("{ignore: [['no*', link1]]}", "collisions.ignore: unknown link, shape or obstacle 'no*'"),
        ("{srdf: none.srdf}", "srdf: there is no file"),
        ("{shapes: balls}", "collisions.shapes: unknown value 'balls'"),
        (
            OBSTACLES % "{shape: {kind: ball, radius: 1}}",
            "collisions.obstacles.0.shape.kind: unknown kind 'ball'",
        ),
        (OBSTACLES % "{shape: {radius: 1}}", "collisions.obstacles.0.shape.kind: this key is missing"),
        (OBSTACLES % "{xyz: [0, 0, 0]}", "collisions.obstacles.0.shape: this key is missing"),
        (
            OBSTACLES % "{shape: {kind: box, size: [1, 1, 0]}}",
            "collisions.obstacles.0.shape.size: expected three lengths above 0",
        ),
        (
            OBSTACLES % "{shape: {kind: mesh, file: none.stl}}",
            "collisions.obstacles.0.shape.file: expected a file",
        ),
        (
            OBSTACLES % "{shape: {kind: sphere, radius: 1}, xyz: [9, 9, 9],"
            " motion: {kind: line, start: [1, 1, 1], end: [2, 2, 2], duration: 1}}",
            "collisions.obstacles.0.motion: both are given; expected xyz or motion",
        ),
        (
            OBSTACLES % "{shape: {kind: sphere, radius: 1}, motion: {kind: circle, center: [1, 1], radius: 1,"
            " rate: 1}}",
            "collisions.obstacles.0.motion: expected 3 rows in m (x, y, z), got ",
        ),
        (OBSTACLES % f"{PILLAR}, {PILLAR}", "collisions.obstacles: expected a name each, got 'pillar'"),
        (
            OBSTACLES % "{name: link2, shape: {kind: sphere, radius: 1}}",
            "collisions.obstacles: link2 is a link",
        ),
    ],
)
def test_errors_name_the_file_and_the_key(tmp_path: Path, collisions: str, said: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        written(tmp_path, collisions).controller()
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'own.yaml'}:")


def test_a_mesh_is_found_beside_the_scenario_and_kept_by_its_whole_path(tmp_path: Path) -> None:
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    lines = [*(f"v {x} {y} {z}" for x, y, z in points), *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces)]
    (tmp_path / "corner.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    given = written(tmp_path, OBSTACLES % "{shape: {kind: mesh, file: corner.obj}, xyz: [5, 5, 0]}")
    kept = given.resolved()["collisions"]["obstacles"][0]["shape"]
    assert kept["file"] == str(tmp_path / "corner.obj")
    setting = given.controller().solver.scene
    assert setting is not None
    assert isinstance(setting.obstacles[0].shape, nmm.ConvexMesh)


# The bundled ones


def least(run: nmm.Trajectory, given: Scenario, every: int) -> float:
    """The least distance at some samples and half-way, of every pair, by Pinocchio's own loop over pairs."""
    setting = given.controller().solver.scene
    assert setting is not None
    model, shapes = run.robot.model, setting.queries.shapes
    data, found = model.createData(), pin.GeometryData(shapes)
    first = len(shapes.geometryObjects) - len(setting.obstacles)
    distances = []
    half = 0.5 * (run.q[1:] + run.q[:-1])
    looks = [*zip(run.t, run.q, strict=True), *zip(run.t[:-1] + 0.5 * run.dt, half, strict=True)]
    for t, q in looks[::every]:
        for i, obstacle in enumerate(setting.obstacles):
            shapes.geometryObjects[first + i].placement = pin.SE3(obstacle.placement(float(t)))
        pin.computeDistances(model, data, shapes, found, q)
        distances.append(min(one.min_distance for one in found.distanceResults))
    return min(distances)


def without(given: Scenario) -> Scenario:
    """The scenario with nothing in it that knows of collisions."""
    objective = given.resolved()["objective"]
    if isinstance(objective, list):
        given = given.override("objective", [one for one in objective if one["kind"] != "clearance"])
    return given.override("collisions", "null")


BUNDLED = ("omni_small_arm_door", "tiago_shelf", "unicycle_3r_crossing", "unicycle_3r_door", "ur5_car_bonnet")


@pytest.mark.parametrize("name", BUNDLED)
def test_the_bundled_scenarios_touch_nothing_and_would(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw_only([], monkeypatch)
    given = Scenario.load(name)
    asked = given.parts.collisions
    assert asked is not None
    run = given.run()
    assert run.outcome is nmm.Outcome.COMPLETED
    assert run.clearance_between.min() >= asked.distance - 1e-6
    # What is measured half-way between samples is not quite the arc that the robot drives.
    assert least(run, given, 3) >= asked.distance - 1e-4
    assert least(without(given).run(), given, 10) < 0.0
    run.save(tmp_path / "run")
    assert (tmp_path / "run" / "clearance.png").exists()
    again = nmm.Trajectory.load(tmp_path / "run")
    assert again.clearance_asked == asked.distance
    assert [one.name for one in again.obstacles] == [one.name for one in run.obstacles]
    for ours, theirs in zip(again.obstacles, run.obstacles, strict=True):
        assert np.array_equal(ours.placement(2.0), theirs.placement(2.0))


@pytest.mark.parametrize(
    "changed",
    [
        {"q0.x": 0.1, "q0.y": -0.1, "collisions.gain": 3.6},
        {"q0.y": 0.1, "task.gain": 0.9, "collisions.gain": 4.4},
        {"q0.theta": 0.1, "task.speed": 0.33, "collisions.obstacles.0.motion.duration": 6 / 1.1},
        {
            "q0.x": -0.1,
            "q0.theta": -0.1,
            "task.speed": 0.27,
            "collisions.obstacles.0.motion.duration": 6 / 0.9,
        },
    ],
)
def test_the_crossing_does_not_depend_on_its_numbers(changed: dict[str, float]) -> None:
    run = Scenario.load("unicycle_3r_crossing", changed).run()
    assert run.outcome is nmm.Outcome.COMPLETED
    assert run.clearance_between.min() >= 0.05 - 1e-6
    assert run.error_norm[-1] < 5e-3  # what is left of 2 m after 12 s behind the cart
