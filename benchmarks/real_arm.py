"""A calibration of a real arm: `python benchmarks/real_arm.py FOLDER`, a clone of
github.com/drliaowu/Minimal_Robot_Calibration_Using_Position, whose ABB IRB 120 was touched by a measuring arm
(L. Wu, X. Yang, K. Chen, H. Ren, A minimal POE-based model for robotic kinematic calibration with only
position measurements, IEEE Trans. Automation Science and Engineering 12, 2015): three points in 36 postures
to learn from, one point in 10 and another in 30 to judge by. Prints the numbers of docs/calibration.md.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
from scipy.io import loadmat

import nmm

#: Each joint's axis, and where it is at zero, m, as the maker draws them.
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
PLACES = np.array([[0, 0, 0], [0, 0, 0.29], [0, 0, 0.56], [0, 0, 0.63], [0.302, 0, 0.63], [0.302, 0, 0.63]])
JOINTS = [f"joint_{i}" for i in range(1, 7)]


def irb120() -> nmm.Robot:
    """The arm by its drawing, from a URDF."""
    text, parent = '<robot name="irb120"><link name="base_link"/>', "base_link"
    steps = np.diff(PLACES, axis=0, prepend=np.zeros((1, 3)))
    for joint, axis, step in zip(JOINTS, AXES, steps, strict=True):
        link, xyz = joint.replace("joint", "link"), " ".join(f"{x:.6g}" for x in step)
        text += f"""<link name="{link}"/><joint name="{joint}" type="revolute"><parent link="{parent}"/>
            <child link="{link}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>
            <limit lower="-7" upper="7" effort="1" velocity="3"/></joint>"""
        parent = link
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "irb120.urdf"
        file.write_text(text + "</robot>")
        return nmm.load(file)


def sightings(folder: Path, kind: str, places: np.ndarray, name: str) -> nmm.Sightings:
    """Places, mm, of one point on the hand, in postures."""
    (angles,) = [x for key, x in loadmat(folder / f"{kind}.mat").items() if not key.startswith("_")]
    readings = dict(zip(JOINTS, np.radians(angles).T, strict=True))
    return nmm.Sightings(name, readings, places / 1000.0, "points", on="link_6", target=name)


def off(robot: nmm.Robot, tracker: dict[str, float], tests: list[nmm.Sightings]) -> np.ndarray:
    """How far each test is off, mm, by a robot's numbers and a tracker's place; only where the points sit on
    the hand is fitted to them."""
    found = nmm.calibrate(robot, tests, hold={**tracker, "offset": None, "origin": None})
    left = [found.model.residuals(view, found.fit.values) for view in found.model.views]
    return 1000.0 * np.linalg.norm(np.concatenate(left), axis=1)


def main(folder: Path) -> None:
    robot = irb120()
    places = loadmat(folder / "CaliPosition.mat")["CaliPosition"]
    logs = [sightings(folder, "CaliJointAngles", places[k::3], f"point_{k + 1}") for k in range(3)]
    tests = [
        sightings(
            folder, f"TestJointAngles{k}", loadmat(folder / f"TestPosition{k}.mat")[f"TestPosition{k}"], name
        )
        for k, name in (("", "test_1"), ("2", "test_2"))
    ]
    learned, mounted = nmm.calibrate(robot, logs), nmm.calibrate(robot, logs, hold=("offset", "origin"))
    print(f"{len(logs)} points in {len(logs[0])} postures: {len(learned.learned)} numbers learned")
    for name in learned.learned:
        number = learned.numbers[name]
        print(f"  {name}: {number.after:.6f} ± {number.deviation:.6f} {number.unit}")
    for log, noise in learned.noise.items():
        print(f"  {log}: noise {1e3 * noise.place:.3f} mm")
    print(f"  {learned.held_out}")
    for finding in learned.findings:
        print(f"  {finding}")
    for title, one, used in (
        ("the drawing", mounted, robot),
        ("what was learned", learned, learned.calibrated),
    ):
        tracker = {name: number.after for name, number in one.numbers.items() if name.startswith("tracker.")}
        far = off(used, tracker, tests)
        print(f"by {title}: {len(far)} other postures {far.mean():.3f} mm off, {far.max():.3f} at most")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(Path(sys.argv[1]) / "MinimalPositionCalibration")
