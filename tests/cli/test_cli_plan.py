"""`nmm plan`: what it writes, its goals and obstacles, and how it ends."""

import json

import numpy as np
import pytest

import nmm
from nmm.cli.exit_status import status_of
from nmm.plugins.planning.search import PlanSearch

POSE = "x=2,y=1,theta=pi/2"


def test_a_robot_is_planned_for_and_the_folder_plans_it_again(tmp_path, capsys):
    out = tmp_path / "plan"
    given = (
        "--to",
        POSE,
        "--start",
        "x=0.5,q1=0.3",
        "--through",
        "x=1,y=-1,theta=0",
        "--seed",
        "2",
        "--seconds",
        "5",
    )
    assert (
        status_of(("plan", "unicycle_3r", *given, "--set", "limits.velocity.v=0.5", "--out", str(out))) == 0
    )
    assert "looked at" in capsys.readouterr().out
    run = nmm.Trajectory.load(out)
    np.testing.assert_allclose(run.q[0], [0.5, 0.0, 0.0, 0.3, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(run.q[-1, :2], [2.0, 1.0], atol=1e-9)
    assert np.isclose(np.sin(run.q[-1, 2]), 1.0)
    assert np.linalg.norm(run.q[:, :2] - [1.0, -1.0], axis=1).min() < 0.02
    assert np.abs(run.u[:, 0]).max() <= 0.5 + 1e-11
    plan = nmm.Scenario.load(out / "scenario.yaml").parts.plan
    assert (plan.seed, plan.seconds) == (2, 5.0)
    assert np.array_equal(nmm.Scenario.load(out / "scenario.yaml").run().q, run.q)


@pytest.mark.parametrize("alone", [False, True])
def test_obstacles_come_from_a_file_or_a_scenario(tmp_path, capsys, alone):
    given = "behind_the_wall"
    if alone:
        given = str(tmp_path / "walls.yaml")
        wall = "{name: wall, shape: {kind: box, size: [0.2, 4, 1.4]}, xyz: [2.5, 0, 0.7]}"
        (tmp_path / "walls.yaml").write_text(f"obstacles:\n  - {wall}\n", encoding="utf-8")
    arguments = ("--to", "x=6,y=0,theta=0", "--obstacles", given, "--out", str(tmp_path / "out"), "--json")
    assert status_of(("plan", "unicycle_3r", *arguments)) == 0
    said = json.loads(capsys.readouterr().out)
    run = nmm.Trajectory.load(said["folder"])
    assert np.isclose(run.t[-1], said["duration"])
    assert np.allclose(run.q[-1], [*said["end"].values()])
    assert list(said["end"]) == list(run.robot.q_names)
    assert said["motions"] > 1
    wall = nmm.Obstacle(nmm.Box([0.2, 4.0, 1.4]), [2.5, 0.0, 0.7], name="wall")
    scene = nmm.Collisions(obstacles=[wall]).on(run.robot)
    pairs = range(len(scene.names))
    assert min(scene.queries.distances(0.0, q, pairs).min() for q in run.q) >= 0.03


def test_a_scenario_is_planned_with_or_without_a_plan_of_its_own(tmp_path):
    for name, more in (
        ("behind_the_wall", ("--set", "plan.track=true")),
        ("unicycle_3r_door", ("--to", "x=2,y=0")),
    ):
        out = tmp_path / name
        assert status_of(("plan", name, *more, "--out", str(out))) == 0
        run = nmm.Trajectory.load(out)
        assert run.resolver == "plan"
        assert run.clearance.min() >= run.clearance_asked - 1e-12


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("unicycle_3r",), 2, "--to"),
        (("unicycle_3r", "--to", "x"), 2, "--to"),
        (("unicycle_3r", "--to", "x=1,x=2"), 2, "--to"),
        (("unicycle_3r", "--to", "z=1"), 2, "plan.to"),
        (("unicycle_3r", "--to", "x=1", "--start", "z=1"), 2, "q0"),
        (("unicycle_3r", "--to", "x=1", "--through", "z=1"), 2, "plan.through.0"),
        (("unicycle_3r", "--to", "x=1", "--seconds", "0"), 2, "plan.seconds"),
        (("unicycle_3r", "--to", "x=1", "--obstacles", "none.yaml"), 2, "none.yaml"),
        (("behind_the_wall", "--obstacles", "behind_the_wall"), 2, "--obstacles"),
        (("trailer_base", "--to", "x=1", "--set", "robot.platform=wheeled"), 2, "wheeled"),
        (("no_such_robot", "--to", "x=1"), 2, "no_such_robot"),
        (("unicycle_3r", "--to", "x=2.5,y=0", "--obstacles", "behind_the_wall"), 1, "wall"),
    ],
)
def test_a_refusal_is_one_line(tmp_path, monkeypatch, capsys, arguments, status, said):
    monkeypatch.chdir(tmp_path)
    assert status_of(("plan", *arguments)) == status
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert said in told.err
    assert len(told.err) <= 300
    assert not list(tmp_path.iterdir())


def test_a_plan_is_played_when_asked_to(tmp_path, monkeypatch):
    played = []
    monkeypatch.setattr(nmm.Trajectory, "play", lambda run, **options: played.append((len(run), options)))
    given = ("plan", "unicycle_3r", "--to", POSE, "--out", str(tmp_path / "out"))
    assert status_of((*given, "--no-open")) == 2
    assert not played
    assert status_of((*given, "--play", "--no-open")) == 0
    ((count, options),) = played
    assert count > 10
    assert options == {"port": None, "open_browser": False}


def test_a_plan_that_is_followed_reports_how_long_it_is_looked_for():
    """A run plans before its controller is there."""
    shares = []
    to = {"to": {"x": 6, "y": 0, "theta": 0}, "track": True}
    nmm.Scenario.load("behind_the_wall", {"plan": to, "duration": 60}).controller(shares.append)
    assert shares
    assert all(0.0 <= share <= 1.0 for share in shares)


def test_an_interrupted_search_writes_nothing(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(PlanSearch, "way", interrupted)
    assert status_of(("plan", "unicycle_3r", "--to", POSE, "--out", str(tmp_path / "out"))) == 130
    assert not (tmp_path / "out").exists()
