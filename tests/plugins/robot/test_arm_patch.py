"""A URDF corrected for an arm: its joints' values are what encoders read, and its links where they are."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from odd_arm import KEYWORDS, odd_arm
from places import DATA, PANDA, UR5
from second_urdf import read_by_yourdfpy
from urdf_parts import write

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.loading.description import describe
from nmm.model.robots.loading.source import source_path
from nmm.model.robots.origins import arm_joints, movable_frames
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm_patch import rpy_near

THOROUGH = [
    "kinova_description/robots/kinova.urdf",
    "so_arm_description/urdf/so101.urdf",
    "tiago_description/robots/tiago.urdf",
    "pr2_description/urdf/pr2.urdf",
    "baxter_description/urdf/baxter.urdf",
]


def file_of(name: str, folder: Path) -> tuple[Path, dict[str, Any]]:
    """The file of a robot as URDF, and how it is loaded."""
    if name == "odd":
        return write(folder / "odd.urdf", odd_arm().replace("><", ">\n<")), KEYWORDS
    if name == "odd names":  # which give way to the platform's
        text = odd_arm().replace("><", ">\n<").replace('"spin"', '"v"').replace('"camera"', '"theta"')
        return write(folder / "odd.urdf", text), KEYWORDS
    if name.endswith(".urdf"):
        return source_path(name, ()), {"missing_meshes": "skip"}
    return write(folder / f"{name}.urdf", describe(source_path(name, ())).xml.replace("><", ">\n<")), {}


def others(robot: Robot, frames: int, seed: int = 1) -> dict[str, float]:
    """Other values of all numbers of the arm, of some frames, and of every other ratio -1."""
    rng, values = np.random.default_rng(seed), dict[str, float]()
    arm = {*arm_joints(robot)}
    chosen = [*movable_frames(robot)][:: max(1, len(movable_frames(robot)) // frames)]
    for name, number in nmm.robot_numbers(robot, chosen).items():
        if number.kind == "origin" or (number.kind == "offset" and number.of in arm):
            values[name] = float(rng.uniform(-0.05, 0.05))
        elif number.kind == "ratio" and number.of in arm and rng.uniform() < 0.5:
            values[name] = -1.0
    return values


def assert_posed_alike(changed: Robot, corrected: Robot, text: str, atol: float) -> None:
    """Links, at what encoders read, by nmm and by yourdfpy."""
    other, n_p = read_by_yourdfpy(text), changed.platform.n_p
    new, old = changed.renamed, {name: own for own, name in changed.renamed.items()}
    rng, root = np.random.default_rng(2), other.base_link
    assert corrected.q_names == changed.q_names
    for _ in range(3):
        read = rng.uniform(*np.clip(corrected.q_limits, -3.0, 3.0).T)
        read[:n_p] = 0.0
        read = corrected.following.placed(read)
        q = read.copy()
        for i, name in enumerate(changed.q_names[n_p:], n_p):
            factor, offset = changed.gear(name)
            q[i] = factor * read[i] + offset
        q = changed.following.placed(q)
        values = {**corrected.locked, **dict(zip(corrected.q_names, read, strict=True))}
        values = {old.get(name, name): value for name, value in values.items()}
        other.update_cfg({name: values.get(name, 0.0) for name in other.actuated_joint_names})
        wanted, found = nmm.Configuration(changed, q), nmm.Configuration(corrected, read)
        links = [link for link in other.link_map if new.get(link, link) in changed.frames]
        assert len(links) > len(changed.q_names) - n_p
        for link in links:
            own = new.get(link, link)
            place = (wanted.placement(root).inverse() * wanted.placement(own)).homogeneous
            by_nmm = (found.placement(root).inverse() * found.placement(own)).homogeneous
            np.testing.assert_allclose(by_nmm, place, rtol=0, atol=atol)
            np.testing.assert_allclose(other.get_transform(link, root), place, rtol=0, atol=atol)


def bare(line: str) -> str:
    """Without what may change, and elements that may be added."""
    line = re.sub(r""" (xyz|rpy|multiplier|offset)=("[^"]*"|'[^']*')""", "", line)
    return re.sub(r"<(origin|axis) ?/>", "", line).strip()


@pytest.mark.parametrize(
    "name",
    [
        "odd", "odd names", "small_arm", "unicycle_pan_tilt", UR5, PANDA,
        *(pytest.param(DATA + file, marks=pytest.mark.thorough) for file in THOROUGH),
    ],
)  # fmt: skip
def test_the_corrected_file_has_links_where_they_are(name: str, tmp_path: Path) -> None:
    file, keywords = file_of(name, tmp_path)
    robot = nmm.load(file, **keywords)
    values = others(robot, 5)
    patch = nmm.description_patch(robot, values, **keywords)
    assert patch.left == {}, patch.left
    assert {*patch.written} == {*values}
    folder = tmp_path / "corrected"
    folder.mkdir()
    corrected, diff = patch.save(folder)
    found, changed = nmm.load(corrected, **keywords), nmm.with_numbers(robot, values)
    assert found.changed_numbers == {}
    assert_posed_alike(changed, found, patch.text, 1e-8)
    # limits are what encoders read
    for i, joint in enumerate(robot.q_names[robot.platform.n_p :], robot.platform.n_p):
        read = sorted(changed.reading(joint, end) for end in changed.q_limits[i])
        np.testing.assert_allclose(found.q_limits[i], read, rtol=0, atol=1e-8)
    # but for origins, axes and what mimic joints follow, no line has changed
    before, after = (path.read_text(encoding="utf-8") for path in (file, corrected))
    assert len(before.splitlines()) == len(after.splitlines())
    pairs = [*zip(before.splitlines(), after.splitlines(), strict=True)]
    assert all(bare(one) == bare(other) for one, other in pairs)
    lines = sum(one != other for one, other in pairs)
    assert diff.read_text("utf-8").count("\n+") == lines + 1


def test_one_number_changes_one_line(tmp_path: Path) -> None:
    file, _ = file_of("small_arm", tmp_path)
    robot = nmm.load(file)
    for name, value, wanted in (
        ("offset.q1", 0.1, 'rpy="0 0 0.1"'),
        ("origin.q2.x", -0.002, 'xyz="-0.002 0 '),
        ("origin.ee.z", 0.01, "0.1"),
        ("ratio.q3", -1.0, '<axis xyz="0 -1 0"/>'),
    ):
        patch = nmm.description_patch(robot, {name: value})
        (line,) = [line for line in patch.diff.splitlines() if line.startswith("+") and line[1] != "+"]
        assert wanted in line
        assert nmm.description_patch(nmm.with_numbers(robot, {name: value})).text == patch.text


def test_what_a_file_cannot_say_stays(tmp_path: Path) -> None:
    file, _ = file_of("unicycle_pan_tilt", tmp_path)
    robot = nmm.load(file)
    values = {"ratio.pan": 1.02, "offset.pan": 0.03, "ratio.tilt": -1.0, "origin.camera_joint.yaw": 0.02}
    learned = nmm.CalibrationFile.of(robot, values, dict.fromkeys(values, 0.001))
    patch = nmm.description_patch(nmm.load(file, calibration=learned))
    assert {*patch.left} == {"ratio.pan"}
    assert "1 and -1" in patch.left["ratio.pan"]
    assert {*patch.written} == {"offset.pan", "ratio.tilt", "origin.camera_joint.yaw"}
    rest = patch.calibration(learned)
    assert dict(rest.numbers) == {"ratio.pan": nmm.Calibrated(1.0, 1.02, 0.001)}
    assert [*rest.places] == ["pan"]
    assert {*learned.places} == {"pan", "tilt", "camera_joint"}
    assert nmm.CalibrationFile.of(robot, {"track": 0.41, "radius.left_wheel_joint": 0.11}).places == {}
    folder = tmp_path / "corrected"
    folder.mkdir()
    corrected, _ = patch.save(folder)
    whole, changed = nmm.load(corrected, calibration=rest), nmm.load(file, calibration=learned)
    for wrong, other in ((learned, corrected), (rest, file)):  # nothing is corrected twice, or for another
        with pytest.raises(InputError) as error:
            nmm.load(other, calibration=wrong)
        assert "its file has changed: " in str(error.value)
    read = {"pan": 0.3, "tilt": -0.2}
    places = []
    for other in (whole, changed):
        q = other.q_from(read, (0.0, 0.0, 0.0))
        places.append(nmm.Configuration(other, q).placement("camera_optical_frame").homogeneous)
    np.testing.assert_allclose(places[0], places[1], rtol=0, atol=1e-8)


def test_a_xacro_s_arm_stays_in_one_line() -> None:
    robot = nmm.load("small_arm")
    values = others(robot, 3)
    patch = nmm.description_patch(nmm.with_numbers(robot, values))
    assert {*patch.left} == {*values}
    assert (patch.text, patch.arguments, patch.written) == ("", {}, ())
    (line,) = str(patch).splitlines()
    assert line.startswith(f"{len(values)} numbers stay in calibration.yaml: ")
    assert "and" in line
    assert len(line) < 200
    learned = nmm.CalibrationFile.of(robot, values)
    assert dict(patch.calibration(learned).numbers) == dict(learned.numbers)


@pytest.mark.parametrize("pitch", [0.5 * math.pi, -0.5 * math.pi, 0.5 * math.pi - 1e-9, 1.5707, 0.3, -2.8])
def test_rotations_are_written_as_the_file_would(pitch: float) -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        near = np.array([rng.uniform(-7.0, 7.0), pitch, rng.uniform(-7.0, 7.0)])
        by = pin.exp3(rng.normal(size=3) * 10.0 ** rng.uniform(-9.0, 0.0))
        rotation = by @ pin.rpy.rpyToMatrix(near)
        way = rpy_near(rotation, near)
        np.testing.assert_allclose(pin.rpy.rpyToMatrix(way), rotation, rtol=0, atol=1e-12)
        if abs(math.cos(pitch)) > 0.1:  # where they can be told apart
            assert np.abs(way - near).max() < 15.0 * np.linalg.norm(pin.log3(by)) + 1e-9
