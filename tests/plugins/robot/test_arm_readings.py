"""What an arm's encoders read, and its drivers are told, where its joints have offsets and ratios."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from odd_arm import loaded
from second_urdf import read_by_yourdfpy

import nmm
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.description import description
from nmm.plugins.robot.ros.links import Links
from nmm.plugins.robot.ros.making import root_link

typesys = pytest.importorskip("rosbags.typesys")
TYPES = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).types

#: Turned around, shifted, geared, and placed otherwise.
VALUES = {
    "offset.arm.1": 0.2, "ratio.arm.1": -1.0, "offset.slide": -0.03, "ratio.spin": -1.0, "offset.spin": 1.1,
    "offset.finger": 0.004, "ratio.finger": -1.0, "origin.arm.1.yaw": 0.1, "origin.spin.x": 0.02,
    "origin.riser_joint.roll": 0.1, "origin.camera.pitch": -0.2,
}  # fmt: skip
GEARED = VALUES | {"ratio.slide": 0.5, "ratio.arm.1": -1.7}


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return loaded(tmp_path_factory.mktemp("odd") / "odd.urdf")


@pytest.fixture(scope="module")
def changed(odd: Robot) -> Robot:
    return nmm.with_numbers(odd, VALUES)


def somewhere(robot: Robot, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    q = rng.uniform(*np.clip(robot.q_limits, -3.0, 3.0).T)
    return robot.following.placed(q)


def test_encoders_say_coordinates_and_back(odd: Robot) -> None:
    changed = nmm.with_numbers(odd, GEARED)
    q = somewhere(changed)
    read = {name: changed.reading(name, q[changed.coordinate(name)]) for name in changed.q_names[3:]}
    for joint in ("arm.1", "slide", "spin", "finger"):
        ratio = changed.corrections.get(joint, (1.0, 0.0))[0]
        offset = GEARED.get(f"offset.{joint}", 0.0)
        assert ratio == GEARED.get(f"ratio.{joint}", 1.0)
        assert q[changed.coordinate(joint)] == pytest.approx(ratio * read[joint] + offset, abs=1e-14)
    np.testing.assert_allclose(changed.q_from(read, q[:3], near=q), q, rtol=0, atol=1e-14)
    del read["other"]  # it follows
    np.testing.assert_allclose(changed.q_from(read, q[:3], near=q), q, rtol=0, atol=1e-14)
    turned = {**read, "spin": read["spin"] + 4 * math.pi}
    np.testing.assert_allclose(changed.q_from(turned, q[:3], near=q), q, rtol=0, atol=1e-13)


def test_messages_have_what_encoders_read(odd: Robot) -> None:
    changed = nmm.with_numbers(odd, GEARED)
    messages, q = nmm.ros.Messages(changed, TYPES), somewhere(changed)
    u = np.array([0.3, -0.2, 0.5, 0.1, -0.7, 0.02])
    q_dot = changed.S(q) @ u
    state = messages.joint_state(0.0, q, q_dot)
    read = dict(zip(state.name, state.position, strict=True))
    assert read == {n: changed.reading(n, q[changed.coordinate(n)]) for n in changed.q_names[3:]}
    rates = nmm.ros.rates(state)
    assert rates["slide"] == pytest.approx(0.1 / 0.5)
    np.testing.assert_allclose(changed.q_from(nmm.ros.joints(state), q[:3], near=q), q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(nmm.ros.inputs(changed, q, [0.3, 0, -0.2], rates), u, rtol=0, atol=1e-12)


def test_trajectories_are_what_drivers_take(odd: Robot) -> None:
    changed = nmm.with_numbers(odd, GEARED)
    rows = np.array([somewhere(changed, seed) for seed in range(4)])
    rates = np.gradient(rows, axis=0)
    message = nmm.ros.Messages(changed, TYPES).joint_trajectory(np.arange(4.0), rows, rates)
    t, positions = nmm.ros.joint_trajectory(message)
    assert [*positions] == ["arm.1", "slide", "spin", "finger"]
    for k in range(len(t)):
        q = changed.q_from({name: row[k] for name, row in positions.items()}, rows[k, :3], near=rows[k])
        np.testing.assert_allclose(q, rows[k], rtol=0, atol=1e-14)
    at = changed.coordinate("arm.1")
    assert message.points[1].velocities[0] == pytest.approx(rates[1, at] / -1.7)


def test_the_description_is_posed_by_what_encoders_read(changed: Robot) -> None:
    """By yourdfpy: with offsets, axes the other way round, joints elsewhere, and one that follows another."""
    text, _ = description(changed, Links(changed, root_link(changed)))
    other = read_by_yourdfpy(text)
    for seed in range(3):
        q = somewhere(changed, seed)
        q[:3] = 0.0
        read = {name: changed.reading(name, q[changed.coordinate(name)]) for name in changed.q_names[3:]}
        other.update_cfg({name: read[name] for name in other.actuated_joint_names if name in read})
        at = nmm.Configuration(changed, q)
        for name in ("upper", "wrist", "hand", "left", "right", "camera", "optical", "lamp"):
            ours = (at.placement("base_link").inverse() * at.placement(name)).homogeneous
            np.testing.assert_allclose(other.get_transform(name, "base_link"), ours, rtol=0, atol=1e-9)
    limits = {name: (joint.limit.lower, joint.limit.upper) for name, joint in other.joint_map.items()
              if joint.type in ("revolute", "prismatic")}  # fmt: skip
    assert limits["arm.1"] == pytest.approx((-1.5, 2.0))
    assert limits["slide"] == pytest.approx((-0.1, 0.4))


def test_logs_of_an_arm_are_read_back(tmp_path: Path) -> None:
    values = {"offset.q1": 0.02, "ratio.q2": -1.5, "origin.q2.x": 0.01, "offset.q2": -0.1}
    learned = nmm.CalibrationFile.of(nmm.load("unicycle_2r"), values).save(tmp_path / "calibration.yaml")
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5, "robot.calibration": str(learned)})
    run = scenario.run()
    file = run.save_mcap(tmp_path / "run.mcap")
    read = nmm.read_bag(file, run.robot)
    np.testing.assert_allclose(read.q, run.q, rtol=0, atol=1e-9)
    plain = nmm.read_bag(file, nmm.load("unicycle_2r"))
    i = run.robot.coordinate("q2")
    np.testing.assert_allclose(-1.5 * plain.q[:, i] - 0.1, run.q[:, i], rtol=0, atol=1e-9)
    np.testing.assert_allclose(read.u, run.u, rtol=0, atol=1e-5)
