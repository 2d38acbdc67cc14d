"""What another reader of URDF makes of files: yourdfpy, which shares no code with Pinocchio or nmm."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from places import UR5
from second_urdf import read_by_yourdfpy
from thinned import thinned
from urdf_parts import inertial, joint, link, random_tree, robot, write

import nmm
from nmm.base.bundled import bundled_robots
from nmm.model.robots.loading.check import inspect
from nmm.model.robots.loading.description import describe
from nmm.model.robots.loading.packages import package_file

#: Largest difference of placements, m and of rotation matrices' entries.
SAME = 1e-6
URDF = UR5
ROBOTS = package_file(URDF).parents[2]


def differing(file: Path) -> list[str]:
    """Links that nmm and yourdfpy place differently in the root link, with every joint moved at random."""
    robot = nmm.load(file, platform="fixed", missing_meshes="skip")
    lower, upper = np.clip(robot.q_limits.T, -1.0, 1.0)
    q = robot.following.placed(np.random.default_rng(1).uniform(lower, upper))
    values = {**robot.locked, **dict(zip(robot.q_names, q, strict=True))}
    other = read_by_yourdfpy(describe(file).xml)
    other.update_cfg({name: values.get(name, 0.0) for name in other.actuated_joint_names})
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)

    def apart(name: str) -> float:
        ours = data.oMf[robot.model.getFrameId(name, pin.FrameType.BODY)].homogeneous
        return float(np.abs(ours - other.get_transform(name)).max())

    return [name for name in other.link_map if apart(name) > SAME]


@pytest.mark.parametrize("name", sorted(bundled_robots()))
def test_bundled_robots_are_read_alike(name: str) -> None:
    assert differing(bundled_robots()[name]) == []


STRANGERS = sorted(ROBOTS.glob("*/*/*.urdf"))


def test_there_are_strangers_robots() -> None:
    assert len(STRANGERS) > 30


@pytest.mark.parametrize(
    "file", thinned(STRANGERS, lambda file: file in STRANGERS[::4]), ids=lambda file: file.stem
)
def test_strangers_robots_are_read_alike(file: Path) -> None:
    if inspect(file.read_text(encoding="utf-8"), lambda _: None)[1]:
        with pytest.raises(nmm.RobotError):
            nmm.load(file, missing_meshes="skip")
        return
    assert differing(file) == []


def test_random_trees_are_read_alike(tmp_path: Path) -> None:
    for seed in range(5):
        text = random_tree(np.random.default_rng(seed), 12)
        assert differing(write(tmp_path / "tree.urdf", text)) == []


def test_a_reader_that_reads_something_else_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = yourdfpy.URDF.load

    def moved(file: io.BytesIO, **options: object) -> yourdfpy.URDF:
        return load(io.BytesIO(file.read().replace(b'xyz="0.1 0.2 0.3"', b'xyz="0.1 0.2 0.4"')), **options)

    monkeypatch.setattr(yourdfpy.URDF, "load", moved)
    text = robot(link("a", inertial()), link("b", inertial()), joint())
    assert differing(write(tmp_path / "robot.urdf", text)) == ["b"]
