"""Streams in files, by the tools' own readers. Rerun's package is large: pip install -e '.[test,streams]'."""

from __future__ import annotations

import signal
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import PANDA
from streamed import (
    by_foxglove,
    by_rerun,
    column,
    frames_of_foxglove,
    frames_of_rerun,
    links_are_where_they_are,
    said_of,
)

import nmm
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.motion.verdict import Outcome, Verdict

pytest.importorskip("foxglove")
#: Names with characters that mean something to Rerun's paths, to ROS and to JSON.
WALL, ODD = 'wall/a b:"c"', "aim/1 x"


def ending(tool: str) -> str:
    return {"rerun": ".rrd", "foxglove": ".mcap"}[tool]


def stream(run: nmm.Trajectory, tool: str, folder: Path, **options: Any) -> Path:
    if tool == "rerun":
        pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
    file = nmm.stream(run, tool, file=folder / f"run{ending(tool)}", **options).file
    assert file is not None
    return file


@cache
def mounted() -> Robot:
    return nmm.mount("unicycle_2r", PANDA, at="arm_base")


@cache
def fixed() -> Robot:
    """More than three joints, and no platform under them."""
    return nmm.load(pin.buildSampleModelManipulator(), platform="fixed")


@cache
def run_of(kind: str) -> nmm.Trajectory:
    if kind == "odometry":
        worn = {"odometry": True, "slip": {"v": 0.8, "omega": 0.9}}
        settings = {"duration": 1, "dt": 0.05, "method": "zoh", "disturbances": worn}
        return nmm.Scenario.load("unicycle_2r_position", settings).run()
    if kind == "obstacles":
        robot = nmm.load("unicycle_3r")
        wall = nmm.Obstacle(nmm.Box([0.2, 1.0, 1.0]), [1.5, 0.0, 0.5], name=WALL)
        ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [2.0, 1.0 - t, 0.5], name="ball")
        floor = nmm.Obstacle(nmm.HalfSpace(), name="floor")
        apart = nmm.Collisions(
            0.03, self_collisions=False, obstacles=[wall, ball, floor], ignore=[["*", "floor"]]
        )
        reach = nmm.Task(nmm.Position("ee"), [0.8, 0.3, 0.9], name=ODD, when=nmm.Between(0.2, 0.6))
        given = {"dt": 0.05, "collisions": apart, "limits": nmm.Limits({"platform": 0.8, "arm": 1.5})}
        controller = nmm.SequencedController(robot, [reach], nmm.ProjectedGradient(), **given)
        return nmm.simulate(controller, robot.q({"q2": 0.5}), 1.0, 0.05)
    robot = mounted() if kind == "mounted" else fixed()
    frame = "panda_hand" if kind == "mounted" else robot.frames[-1]
    start = robot.following.placed(np.clip(np.linspace(0.1, 0.5, robot.n), *robot.q_limits.T))
    at = nmm.Configuration(robot, start).placement(frame).translation
    aim = nmm.Task(nmm.Position(frame), at + np.array([0.1, 0.05, 0.0]))
    return nmm.simulate(nmm.Controller(robot, aim, nmm.DampedLeastSquares()), start, 0.5, 0.05)


def world(run: nmm.Trajectory) -> str:
    return "odom" if run.believed is None else "map"


@pytest.mark.parametrize("kind", ["mounted", "fixed", "odometry", "obstacles"])
@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_every_link_is_where_it_is(tool: str, kind: str, tmp_path: Path) -> None:
    """Rerun keeps 32 bits of a number."""
    run = run_of(kind)
    file = stream(run, tool, tmp_path)
    found: Any = by_foxglove(file) if tool == "foxglove" else by_rerun(file)
    at = frames_of_foxglove if tool == "foxglove" else frames_of_rerun
    for k in (0, len(run) - 1):
        atol = 1e-9 if tool == "foxglove" else 2e-6
        links_are_where_they_are(run.robot, run.q[k], at(found, k), world(run), atol)


def test_foxglove_has_all_numbers_as_they_are(tmp_path: Path) -> None:
    run = run_of("mounted")
    found = by_foxglove(stream(run, "foxglove", tmp_path, start=1.7e9))
    stamps = [1_700_000_000 * 10**9 + round(1e9 * t) for t in run.t]
    for topic in ("/tf", "/inputs", "/error", "/joint_states", "/odom"):
        assert [stamp for stamp, _ in found[topic]] == stamps
    joints = run.robot.q_names[3:]
    for k in range(len(run)):
        np.testing.assert_array_equal([found["/inputs"][k][1][name] for name in run.robot.u_names], run.u[k])
        np.testing.assert_array_equal([found["/error"][k][1][name] for name in run.r_names], run.error[k])
        states = {one.name: one.position for one in found["/joint_states"][k][1].joints}
        np.testing.assert_array_equal([states[name] for name in joints], run.q[k, 3:])
        odometry, (x, y, theta) = found["/odom"][k][1], run.q[k, :3]
        pose = odometry.pose
        assert (pose.position.x, pose.position.y) == (x, y)
        assert 2 * np.arctan2(pose.orientation.z, pose.orientation.w) == pytest.approx(theta)
        assert odometry.linear_velocity.x == pytest.approx(run.u[k, 0])
        assert odometry.body_frame_id in {one.child_frame_id for one in found["/tf"][k][1].transforms}
    text = found["/robot_description"][0][1]["data"]
    assert {link.name for link in run.robot.model.frames if link.type == pin.BODY} - {"universe"} <= {
        part.split('"')[0] for part in text.split('<link name="')[1:]
    }
    assert said_of(tmp_path / "run.mcap") == {
        "title": "unicycle_2r with panda, DLS", "complete": "yes", "outcome": "completed", "why": "",
    }  # fmt: skip


def test_rerun_has_all_numbers_by_their_names(tmp_path: Path) -> None:
    run = run_of("mounted")
    found = by_rerun(stream(run, "rerun", tmp_path, start=1.7e9))
    for k, name in enumerate(run.robot.u_names):
        np.testing.assert_array_equal(column(found, f"/inputs/{name}", "Scalars:scalars"), run.u[:, k])
        (words,) = found[f"/inputs/{name}"]["SeriesLines:names"]
        assert words == [f"{name}, {run.robot.u_units[k]}"]
    for k, name in enumerate(run.r_names):
        np.testing.assert_array_equal(column(found, f"/error/{name}", "Scalars:scalars"), run.error[:, k])
    np.testing.assert_allclose(found["/inputs/v"]["t"], run.t, atol=1e-9)
    assert found["/inputs/v"]["time"] == [1_700_000_000 * 10**9 + round(1e9 * t) for t in run.t]
    strips = found["/world/path/driven/0"]["LineStrips3D:strips"]
    np.testing.assert_allclose(strips[-1][0], run.path, atol=1e-6)
    shapes = [one for one in found if "/visual_geometries/" in one]
    meshes = [one for one in shapes if "Asset3D:blob" in found[one]]
    files = [one for one in run.robot.visual_model.geometryObjects if Path(one.meshPath).is_absolute()]
    assert len(meshes) == len(files) > 7
    assert not [one for one in found if "tf_static" in one]  # each frame is moved from one place alone


def test_joints_of_a_corrected_robot_are_what_its_encoders_read(tmp_path: Path) -> None:
    """Swivels too, as in a log; links are where they are all the same."""
    pytest.importorskip("rosbags")
    from nmm.plugins.robot.ros.log import messages_of, typestore

    robot = nmm.with_numbers(nmm.load("car_base"), {"offset.steering": 0.05, "ratio.steering": 0.9})
    start = robot.q({"steering": 0.3})
    aim = nmm.Task(nmm.Position(robot.frames[-1], "xy"), [1.0, 0.4])
    run = nmm.simulate(nmm.Controller(robot, aim, nmm.DampedLeastSquares()), start, 0.5, 0.05)
    found = by_foxglove(stream(run, "foxglove", tmp_path))
    told = messages_of(run, nmm.ros.Messages(robot, typestore().types))
    logged = [message for _, topic, message in told if topic == "/joint_states"]
    for k in (0, len(run) - 1):
        states = {one.name: one.position for one in found["/joint_states"][k][1].joints}
        assert states == dict(zip(logged[k].name, logged[k].position.tolist(), strict=True))
        steering = float(run.q[k, robot.q_names.index("steering")])
        assert states["steering"] == pytest.approx((steering - 0.05) / 0.9)
        read = robot.swivel_readings(run.q[k], np.zeros(robot.n))
        assert len(read) == 2
        for name, (angle, _) in read.items():
            assert states[name] == pytest.approx(angle)
        links_are_where_they_are(robot, run.q[k], frames_of_foxglove(found, k), "odom", 1e-9)
    assert robot.q_from({name: states[name] for name in read}, (0, 0, 0))[3] == pytest.approx(steering)


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_a_fixed_base_has_no_odometry(tool: str, tmp_path: Path) -> None:
    run = run_of("fixed")
    file = stream(run, tool, tmp_path)
    if tool == "foxglove":
        found = by_foxglove(file)
        assert "/odom" not in found
        assert len(found["/tf"]) == len(run)
    else:
        assert "Arrows3D:vectors" not in {
            name for name, rows in by_rerun(file)["/world/odometry"].items() if rows
        }


def test_what_odometry_believes_is_beside_the_truth(tmp_path: Path) -> None:
    run = run_of("odometry")
    assert run.believed is not None
    found = by_foxglove(stream(run, "foxglove", tmp_path))
    believed = [message.pose.position for _, message in found["/believed_pose"]]
    np.testing.assert_array_equal([(one.x, one.y) for one in believed], run.believed[:, :2])
    assert np.abs(run.believed - run.q).max() > 0.01
    assert {message.frame_id for _, message in found["/believed_pose"]} == {"map"}
    base = by_rerun(stream(run, "rerun", tmp_path))["/world/odometry"]["Arrows3D:origins"]
    np.testing.assert_allclose([row[0][:2] for row in base], run.believed[:, :2], atol=1e-6)


def test_distances_are_lines_where_something_is_near(tmp_path: Path) -> None:
    """And none where it is not: no number of them is NaN."""
    run = run_of("obstacles")
    points = run.clearance_points.copy()
    points[3:6], pairs, far = np.nan, run.clearance_pairs.copy(), run.clearance.copy()
    pairs[3:5], far[3:5] = -1, np.inf  # nothing is near; then a bound alone is known
    run = replace(run, clearance_points=points, clearance_pairs=pairs, clearance=far)
    found = by_foxglove(stream(run, "foxglove", tmp_path))
    drawn = dict(found["/nearest"])
    stamps = [round(1e9 * t) for t in run.t]
    for k, stamp in enumerate(stamps):
        if k in (4, 5):
            assert stamp not in drawn
        elif k == 3:
            assert drawn[stamp].deletions
            assert not drawn[stamp].entities
        else:
            (entity,) = drawn[stamp].entities
            ends = [(one.x, one.y, one.z) for one in entity.lines[0].points]
            np.testing.assert_allclose(ends, run.clearance_points[k].reshape(2, 3), atol=1e-12)
            assert WALL in entity.texts[0].text or "ball" in entity.texts[0].text
    known = [k for k in range(len(run)) if k not in (3, 4)]
    distances = [message["distance"] for _, message in found["/distance"]]
    np.testing.assert_array_equal(distances, run.clearance[known])

    rerun = by_rerun(stream(run, "rerun", tmp_path))
    lines = rerun["/world/nearest"]["LineStrips3D:strips"]
    assert [len(row) for row in lines] == [0 if k in (3, 4, 5) else 1 for k in range(len(run))]
    assert np.isfinite([end for row in lines for line in row for end in line]).all()
    assert len(rerun["/distance"]["Scalars:scalars"]) == len(known)


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_names_are_as_they_are(tool: str, tmp_path: Path) -> None:
    run = run_of("obstacles")
    file = stream(run, tool, tmp_path)
    if tool == "foxglove":
        entities = [one for _, update in by_foxglove(file)["/scene"] for one in update.entities]
        assert f"obstacle {WALL}" in {one.id for one in entities}
    else:
        rr = pytest.importorskip("rerun")
        found = by_rerun(file)
        assert str(rr.new_entity_path(["world", "obstacles", WALL])) in found
        assert [one for one in found if one.startswith("/world/obstacles/")] == [
            one for one in found if one.count("obstacles") == 1 and "/obstacles/" in one
        ]
        row = str(rr.new_entity_path(["error", run.r_names[0]]))
        active = np.isfinite(run.error[:, 0])
        assert 0 < active.sum() < len(run)
        np.testing.assert_array_equal(column(found, row, "Scalars:scalars"), run.error[active, 0])


def test_obstacles_stand_and_move(tmp_path: Path) -> None:
    run = run_of("obstacles")
    found = by_foxglove(stream(run, "foxglove", tmp_path))
    begin = int(found["/scene"][0][0])
    assert begin == 0
    places = {}
    assert len(found["/scene"]) == 2  # what stands is not sent again with what moves
    assert [one.id for one in found["/scene"][1][1].deletions] == ["obstacle ball"]
    assert {one.id for one in found["/scene"][1][1].entities} == {f"obstacle {WALL}", "targets"}
    for one in found["/scene"][0][1].entities:
        if one.id == "obstacle ball":
            places[begin] = one.triangles[0].pose.position.y
    (moving,) = [update.entities for _, update in found["/moving/ball"]]  # its surface is sent once
    assert [one.frame_id for one in moving] == ["obstacle ball"]
    assert moving[0].triangles[0].pose.position.y == 0.0
    for stamp, tree in found["/tf"]:
        for one in tree.transforms:
            if one.child_frame_id == "obstacle ball":
                places[stamp] = one.translation.y
    expected = [1.0 - t for t in run.t]
    np.testing.assert_allclose([places[round(1e9 * t)] for t in run.t], expected, atol=1e-9)
    box = next(one for one in found["/scene"][0][1].entities if WALL in one.id).triangles[0]
    corners = np.array([(one.x, one.y, one.z) for one in box.points])
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.2, 1.0, 1.0])
    assert any("floor" in message.message for _, message in found["/log"])
    rerun = by_rerun(stream(run, "rerun", tmp_path))["/world/obstacles/ball"]
    np.testing.assert_allclose(
        [row[0][1] for row in rerun["InstancePoses3D:translations"]], expected, atol=1e-6
    )


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_a_load_is_where_it_is_carried(tool: str, tmp_path: Path) -> None:
    """From the first picture on; one that rests is not sent again, its surface never."""
    from nmm.model.robots.surroundings import Surroundings

    run, at = run_of("obstacles"), np.eye(4)
    at[:3, 3] = 0.1, 0.0, 0.05
    tray = nmm.playback.Carried("tray", nmm.Box([0.2, 0.3, 0.02]).geometry(), "ee", at)
    run = replace(run, surroundings=Surroundings(carried=(tray,)))
    places = [(nmm.Configuration(run.robot, q).placement("ee").homogeneous @ at)[:3, 3] for q in run.q]
    moved = [places[k] for k in range(len(run)) if k == 0 or (places[k] != places[k - 1]).any()]
    assert 2 < len(moved) < len(run)
    file, seen = stream(run, tool, tmp_path), list[Any]()
    if tool == "rerun":
        rows = by_rerun(file)["/world/obstacles/tray"]["InstancePoses3D:translations"]
        seen = [row[0] for row in rows]
    else:
        found = by_foxglove(file)
        (first,) = [one for one in found["/scene"][0][1].entities if one.id == "obstacle tray"]
        assert len(found["/moving/tray"]) == 1
        trees = [{one.child_frame_id: one for one in tree.transforms} for _, tree in found["/tf"]]
        told = [tree["obstacle tray"].translation for tree in trees if "obstacle tray" in tree]
        rows = [(one.x, one.y, one.z) for one in (first.triangles[0].pose.position, *told)]
        seen = [row for k, row in enumerate(rows) if k == 0 or row != rows[k - 1]]
    np.testing.assert_allclose(seen, moved, atol=1e-6)


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_events_and_findings_are_told_at_their_times(tool: str, tmp_path: Path) -> None:
    found = Finding("said", {"text": "the door is open"}, {"t": 0.35})
    run = replace(run_of("obstacles"), verdict=Verdict(warnings=((found,),)))
    file = stream(run, tool, tmp_path)
    if tool == "foxglove":
        told = [(1e-9 * stamp, one.name, one.message, one.level) for stamp, one in by_foxglove(file)["/log"]]
    else:
        log = by_rerun(file)["/log"]
        words = column({"/log": log}, "/log", "TextLog:text"), column({"/log": log}, "/log", "TextLog:level")
        told = [(t, text, text, level) for t, text, level in zip(log["t"], *words, strict=True)]
    at = {t: (name, text, level) for t, name, text, level in told}
    events = {event.what: event for event in run.events}
    assert {*events} == {"begins", "ends"}
    for what, event in events.items():
        name, text, _ = next(value for t, value in at.items() if abs(t - event.t) < 1e-8)
        assert ODD in name
        assert what in text
    (t,) = [t for t, _, text, _ in told if "the door is open" in text]
    assert t == pytest.approx(0.35)
    assert [text for t, _, text, _ in told if "completed" in text]


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_a_run_that_broke_off_is_told_incomplete(tool: str, tmp_path: Path) -> None:
    run = replace(
        run_of("mounted"), verdict=Verdict(Outcome.INTERRUPTED, (Finding("said", {"text": "somebody came"}),))
    )
    file = stream(run, tool, tmp_path)
    if tool == "foxglove":
        said = said_of(file)
        assert (said["complete"], said["outcome"], said["why"]) == ("no", "interrupted", "somebody came")
    else:
        about = by_rerun(file)["/__properties/nmm"]
        assert (about["complete"], about["why"]) == ([["no"]], [["somebody came"]])


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_what_breaks_off_leaves_what_was_there(
    tool: str, error: type[BaseException], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, made = run_of("mounted"), []
    if tool == "rerun":
        pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
    from nmm.plugins.streams.robot_scene import RobotScene

    picture = RobotScene.picture

    def breaks(scene: RobotScene, sample: Any) -> Any:
        made.append(sample)
        if len(made) == 5:
            raise error
        return picture(scene, sample)

    monkeypatch.setattr(RobotScene, "picture", breaks)
    file = tmp_path / f"run{ending(tool)}"
    file.write_text("what was there")
    with pytest.raises(error):
        nmm.stream(run, tool, file=file)
    assert file.read_text() == "what was there"
    assert [*tmp_path.iterdir()] == [file]


@pytest.mark.parametrize(("tool", "most"), [("foxglove", 3000), ("rerun", 200_000), ("rerun", -3000)])
def test_a_full_disk_is_an_error_and_leaves_what_was_there(tool: str, most: int, tmp_path: Path) -> None:
    """Also where the disk is full just before the end."""
    import resource

    run, file = run_of("mounted"), tmp_path / f"run{ending(tool)}"
    whole = stream(run, tool, tmp_path).stat().st_size
    most = most if most > 0 else whole + most  # sizes differ by less
    file.write_text("what was there")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
        with pytest.raises(nmm.RunError, match="cannot be written"):
            nmm.stream(run, tool, file=file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    assert file.read_text() == "what was there"
    assert [*tmp_path.iterdir()] == [file]


def test_fewer_samples_are_shown_on_request(tmp_path: Path) -> None:
    run = run_of("mounted")
    shown = nmm.stream(run, "foxglove", file=tmp_path / "run.mcap", rate=10.0)
    times = [1e-9 * stamp for stamp, _ in by_foxglove(tmp_path / "run.mcap")["/tf"]]
    np.testing.assert_allclose(times, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5], atol=1e-9)
    assert (shown.sent, shown.dropped, shown.trouble) == (6, 0, "")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"to": "vlc"}, "unknown tool 'vlc'"),
        ({"to": "foxglove", "file": "run.rrd"}, "ends in .mcap"),
        ({"to": "foxglove", "file": "run.mcap", "port": 8765}, "a file or a port"),
        ({"to": "foxglove", "port": 70000}, "up to 65535"),
        ({"to": "foxglove", "start": 1.0}, "times are the clock's"),
        ({"to": "foxglove", "file": "run.mcap", "start": -1.0}, "start"),
        ({"to": "foxglove", "file": "run.mcap", "rate": 0.0}, "rate"),
        ({"to": "foxglove", "file": "no/such/folder/run.mcap"}, "cannot be written"),
    ],
)
def test_bad_input_is_one_error(
    options: dict[str, Any], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(nmm.InputError, match=said):
        nmm.stream(run_of("mounted"), **options)
    with pytest.raises(nmm.InputError, match="a Loop or a Trajectory"):
        nmm.stream("run", "foxglove")  # type: ignore[arg-type]
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(("tool", "package"), [("rerun", "rerun-sdk"), ("foxglove", "foxglove-sdk")])
def test_without_its_package_a_tool_says_what_to_install(
    tool: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nmm.plugins.streams.tools.find_spec", lambda name: None)
    with pytest.raises(nmm.InputError) as caught:
        nmm.stream(run_of("mounted"), tool, file=tmp_path / f"run{ending(tool)}")
    assert str(caught.value).endswith(f"pip install {package}")
    assert [*tmp_path.iterdir()] == []
