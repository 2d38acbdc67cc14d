"""What a scenario draws beside robot and task: loads, scenery, how the page opens."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from live_pages import unpacked

import nmm
from nmm.views.playback import Body, Carried, Motion, Surroundings
from nmm.views.playback.extent import corners
from nmm.views.playback.scene import playback_scene

SCENE = {
    "carried": [
        {"name": "tray", "frame": "ee", "shape": {"kind": "box", "size": [0.2, 0.3, 0.02]}, "mass": 0.5},
        {"frame": "ee", "shape": {"kind": "sphere", "radius": 0.05}, "xyz": [0.0, 0.0, 0.3], "mass": 1.5},
        {"frame": "link1", "shape": {"kind": "cylinder", "radius": 0.02, "length": 0.1}},
    ],
    "scenery": [{"name": "table", "shape": {"kind": "box", "size": [1, 1, 0.5]}, "xyz": [2, 0, "1/4"]}],
    "camera": "top",
    "opens": 0.5,
}


@pytest.fixture(scope="module")
def scenario() -> nmm.Scenario:
    return nmm.Scenario.load("unicycle_2r_position", {"duration": 1, "dt": 0.02, "scene": SCENE})


def test_a_run_and_its_folder_have_what_the_scenario_draws(scenario: nmm.Scenario, tmp_path: Path) -> None:
    run = scenario.run()
    run.save(tmp_path / "run", figures=False)
    for one in (run, nmm.Trajectory.load(tmp_path / "run")):
        found = one.motion().surroundings
        assert [load.name for load in found.carried] == ["tray", "sphere", "cylinder"]
        assert (found.camera, found.opens) == ("top", 0.5)
        assert [(body.name, body.places[0, :3, 3].tolist()) for body in found.scenery] == [
            ("table", [2.0, 0.0, 0.25])
        ]
        assert not one.motion().bodies  # no obstacles


def test_figures_draw_scenery_where_it_stands(scenario: nmm.Scenario) -> None:
    axes = nmm.figures.stroboscopic(scenario.run()).axes[0]
    (table,) = (patch for patch in axes.patches if patch.get_label() == "scenery")
    corners = np.asarray(table.get_path().vertices)
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [[1.5, -0.5], [2.5, 0.5]])
    assert "scenery" in [text.get_text() for text in axes.get_legend().get_texts()]


def test_what_is_carried_loads_the_motors(scenario: nmm.Scenario) -> None:
    """As one mass in the common centre; unlike masses that the user gives, none among them."""
    surroundings = scenario.surroundings(scenario.robot())
    assert surroundings.payload.keys() == {"ee"}
    mass, place = surroundings.payload["ee"]
    assert mass == pytest.approx(2.0)
    np.testing.assert_allclose(place, [0.0, 0.0, 1.5 * 0.3 / 2.0])
    run = nmm.Scenario.load("tiago_tray", {"duration": 0.1}).run()
    lifted, bare = (
        one["torso_lift_joint"]["peak"]
        for one in (run.torques().summary()["actuators"], run.torques({}).summary()["actuators"])
    )
    assert lifted - bare == pytest.approx(1.3 * 9.81, rel=0.01)


@pytest.mark.parametrize(
    ("key", "value", "where"),
    [
        ("scene.carried.0.frame", "elbow", "scene.carried.0.frame"),
        ("scene.carried.0.mass", 0, "scene.carried.0.mass"),
        ("scene.carried.0.shape.kind", "tray", "scene.carried.0.shape.kind"),
        ("scene.scenery.0.motion", {}, "scene.scenery.0.motion"),
        ("scene.camera", "left", "scene.camera"),
        ("scene.camera", [1, 2, 3], "scene.camera"),
        ("scene.opens", -1, "scene.opens"),
    ],
)
def test_what_cannot_be_drawn_is_said_with_its_key(
    scenario: nmm.Scenario, key: str, value: object, where: str
) -> None:
    with pytest.raises(nmm.ScenarioError) as caught:
        scenario.override(key, value).controller()
    assert where in str(caught.value)
    assert len(str(caught.value)) <= 300


def test_resolved_it_is_drawn_in_the_same_way(scenario: nmm.Scenario, tmp_path: Path) -> None:
    import yaml

    (tmp_path / "again.yaml").write_text(yaml.safe_dump(scenario.resolved()), encoding="utf-8")
    again = nmm.Scenario.load(tmp_path / "again.yaml")
    assert again.parts.scene == scenario.parts.scene


def test_motions_of_ones_own_carry_shapes_too() -> None:
    """Drawn on the frame's joint, so that it moves with it; scenery apart from obstacles."""
    robot = nmm.load("unicycle_2r")
    place = np.eye(4)
    place[:3, 3] = 0.1, 0.2, 0.3
    load = Carried("tray", nmm.Box([0.2, 0.3, 0.02]).geometry(), "ee", place)
    around = Surroundings(
        (load,), (Body("table", nmm.Sphere(0.2).geometry(), np.eye(4)[None]),), (1.0,) * 6, 1.0
    )
    t = np.linspace(0.0, 2.0, 5)
    q = np.tile(robot.rest, (5, 1))
    motion = Motion(robot, t, q, np.zeros((5, robot.n_u)), surroundings=around)
    commands = playback_scene([motion], title="")
    (stage,) = (one for one in commands if one["type"] == "stage")
    assert stage["opening"] == {"camera": [1.0] * 6, "time": 1.0}
    (path,) = (one["path"] for one in commands if one["type"] == "object" and "carried" in one["path"])
    matrices = {
        one["path"]: np.reshape(one["matrix"], (4, 4)).T for one in commands if one["type"] == "set_transform"
    }
    at = np.eye(4)
    parts = path.split("/")
    for k in range(2, len(parts) + 1):
        at = at @ matrices.get("/".join(parts[:k]), np.eye(4))
    expected = nmm.Configuration(robot, robot.rest).placement("ee").homogeneous @ place
    np.testing.assert_allclose(at, expected, atol=1e-12)
    # The picture holds all of it.
    held = unpacked(stage["view"]).reshape(-1, 3)
    tray = corners(np.array([[-0.1, -0.15, -0.01], [0.1, 0.15, 0.01]]))
    there = tray @ expected[:3, :3].T + expected[:3, 3]
    assert np.all(held.min(axis=0) <= there.min(axis=0) + 1e-12)
    assert np.all(held.max(axis=0) >= there.max(axis=0) - 1e-12)
    told = {one["text"] for one in commands if one["type"] == "obstacles"}
    assert told == {"scenery"}
    with pytest.raises(nmm.InputError, match="elbow"):
        Motion(robot, t, q, motion.u, surroundings=Surroundings((Carried("x", load.geometry, "elbow"),)))
