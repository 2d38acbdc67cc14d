"""A loop whose measurements come from a `PoseFilter`, streamed with the filter's corrections."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from loop_faults import PERIOD
from streamed import by_foxglove, by_rerun, frames_of_foxglove, frames_of_rerun, placement

import nmm
from nmm.base.arrays import Array

pytest.importorskip("foxglove")
pytest.importorskip("mcap_protobuf")
STEPS, FIXED = 40, 20


def pose_of(place: Array) -> Array:
    """x, y, theta of (4, 4)."""
    return np.array([*place[:2, 3], np.arctan2(place[1, 0], place[0, 0])])


def driven(tool: str, file: Path, **options: Any) -> tuple[list[Array], list[Array], list[Array], Any]:
    """A differential base that drives straight, with one fix aside: what its filter says at each step (map,
    odom, map to odom), and the stream."""
    robot = nmm.load("differential_base")
    task = nmm.Task(nmm.Position(robot.frames[-1], "xy"), [3.0, 0.0], gain=1.0)
    limits = nmm.Limits({"platform": 0.5})
    loop = nmm.Loop(nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits), PERIOD)
    still = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
    known = np.diag([0.01, 0.01, 0.25])
    filtered = nmm.PoseFilter(robot, robot.rest, still, 0.0, covariance=known, spread=1e-4)
    said: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    with nmm.stream(loop, tool, file=file, rate=1000.0, start=0.0, **options) as shown:
        for k in range(STEPS):
            t = (k + 1) * PERIOD
            filtered.update(dict.fromkeys(still, 0.04 * k), t)
            if k == FIXED:
                x, y, theta = filtered.pose
                filtered.fix([x, y + 0.02, theta + 0.03], np.diag([1e-6, 1e-6, 1e-6]), t=t)
            loop.step(t, filtered)
            shown(loop)
            for rows, one in zip(said, (loop.q[:3], filtered.odom, filtered.map_to_odom), strict=True):
                rows.append(one)
    return *said, shown


@pytest.mark.parametrize("tool", ["foxglove", "rerun"])
def test_fixes_move_odom_in_the_map(tool: str, tmp_path: Path) -> None:
    if tool == "rerun":
        pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
    file = tmp_path / ("loop.rrd" if tool == "rerun" else "loop.mcap")
    in_map, in_odom, corrections, shown = driven(tool, file, localised=True)
    assert shown.trouble == ""
    found: Any = by_foxglove(file) if tool == "foxglove" else by_rerun(file)
    at = frames_of_foxglove if tool == "foxglove" else frames_of_rerun
    atol = 1e-9 if tool == "foxglove" else 1e-6
    assert np.linalg.norm(corrections[-1] - corrections[0]) > 0.02
    for k in (0, FIXED - 1, FIXED, STEPS - 1):
        frames = at(found, k)
        base = next(name for name, one in frames.items() if one.parent == "odom" and name != "odom")
        np.testing.assert_allclose(pose_of(frames["odom"].at.homogeneous), corrections[k], atol=atol)
        np.testing.assert_allclose(pose_of(frames[base].at.homogeneous), in_odom[k], atol=atol)
        np.testing.assert_allclose(pose_of(placement(frames, base, "map")), in_map[k], atol=atol)
    if tool == "foxglove":
        told = [message.pose.position for _, message in found["/odom"]][:STEPS]
        np.testing.assert_allclose([(one.x, one.y) for one in told], np.array(in_odom)[:, :2], atol=1e-9)
        driven_path = found["/paths"][-1][1].entities
        assert {one.frame_id for one in driven_path} == {"map"}


def test_without_it_the_stream_says_that_fixes_move_the_robot(tmp_path: Path) -> None:
    file = tmp_path / "loop.mcap"
    in_map, _, _, _ = driven("foxglove", file)
    found = by_foxglove(file)
    frames = frames_of_foxglove(found, STEPS - 1)
    base = next(name for name, one in frames.items() if one.parent == "odom")
    np.testing.assert_allclose(pose_of(frames[base].at.homogeneous), in_map[-1], atol=1e-9)
    told = [message.message for _, message in found["/log"]]
    assert len([one for one in told if "localised=True" in one]) == 1


def test_only_a_loop_with_a_platform_is_localised(tmp_path: Path) -> None:
    arm = nmm.load(pin.buildSampleModelManipulator(), platform="fixed")
    task = nmm.Task(nmm.Position(arm.frames[-1]), [0.3, 0.2, 0.2])
    loop = nmm.Loop(nmm.Controller(arm, task, nmm.DampedLeastSquares()), PERIOD)
    with pytest.raises(nmm.InputError, match=r"localised.*a platform that moves"):
        nmm.stream(loop, "foxglove", file=tmp_path / "run.mcap", localised=True)
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run()
    with pytest.raises(nmm.InputError, match=r"localised.*a loop"):
        nmm.stream(run, "foxglove", file=tmp_path / "run.mcap", localised=True)
    assert [*tmp_path.iterdir()] == []
