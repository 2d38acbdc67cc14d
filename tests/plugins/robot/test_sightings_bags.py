"""Sightings from bags: where the arm stands, beside what a topic or TF has of what is seen."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from command_line import refused
from helpers import simulated_sightings as sim
from places import UR5
from robot_logs import FIRST, STORE, Sent, bag, bag_of_ros1, header, joints, odom, tf, transform, wheeled
from scipy.spatial.transform import Rotation

import nmm
from nmm.base.errors import InputError

Array = np.ndarray
START = 1.7e9
#: How long the arm goes and stands, s.
GOES, STANDS = 0.6, 1.4
HAND = "tool0"


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> sim.Arm:
    return sim.Arm(sim.TRUTH, tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def touched(arm: sim.Arm) -> nmm.Sightings:
    return sim.points(arm, sim.postures(12))


@pytest.fixture(scope="module")
def captured(arm: sim.Arm) -> nmm.Sightings:
    return sim.poses(arm, sim.postures(12))


def between(rows: Array, t: Array, stands: float = STANDS) -> Array:
    """Rows (N, ...) of postures (K, ...) that are stood in and gone between: places in a straight line, turns
    all at once."""
    k, since = np.divmod(t, GOES + stands)
    k = np.clip(k.astype(int), 0, len(rows) - 1)
    share = np.clip((since - stands) / GOES, 0.0, 1.0)
    after = rows[np.minimum(k + 1, len(rows) - 1)]
    if rows.ndim == 3:
        made = np.where(share[:, np.newaxis, np.newaxis] < 0.5, rows[k], after)
        made[:, :3, 3] = rows[k, :3, 3] + share[:, np.newaxis] * (after - rows[k])[:, :3, 3]
        return made
    return rows[k] + share[:, np.newaxis] * (after - rows[k])


def states(log: nmm.Sightings, rate: float = 50.0, stands: float = STANDS, **more: Any) -> list[Sent]:
    t = np.arange(0.0, len(log) * (GOES + stands) - GOES, 1.0 / rate)
    rows = between(np.column_stack([*log.readings.values()]), t, stands)
    return [
        (START + now, "/joint_states", joints(START + now, dict(zip(log.readings, row, strict=True)), **more))
        for now, row in zip(t.tolist(), rows.tolist(), strict=True)
    ]


def looks(
    log: nmm.Sightings,
    made: Callable[..., Any],
    topic: str = "/seen",
    late: float = 0.0,
    rate: float = 40.0,
    **more: Any,
) -> list[Sent]:
    """What is seen, stamped late."""
    t = np.arange(0.0, len(log) * (GOES + STANDS) - GOES, 1.0 / rate)
    return [
        (START + now + late, topic, made(START + now + late, row, **more))
        for now, row in zip(t.tolist(), between(log.seen, t), strict=True)
    ]


def point(t: float, row: Array, frame: str = "tracker") -> Any:
    at = STORE.types["geometry_msgs/msg/Point"](*(float(x) for x in row))
    return STORE.types["geometry_msgs/msg/PointStamped"](header=header(t, frame), point=at)


def _turned(row: Array, store: Any = STORE) -> Any:
    return store.types["geometry_msgs/msg/Quaternion"](*Rotation.from_matrix(row[:3, :3]).as_quat().tolist())


def _pose(row: Array) -> Any:
    at = STORE.types["geometry_msgs/msg/Point"](*row[:3, 3].tolist())
    return STORE.types["geometry_msgs/msg/Pose"](position=at, orientation=_turned(row))


def stamped(t: float, row: Array, frame: str = "hall") -> Any:
    return STORE.types["geometry_msgs/msg/PoseStamped"](header=header(t, frame), pose=_pose(row))


def _covered(row: Array) -> Any:
    return STORE.types["geometry_msgs/msg/PoseWithCovariance"](pose=_pose(row), covariance=np.zeros(36))


def covered(t: float, row: Array, frame: str = "hall") -> Any:
    kind = STORE.types["geometry_msgs/msg/PoseWithCovarianceStamped"]
    return kind(header=header(t, frame), pose=_covered(row))


def placed(t: float, row: Array, frame: str = "hall", child: str = "marker", store: Any = STORE) -> Any:
    made = transform(t, frame, child, row[:3, 3], store=store)
    made.transform.rotation = _turned(row, store)
    return made


def odometry(t: float, row: Array, frame: str = "hall", child: str = "marker") -> Any:
    made = odom(t, (0.0, 0.0, 0.0), frame=frame, child=child)
    made.pose = _covered(row)
    return made


def in_tf(t: float, row: Array, store: Any = STORE, **names: str) -> Any:
    return tf(placed(t, row, store=store, **names), store=store)


def read(file: Path, reference: str | None = "seen", **options: Any) -> nmm.Sightings:
    given = {"robot": sim.ur5(), "on": HAND} | options
    return nmm.Sightings.from_bag(file, reference=reference, **given)


def expect_same(found: nmm.Sightings, log: nmm.Sightings) -> None:
    assert (found.kind, [*found.readings], len(found)) == (log.kind, [*log.readings], len(log))
    for name, values in log.readings.items():
        np.testing.assert_allclose(found.readings[name], values, atol=1e-9)
    np.testing.assert_allclose(found.seen, log.seen, atol=1e-9)


@pytest.mark.parametrize("late", [0.0, 0.2, -0.2])
@pytest.mark.parametrize("mcap", [True, False])
def test_a_posture_is_where_the_arm_stands(
    late: float, mcap: bool, tmp_path: Path, touched: nmm.Sightings
) -> None:
    """Of an arm that goes on and on, with a tracker that is a fifth of a second late or early."""
    file = bag(tmp_path, states(touched, rate=100.0) + looks(touched, point, late=late), mcap=mcap)
    found = read(file)
    expect_same(found, touched)
    assert (found.name, found.on, found.by, found.target) == (file.name, HAND, "world", "point")


@pytest.mark.parametrize("made", [stamped, covered, placed, odometry])
def test_what_is_seen_is_any_topic_of_poses(
    made: Callable[..., Any], tmp_path: Path, captured: nmm.Sightings
) -> None:
    expect_same(read(bag(tmp_path, states(captured) + looks(captured, made))), captured)


def test_what_is_seen_is_a_frame_in_tf(tmp_path: Path, captured: nmm.Sightings) -> None:
    """Of two markers that which is named, also below another, and from the tracker's housing."""
    other = nmm.Sightings("other", captured.readings, captured.seen[::-1], "poses", on=HAND)
    still = placed(START, sim.matrix(([0.1, 0.2, 0.3], [0.3, 0.2, 0.1])), "hall", "lens")
    below = placed(START, sim.matrix(([0.0, 0.1, 0.0], [0.0, 0.2, 0.0])), "marker", "plate")
    file = bag(
        tmp_path,
        [
            *states(captured),
            *looks(captured, in_tf, "/tf"),
            *looks(other, in_tf, "/tf", child="marker_2", rate=30.0),
            (START, "/tf_static", tf(still, below)),
        ],
    )
    expect_same(read(file, "hall:marker"), captured)
    expect_same(read(file, "hall:marker_2"), other)
    whole = np.linalg.inv(sim.matrix(([0.1, 0.2, 0.3], [0.3, 0.2, 0.1]))) @ captured.seen
    whole = whole @ sim.matrix(([0.0, 0.1, 0.0], [0.0, 0.2, 0.0]))
    expect_same(read(file, "lens:plate"), nmm.Sightings("", captured.readings, whole, "poses", on=HAND))


def test_a_namespace_a_prefix_and_ros_1(tmp_path: Path, captured: nmm.Sightings) -> None:
    sent = [(t, f"/r1{topic}", message) for t, topic, message in states(captured, store=FIRST)]
    for _, _, message in sent:
        message.name = [f"r1/{name}" for name in message.name]
    sent += looks(captured, in_tf, "/tf", store=FIRST, frame="/hall", child="/r1/marker")
    found = read(bag_of_ros1(tmp_path, sent), "hall:marker", namespace="r1", prefix="r1/", name="first")
    expect_same(found, captured)
    assert found.name == "first"


def test_a_camera_on_the_arm_sees_a_marker(tmp_path: Path, captured: nmm.Sightings) -> None:
    """Its frame, which the file has, is what messages speak of."""
    seen = nmm.Sightings("", captured.readings, captured.seen, "poses", on="world", by=HAND, sensor="eye")
    file = bag(tmp_path, states(captured) + looks(captured, stamped, frame=HAND))
    found = nmm.Sightings.from_bag(file, sim.ur5(), "world", HAND, "seen", sensor="eye")
    expect_same(found, seen)
    assert (found.by, found.sensor, found.target) == (HAND, "eye", "body")


def test_numbers_learned_are_those_of_the_table(tmp_path: Path, arm: sim.Arm) -> None:
    log = sim.points(arm, sim.postures(25))
    rows = np.column_stack([*log.readings.values(), log.seen])
    table = tmp_path / "touched.csv"
    np.savetxt(table, rows, "%.17g", ",", header=",".join([*sim.UR5, *"xyz"]), comments="")
    of_table = nmm.Sightings.from_csv(table, sim.ur5(), HAND, units="SI")
    of_bag = read(bag(tmp_path, states(log) + looks(log, point, late=0.1)))
    found = [nmm.calibrate(sim.ur5(), each, hold="origin") for each in (of_table, of_bag)]
    assert found[0].learned == found[1].learned
    for name, number in found[0].numbers.items():
        assert found[1].numbers[name].after == pytest.approx(
            number.after, abs=1e-3 * number.deviation + 1e-12
        )


def test_noise_is_averaged_and_outliers_are_not(tmp_path: Path, captured: nmm.Sightings) -> None:
    """Encoders that flicker by one of 1024 counts of 300°, a marker that is taken for another one now and
    then, looks with noise."""
    rng = np.random.default_rng(3)
    sent = states(captured)
    for _, _, message in sent:
        message.position += np.radians(300.0) / 1024 * rng.integers(0, 2, 6)
    seen = looks(captured, stamped)
    for k, (_, _, message) in enumerate(seen):
        at, turn = message.pose.position, message.pose.orientation
        at.x += 2e-4 * rng.normal()
        if k % 5 == 0:
            at.x, turn.x, turn.y, turn.z, turn.w = at.x + 0.4, 0.0, 0.0, 0.0, 1.0
    found = read(bag(tmp_path, sent + seen))
    assert len(found) == len(captured)
    np.testing.assert_allclose(found.seen[:, :3, :3], captured.seen[:, :3, :3], atol=1e-9)
    assert 0.0 < np.abs(found.seen - captured.seen).max() < 2e-4
    for name, values in captured.readings.items():
        np.testing.assert_allclose(found.readings[name], values + np.radians(150.0) / 1024, atol=2e-3)


def test_joints_without_end_go_on_where_they_begin_anew(tmp_path: Path) -> None:
    robot = wheeled(tmp_path, kind="continuous")
    turns = {"j1": np.pi + np.linspace(-0.2, 0.2, 5), "j2": np.linspace(-1.0, 1.0, 5)}
    log = nmm.Sightings("log", turns, np.column_stack([turns["j2"]] * 3), "points", on="a2")
    sent = states(log)
    for k, (_, _, message) in enumerate(sent):
        message.position[0] += 1e-3 * (k % 2) - 5e-4
        message.position[0] = np.remainder(message.position[0] + np.pi, 2 * np.pi) - np.pi
    found = nmm.Sightings.from_bag(bag(tmp_path, sent + looks(log, point)), robot, "a2", reference="seen")
    turned = found.readings["j1"] - turns["j1"]
    np.testing.assert_allclose(turned, np.round(turned[0] / (2 * np.pi)) * 2 * np.pi, atol=1e-4)


def told(file: Path, **options: Any) -> tuple[nmm.Sightings, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = read(file, **options)
    assert all(one.filename == __file__ for one in caught)
    return found, [str(one.message).removeprefix(f"{file.name}: ") for one in caught]


def test_postures_that_tell_nothing_are_left_out_with_a_warning(
    tmp_path: Path, touched: nmm.Sightings
) -> None:
    """The beam is broken in two; the hand is pushed in a third, and in the fourth a joint creeps on."""
    cycle = GOES + STANDS
    seen = [one for one in looks(touched, point) if not 3 * cycle - GOES < one[0] - START < 5 * cycle - GOES]
    for t, _, message in seen:
        if 6 * cycle - GOES < t - START < 7 * cycle - GOES:
            message.point.x += 0.01 * (t - START - 6 * cycle)
    sent = states(touched, stands=STANDS)
    for t, _, message in sent:
        since = t - START - 8 * cycle
        if -GOES < since < STANDS + GOES:
            message.position[2] += 0.009 * min(max(since, 0.0), STANDS)
    found, warned = told(bag(tmp_path, sent + seen))
    assert warned == [
        "2 postures of 12 left out: nothing is seen",
        "1 posture of 12 left out: what is seen moves",
        "1 posture of 12 left out: joints creep on",
    ]
    kept = [0, 1, 2, 5, 7, 9, 10, 11]
    np.testing.assert_allclose(found.seen, touched.seen[kept], atol=1e-9)


def test_stamps_of_zero_are_those_of_recording(tmp_path: Path, touched: nmm.Sightings) -> None:
    sent = states(touched)
    for _, _, message in sent:
        message.header = header(0.0, "")
    found, warned = told(bag(tmp_path, sent + looks(touched, point)))
    assert warned == ["/joint_states has stamps of 0: it goes by the times of recording"]
    expect_same(found, touched)


def errs(file: Path, reference: str | None = "seen", **options: Any) -> str:
    given = {"on": HAND, "by": "world"} | options
    with pytest.raises(InputError) as caught:
        nmm.Sightings.from_bag(file, given.pop("robot", sim.ur5()), reference=reference, **given)
    text = str(caught.value)
    assert len(text) <= 300
    assert file.name in text
    return text


def test_what_no_bag_of_sightings_has_is_named(tmp_path: Path, captured: nmm.Sightings) -> None:
    mine, seen = states(captured), looks(captured, stamped, "/mocap/hand")
    file = bag(tmp_path, [*mine, *seen, *looks(captured, in_tf, "/tf")])
    text = errs(file, None)
    assert "reference: expected what saw it: a topic of poses or points, or FRAME:CHILD of TF" in text
    assert "available: /mocap/hand (geometry_msgs/msg/PoseStamped)" in text
    assert "poses or points on /mocap/hnd, or FRAME:CHILD of TF; available: /mocap/h" in errs(
        file, "mocap/hnd"
    )
    assert "poses or points on /joint_states" in errs(file, "joint_states")
    assert "poses or points on /tf" in errs(file, "tf")
    assert "unknown frame 'markr' (did you mean 'marker'?)" in errs(file, "hall:markr")
    assert "reference hall:hall: it is one frame" in errs(file, "hall:hall")
    assert "reference hall:: expected FRAME:CHILD of TF" in errs(file, "hall:")
    assert "a topic of sensor_msgs/msg/JointState on /other" in errs(file, "mocap/hand", joints="other")
    assert "unknown frame 'hand'" in errs(file, "mocap/hand", on="hand")
    assert "robot: expected a Robot" in errs(file, "mocap/hand", robot="ur5")
    assert "reference: expected a topic" in errs(file, 5)  # type: ignore[arg-type]
    assert "a topic of tf2_msgs/msg/TFMessage on /tf" in errs(bag(tmp_path, mine + seen), "hall:marker")
    some = nmm.Sightings("", {n: captured.readings[n] for n in sim.UR5[:4]}, captured.seen, "poses", on=HAND)
    text = errs(bag(tmp_path, states(some) + seen), "mocap/hand")
    assert "no position of wrist_2_joint, wrist_3_joint on /joint_states" in text
    assert "available: shoulder_pan_joint" in text
    (tmp_path / "none.mcap").write_bytes(b"nothing")
    assert "it lacks its end" in errs(tmp_path / "none.mcap")


def test_two_markers_on_one_topic_are_told_apart_nowhere(tmp_path: Path, captured: nmm.Sightings) -> None:
    two = looks(captured, placed) + looks(captured, placed, child="other", rate=30.0)
    text = errs(bag(tmp_path, states(captured) + two))
    assert "poses in several frames on one topic; available: marker in hall, other in hall" in text


def test_messages_that_speak_of_another_frame_are_refused(tmp_path: Path, captured: nmm.Sightings) -> None:
    mine = states(captured)
    of_hand = bag(tmp_path, mine + looks(captured, stamped, frame=HAND))
    assert "by: world sees, and messages speak of tool0; expected by='tool0'" in errs(
        of_hand, on="wrist_1_link"
    )
    of_other = bag(tmp_path, mine + looks(captured, placed, child="forearm_link"))
    assert "on: tool0 is seen, and messages speak of forearm_link" in errs(of_other)
    fixed = bag(tmp_path, mine + looks(captured, stamped, frame="base_link"))
    assert len(read(fixed)) == len(captured)
    lens = bag(tmp_path, mine + looks(captured, stamped, frame="ee_link"))
    assert "messages speak of ee_link; expected by='ee_link'" in errs(lens, on="world", by="wrist_3_link")


def test_what_the_robot_s_own_joints_tell_is_refused(tmp_path: Path, captured: nmm.Sightings) -> None:
    mine = states(captured)
    own = looks(captured, in_tf, "/tf", frame="base_link", child=HAND)
    still = [(START, "/tf_static", tf(placed(START, np.eye(4), HAND, "marker")))]
    text = errs(bag(tmp_path, [*mine, *own, *still]), "base_link:marker")
    assert "its way goes by the robot's own joints, base_link → tool0, as encoders count them" in text
    text = errs(bag(tmp_path, [*mine, *own, *still]), "tool0:marker", on="world", by=HAND, sensor="eye")
    assert "tool0 → marker never changes" in text
    apart = [(START, "/tf", tf(placed(START, np.eye(4), "hall", "marker")))]
    assert "no transforms connect them" in errs(bag(tmp_path, [*mine, *own, *apart]), "base_link:marker")


def test_an_arm_that_does_not_stand_is_refused(tmp_path: Path, touched: nmm.Sightings) -> None:
    seen = looks(touched, point)
    text = errs(bag(tmp_path, states(touched, stands=0.4) + seen))
    assert "joint states: the arm stands nowhere: " in text
    assert "expected all joints still for a second in each posture" in text
    once = states(touched, rate=1.0 / (GOES + STANDS))
    assert "they come every 2 s: whether the arm stands is not to be seen" in errs(bag(tmp_path, once + seen))
    few = nmm.Sightings(
        "", {n: v[:3] for n, v in touched.readings.items()}, touched.seen[:3], "points", on=HAND
    )
    text = errs(bag(tmp_path, states(few) + looks(few, point)[:90]))
    assert "the arm stands and is seen in 1 posture, in 2 more nothing is seen; expected three" in text
    slow = states(touched)
    for k, (_, _, message) in enumerate(slow):
        message.position[:] = 1e-4 * k
    assert "in 1 more joints creep on" in errs(bag(tmp_path, slow + seen))


def test_clocks_that_are_apart_are_refused(tmp_path: Path, touched: nmm.Sightings) -> None:
    text = errs(bag(tmp_path, states(touched) + looks(touched, point, late=1.0)))
    assert "reference /seen: what is seen moves in 11 of 12 postures in which the joints stand" in text
    assert "expected stamps of one clock, to 0.25 s" in text
    text = errs(bag(tmp_path, states(touched) + looks(touched, point, late=3.2e8)))
    assert "what is seen is stamped 3.2e+08 to 3.2e+08 s, joint states are 0 to 23.4 s" in text
    assert "expected stamps of one clock, to 0.25 s" in text
    two = [one for one in states(touched) if one[0] < START + 3.0]
    for _, _, message in two[:50]:
        message.name, message.position = message.name[:3], message.position[:3]
    for _, _, message in two[50:]:
        message.name, message.position = message.name[3:], message.position[3:]
    assert "joints are at no time known together" in errs(bag(tmp_path, two + looks(touched, point)))


def test_a_platform_that_moves_is_refused(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    turns = {"j1": np.linspace(-1.0, 1.0, 6), "j2": np.linspace(-0.5, 1.0, 6)}
    log = nmm.Sightings("log", turns, np.column_stack([turns["j2"]] * 3), "points", on="a2")
    sent = states(log) + looks(log, point)
    goes = [(t, "/odom", odom(t, (0.02 * (t - START), 0.0, 0.0))) for t, *_ in states(log)]
    stands = [(t, "/odom", odom(t, (0.7, 0.0, 0.1))) for t, *_ in states(log)]
    text = errs(bag(tmp_path, sent + goes), robot=robot, on="a2")
    assert "the platform moved by 0.205 m and 0 rad between postures; expected one that stands" in text
    made = nmm.Sightings.from_bag(bag(tmp_path, sent + stands), robot, "a2", reference="seen")
    assert len(made) == 6
    on_it = nmm.Sightings.from_bag(bag(tmp_path, sent + goes), robot, "a2", "base_link", "seen", sensor="t")
    assert len(on_it) == 6


def of_wheels(folder: Path) -> tuple[nmm.model.robots.robot.Robot, nmm.Sightings]:
    robot = wheeled(folder)
    turns = {"j1": np.linspace(-1.0, 1.0, 6), "j2": np.linspace(-0.5, 1.0, 6)}
    return robot, nmm.Sightings("log", turns, np.column_stack([turns["j2"]] * 3), "points", on="a2")


@pytest.mark.parametrize("stamped_at", [lambda t: 0.0, lambda t: t - 1e8], ids=["zero", "another clock"])
def test_a_platform_that_moves_by_another_clock_is_refused(
    stamped_at: Callable[[float], float], tmp_path: Path
) -> None:
    robot, log = of_wheels(tmp_path)
    times = [t for t, *_ in states(log)]
    sent = states(log) + looks(log, point)
    goes = [(t, "/odom", odom(stamped_at(t), (0.02 * (t - START), 0.0, 0.0))) for t in times]
    assert "the platform moved by 0.2" in errs(bag(tmp_path, sent + goes), robot=robot, on="a2")
    in_tree = [
        (t, "/tf", tf(transform(stamped_at(t), "odom", "base_link", (0.02 * (t - START), 0.0))))
        for t in times
    ]
    assert "the platform moved by 0.2" in errs(bag(tmp_path, sent + in_tree), robot=robot, on="a2")


def test_what_of_a_platform_is_little_or_not_told_is_said(tmp_path: Path) -> None:
    robot, log = of_wheels(tmp_path)
    times = [t for t, *_ in states(log)]
    sent = states(log) + looks(log, point)

    def warned(more: list[Sent]) -> str:
        found, said = told(bag(tmp_path, sent + more), robot=robot, on="a2")
        assert len(found) == 6
        return "; ".join(said)

    assert warned([(t, "/odom", odom(t, (0.7, 0.0, 0.1))) for t in times]) == ""
    slow = [(t, "/odom", odom(t, (0.0005 * (t - START), 0.0, 0.0))) for t in times]
    assert warned(slow) == (
        "the platform moved by up to 0.0051 m and 0 rad between postures: what is seen is off by as much, "
        "unless that is noise"
    )
    short = [(t, "/odom", odom(t, (0.01 * (t - START), 0.0, 0.0))) for t in times if t < START + 3.0]
    assert warned(short).startswith("nothing tells where the platform was in 4 postures of 6")
    assert warned([]).startswith("nothing tells whether the platform stood (no transforms from map or odom")
    two = [(t, "/odom", odom(t, (0.0, 0.0, 0.0), child=child)) for t in times for child in ("base_link", "b")]
    assert warned(two) == "nothing tells whether the platform stood (odometry of several frames on one topic)"


def test_frames_and_topics_of_odometry_that_are_not_there_are_named(tmp_path: Path) -> None:
    robot, log = of_wheels(tmp_path)
    more = [(t, "/odom", odom(t, (0.0, 0.0, 0.0))) for t, *_ in states(log)]
    more += [(START, "/tf_static", tf(transform(START, "map", "odom", (0.0, 0.0))))]
    file = bag(tmp_path, states(log) + looks(log, point) + more)
    given = {"robot": robot, "on": "a2"}
    assert "odometry: expected a topic of nav_msgs/msg/Odometry on /odm; available: /odom" in errs(
        file, odometry="odm", **given
    )
    assert "tf: expected a topic of tf2_msgs/msg/TFMessage on /tfs" in errs(file, tf="tfs", **given)
    assert "base: unknown frame 'base_lnk'" in errs(file, base="base_lnk", **given)
    assert "map: unknown frame 'nomap'" in errs(file, map="nomap", **given)
    assert "odom: unknown frame 'odm' (did you mean 'odom'?)" in errs(file, odom="odm", **given)
    assert len(read(file, robot=robot, on="a2", base="base_link")) == 6


def test_an_arm_that_hangs_stands(tmp_path: Path, captured: nmm.Sightings) -> None:
    hangs = sim.matrix(([0.0, 0.0, 2.0], [np.pi, 0.0, 0.0]))
    sent = states(captured) + looks(captured, stamped)
    for topic in ("/tf_static", "/tf"):
        held = [(START, topic, tf(placed(START, hangs, "map", "base_link")))]
        expect_same(read(bag(tmp_path, sent + held)), captured)


@pytest.mark.parametrize("rate", [40.0, 30.0])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_two_markers_on_one_topic_that_names_none_are_refused(
    rate: float, noise: float, tmp_path: Path, captured: nmm.Sightings
) -> None:
    rng = np.random.default_rng(1)
    moved = captured.seen @ sim.matrix(([0.2, 0.0, 0.0], [0.0, 0.0, 1.0]))
    other = nmm.Sightings("other", captured.readings, moved, "poses", on=HAND)
    two = looks(captured, stamped) + looks(other, stamped, late=0.0125, rate=rate)
    for _, _, message in two:
        message.pose.position.x += noise * rng.normal()
    text = errs(bag(tmp_path, states(captured) + two))
    assert "reference /seen: what is seen is in two places by turns in 12 of 12 postures" in text
    assert "expected one marker on a topic" in text


def test_clocks_are_compared_by_the_times_of_recording(tmp_path: Path, touched: nmm.Sightings) -> None:
    """A delay of a whole cycle has the arm stand where it stood before."""

    def sent(ahead: float, rate: float = 40.0) -> Path:
        seen = [(t - ahead, *one) for t, *one in looks(touched, point, late=ahead, rate=rate)]
        return bag(tmp_path, states(touched) + seen)

    for ahead, apart in ((GOES + STANDS, "2"), (-3.2e8, "3.2e+08")):
        assert f"stamps of /seen and of joint states are {apart} s apart" in errs(sent(ahead))
    found, warned = told(sent(-0.4))
    assert warned[0].startswith("stamps of /seen and of the joint states are 0.4 s apart, by when they came")
    found, warned = told(sent(0.1))
    assert warned == []
    expect_same(found, touched)


def test_few_looks_in_a_posture_are_said_and_not_believed(tmp_path: Path, touched: nmm.Sightings) -> None:
    found, warned = told(bag(tmp_path, states(touched) + looks(touched, point, rate=2.0)))
    assert len(warned) == 1
    assert "what is seen comes fewer than 6 times" in warned[0]
    expect_same(found, touched)
    late = looks(touched, point, rate=2.0, late=1.0)
    assert "what is seen moves in" in errs(bag(tmp_path, states(touched) + late))


def test_what_tells_nothing_of_a_target_that_is_hidden_is_left_out(
    tmp_path: Path, captured: nmm.Sightings, touched: nmm.Sightings
) -> None:
    seen = looks(captured, stamped)
    seen[100][2].pose.position.x = np.nan
    for k in (200, 201):
        turn = seen[k][2].pose.orientation
        turn.x = turn.y = turn.z = turn.w = 0.0
    found, warned = told(bag(tmp_path, states(captured) + seen))
    expect_same(found, captured)
    assert warned == [
        "3 messages of /seen without a pose left out: numbers that are none, or a quaternion of zeros"
    ]
    seen = looks(touched, point)
    seen[100][2].point.x = np.nan
    found, warned = told(bag(tmp_path, states(touched) + seen))
    expect_same(found, touched)
    assert warned[0].startswith("1 message of /seen without a pose left out")
    for _, _, message in seen:
        message.point.x = np.nan
    assert "reference /seen: all are without a pose, or a point" in errs(
        bag(tmp_path, states(touched) + seen)
    )
    seen = looks(captured, in_tf, "/tf")
    for k in (0, 100):
        turn = seen[k][2].transforms[0].transform.rotation
        turn.x = turn.y = turn.z = turn.w = 0.0
    found, warned = told(bag(tmp_path, states(captured) + seen), reference="hall:marker")
    expect_same(found, captured)
    assert warned[0].startswith("2 messages of hall → marker without a pose left out")


@pytest.mark.parametrize("times", [np.arange(0.0, 24.0), np.array([3.0])], ids=["1 Hz", "once"])
def test_what_never_changes_is_held_however_seldom_it_is_told(
    times: Array, tmp_path: Path, captured: nmm.Sightings
) -> None:
    rng = np.random.default_rng(2)
    seen = looks(captured, in_tf, "/tf")
    for _, _, message in seen:
        message.transforms[0].transform.translation.x += 1e-3 * rng.normal()
    still = sim.matrix(([0.1, 0.2, 0.3], [0.3, 0.2, 0.1]))
    held = [(START + t, "/tf", tf(placed(START + t, still, "lens", "hall"))) for t in times.tolist()]
    fixed = [(START, "/tf_static", tf(placed(START, still, "lens", "hall")))]
    of_each = [read(bag(tmp_path, states(captured) + seen + more), "lens:marker") for more in (held, fixed)]
    np.testing.assert_allclose(of_each[0].seen, of_each[1].seen, atol=1e-9)


def test_transforms_of_another_topic_need_no_platform(tmp_path: Path, captured: nmm.Sightings) -> None:
    file = bag(tmp_path, states(captured) + looks(captured, in_tf, "/seen/tf"))
    expect_same(read(file, "hall:marker", tf="/seen/tf"), captured)


def test_a_marker_that_two_cameras_see_is_told(tmp_path: Path, captured: nmm.Sightings) -> None:
    both = [looks(captured, in_tf, "/tf", frame=name, rate=rate) for name, rate in (("a", 40.0), ("b", 30.0))]
    still = tf(*(placed(START, np.eye(4), "hall", name) for name in "ab"))
    file = bag(tmp_path, [*states(captured), *both[0], *both[1], (START, "/tf_static", still)])
    _, warned = told(file, reference="hall:marker")
    assert warned == ["marker has several parents in TF: a and b; read is a → marker"]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, arm: sim.Arm) -> Path:
    """A folder with touched.csv and a bag of the same, touched.mcap."""
    folder = tmp_path_factory.mktemp("files")
    log = sim.points(arm, sim.postures(25))
    rows = np.column_stack([*log.readings.values(), log.seen])
    np.savetxt(folder / "touched.csv", rows, "%.17g", ",", header=",".join([*sim.UR5, *"xyz"]), comments="")
    seen = [one for one in looks(log, point) if one[0] < START + 24 * (GOES + STANDS) - GOES]
    made = bag(folder, states(log) + seen, mcap=True)
    (made / f"{made.name}.mcap").rename(folder / "touched.mcap")
    return folder


def run(captured: pytest.CaptureFixture[str], *arguments: str) -> Any:
    result = refused(captured, "calibrate", UR5, *arguments)
    assert "Traceback" not in result.err
    assert all(len(line) <= 300 for line in result.err.splitlines())
    return result


def test_the_command_takes_bags(
    files: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(files)
    given = ("--seen-on", HAND, "--hold", "origin", "--json")
    of_bag = run(capsys, "touched.mcap", "--reference", "seen", *given, "--out", "by_bag")
    assert of_bag.status == 0
    assert of_bag.err.startswith("warning: touched.mcap: 1 posture of 25 left out: nothing is seen\n")
    told = json.loads(of_bag.out)
    assert told["logs"] == ["touched.mcap"]
    both = run(
        capsys, "touched.mcap", "touched.csv", "--reference", "seen", *given, "--units", "SI", "--out", "2"
    )
    assert both.status == 0
    two = json.loads(both.out)
    for name, true in sim.TRUTH.items():
        if name.startswith("offset"):
            for one in (told, two):
                number = one["numbers"][name]
                assert abs(number["after"] - true) < 0.3 * abs(true) + 4.0 * number["deviation"]


def test_one_bag_with_two_references_is_two_logs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arm: sim.Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = sim.points(arm, sim.postures(25))
    both = looks(log, point, "/seen") + looks(log, point, "/seen_too", rate=30.0)
    file = bag(tmp_path, states(log) + both).name
    given = ("--seen-on", HAND, "--hold", "origin", "--json", "--out", "two")
    result = run(capsys, file, file, "--reference", "seen", "--reference", "seen_too", *given)
    assert result.status == 0
    assert json.loads(result.out)["logs"] == [file, f"{file} (2)"]
    result = run(capsys, file, file, "--reference", "seen", *given)
    assert f"{file}: expected each log once" in result.err


REFUSED = [
    (
        ("touched.mcap", "--reference", "seen", "--odometry", "odm"),
        "--odometry: expected a topic of nav_msgs",
    ),
    (("touched.mcap", "--reference", "seen", "--map", "nomap"), "--map: unknown frame 'nomap'"),
    (("touched.mcap", "--reference", "seen", "--base", "nobase"), "--base: unknown frame 'nobase'"),
    (("touched.mcap",), "touched.mcap: --reference: expected what saw it: a topic of poses or points"),
    (("touched.mcap", "--reference", "sen"), "--reference: expected poses or points on /sen"),
    (("touched.mcap", "--reference", "seen", "--units", "SI"), "--units: it is of tables"),
    (("touched.mcap", "--reference", "seen", "--seen-by", "bas"), "--seen-by: unknown frame 'bas'"),
    (("touched.mcap", "--reference", "seen", "--board", "9x6:0.03"), "--board: a bag has no corners"),
    (("touched.mcap", "--reference", "seen", "--wrapped", "all"), "--wrapped: it is of drives"),
    (("touched.csv", "--units", "SI", "--reference", "seen"), "--reference: it is of bags"),
    (("touched.csv", "--units", "SI", "--joints", "states"), "--joints: it is of bags"),
    (("touched.mcap", "--reference", "a", "--reference", "b"), "--reference: expected one, or one for each"),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED)
def test_what_the_command_refuses(
    arguments: tuple[str, ...],
    message: str,
    files: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(files)
    result = run(capsys, *arguments, "--seen-on", HAND, "--out", "not_made")
    assert result.status != 0
    assert message in result.err
    assert not (files / "not_made").exists()
