"""Logs in what Rerun makes of them and what Foxglove's package reads. Both are large (650 MB together, with
what they need): pip install -e '.[test,streams]'; docs/ros.md says what they draw."""

from __future__ import annotations

from collections import defaultdict
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, get_args, get_type_hints

import numpy as np
import pinocchio as pin
import pytest
from gripping_cart import cart
from places import PANDA, UR5
from test_robot_description import mesh_beside
from urdf_parts import joint, link, robot, shape, write

import nmm
from nmm.plugins.robot.ros.description import packaged

STRUCTS = {"/odom": "Odometry", "/path": "Path", "/desired_path": "Path", "/cmd_vel": "TwistStamped"}


def driven(made: nmm.model.robots.robot.Robot, folder: Path) -> tuple[nmm.Trajectory, Path]:
    """A run on a robot whose platform and arm move; the log begins in this century."""
    frame = "panda_hand" if "panda_hand" in made.frames else "grasp" if "grasp" in made.frames else "ee"
    start = made.following.placed(np.clip(np.linspace(0.1, 0.5, made.n), *made.q_limits.T))
    at = nmm.Configuration(made, start).placement(frame).translation
    aim = nmm.Task(nmm.Position(frame), at + np.array([0.3, 0.1, 0.0]))
    run = nmm.simulate(nmm.Controller(made, aim, nmm.DampedLeastSquares()), start, 0.5, 0.05)
    assert np.ptp(run.q, axis=0).max() > 0.01
    return run, run.save_mcap(folder / "run.mcap", start=1.7e9)


@pytest.fixture(params=["mounted", "mimic", "trailers"])
def logged(request: Any, tmp_path: Path) -> tuple[nmm.Trajectory, Path]:
    made = {
        "mounted": lambda: nmm.mount("unicycle_2r", PANDA, at="arm_base"),
        "mimic": lambda: nmm.load(cart(tmp_path / "cart.urdf", mimic=True)),
        "trailers": lambda: nmm.mount("trailer_base", "unicycle_2r", prefix="arm_"),
    }[request.param]()
    if request.param == "trailers":
        aim = nmm.Task(nmm.Posture("v") if "v" in made.q_names else nmm.Posture(made.q_names[-1]), [0.4])
        run = nmm.simulate(nmm.Controller(made, aim, nmm.ProjectedGradient()), made.rest, 0.5, 0.05)
        return run, run.save_mcap(tmp_path / "run.mcap", start=1.7e9)
    return driven(made, tmp_path)


def by_rerun(path: Path) -> dict[str, list[dict[str, Any]]]:
    """What Rerun's own reader of MCAP makes of a log: by entity, its tables of columns."""
    chunk, found = pytest.importorskip("rerun.chunk"), defaultdict(list)
    for one in chunk.McapReader(path).stream():
        found[one.entity_path].append(one.to_record_batch().to_pydict())
    return found


def column(tables: list[dict[str, Any]], name: str) -> list[Any]:
    return [one[0] if isinstance(one, list) else one for table in tables for one in table.get(name, [])]


def test_rerun_draws_the_robot_where_it_is(
    logged: tuple[nmm.Trajectory, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each visual is on a link's frame, and TF leads to each link. Rerun keeps 32 bits of a number."""
    run, path = logged
    folders = {folder for folder, _ in packaged(run.robot).values()}
    monkeypatch.setenv("ROS_PACKAGE_PATH", ":".join(folders))
    found, parents = by_rerun(path), dict[str, tuple[str, Any]]()
    drawn = {one: tables for one, tables in found.items() if "/visual_geometries/" in one}
    forms = ("Boxes3D:half_sizes", "Cylinders3D:radii", "Ellipsoids3D:half_sizes", "Asset3D:blob")
    for tables in drawn.values():
        assert any(column(tables, form) for form in forms)
    on = {frame for tables in drawn.values() for frame in column(tables, "CoordinateFrame:frame")}
    k, rows = len(run) - 1, found["/tf"] + found["/tf_static"]
    names = ("child_frame", "parent_frame", "translation", "quaternion")
    columns = [column(rows, f"Transform3D:{name}") for name in names]
    for child, parent, place, turn in zip(*columns, strict=True):
        at = pin.XYZQUATToSE3(np.r_[place, turn])
        assert parents.get(child, (parent,))[0] == parent
        parents[child] = parent, at  # the last of the run stays
    assert on <= {*parents}
    here = nmm.Configuration(run.robot, run.q[k])
    model, turning = run.robot.display_model, {one for wheel in run.robot.wheels for one in wheel.joints}
    for frame in [one.name for one in model.frames if one.type == pin.BODY][1:]:
        assert frame in parents
        at, above = pin.SE3.Identity(), frame
        while above != "odom":
            above, step = parents[above]
            at = step * at
        supports = model.supports[model.frames[model.getFrameId(frame)].parentJoint]
        if not turning & {model.names[j] for j in supports}:
            np.testing.assert_allclose(at.homogeneous, here.placement(frame).homogeneous, atol=2e-6)


def test_rerun_makes_of_each_topic_what_the_page_says(logged: tuple[nmm.Trajectory, Path]) -> None:
    run, path = logged
    found = by_rerun(path)
    for topic, kind in STRUCTS.items():
        if topic in found:
            assert any(name.endswith(f".{kind}:message") for table in found[topic] for name in table)
    for topic in ("/base_pose", *(["/end_effector_pose"] if run.frame else [])):
        assert len(column(found[topic], "InstancePoses3D:translations")) == len(run)
    for topic in ("/joint_states/position", "/inputs/velocity"):
        assert len(column(found[topic], "Scalars:scalars")) == len(run)
    assert not [name for table in found["/joint_states"] for name in table if "Transform3D" in name]


def test_rerun_needs_the_packages_of_meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It reads one that lies beside the robot's file as it is, blanks and letters included."""
    plate = robot(link("a", shape(mesh_beside(tmp_path))), link("b"), joint())
    made = nmm.mount(nmm.load(UR5, platform="fixed"), write(tmp_path / "plate.urdf", plate), at="ee_link")
    aim = nmm.Task(nmm.Posture("elbow_joint"), [0.1])
    run = nmm.simulate(nmm.Controller(made, aim, nmm.ProjectedGradient()), made.rest, 0.1, 0.05)
    path = run.save_mcap(tmp_path / "run.mcap")
    folders, counts = {folder for folder, _ in packaged(made).values()}, []
    for text in ("", ":".join(folders)):
        monkeypatch.setenv("ROS_PACKAGE_PATH", text)
        found = by_rerun(path)
        counts.append(sum(bool(column(tables, "Asset3D:blob")) for tables in found.values()))
    assert counts == [1, len(made.visual_model.geometryObjects)]
    assert counts[1] > 7


class Local:
    """Where foxglove-sdk reads recordings from: files here."""

    def open(self, location: Any) -> IO[bytes]:
        return open(location.path, "rb")


def test_foxgloves_package_reads_every_message(logged: tuple[nmm.Trajectory, Path]) -> None:
    """By its own reader of MCAP files; its settings can have TF or JointStates move the URDF."""
    datasets = pytest.importorskip("foxglove.datasets")
    layouts, decoder = pytest.importorskip("foxglove.layouts"), pytest.importorskip("mcap_ros2.decoder")
    run, path = logged
    begin, end = (datetime.fromtimestamp(at, UTC) for at in (1.6e9, 1.8e9))
    episode = SimpleNamespace(
        id="run", start_time=begin, end_time=end, metadata={},
        locations=(datasets.ObjectLocation("", str(path)),),
    )  # fmt: skip
    topics = ("/robot_description", "/tf", "/joint_states", "/odom", "/base_pose", "/cmd_vel", "/inputs")
    read = datasets.EpisodeReader(episode, topics, None, Local())
    found = defaultdict(list)
    for _, channel, _, decoded in read.iter_messages(decoder_factories=[decoder.DecoderFactory()]):
        found[channel.topic].append(decoded)
    assert {topic: len(many) for topic, many in found.items()} == {
        topic: 1 if topic == "/robot_description" else len(run) for topic in topics
    }
    for k, one in enumerate(found["/inputs"]):
        np.testing.assert_array_equal(one.velocity, run.u[k])
    modes = get_type_hints(layouts.BaseRendererUrdfTopicSettings, vars(layouts))["control_mode"]
    assert {"transforms", "jointStates"} <= {one for each in get_args(modes) for one in get_args(each)}
