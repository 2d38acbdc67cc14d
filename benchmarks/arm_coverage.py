"""How often an arm's numbers lie within two of their deviations: `python benchmarks/arm_coverage.py [RUNS]`.

Each run has an arm with other zeros, placements and mounts than its file, by chance, in 40 postures; what
was seen has noise. Prints, for each case, the share of runs in which each number is within two deviations:
its mean, least and most over the numbers, and the share of all. 95 % are expected; of 200 runs a share of
one number varies by 1.5 %.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import nmm

Array = np.ndarray
DATA = "package://example-robot-data/robots/"
UR5 = DATA + "ur_description/urdf/ur5_robot.urdf"
PANDA = DATA + "panda_description/urdf/panda.urdf"
TIAGO = DATA + "tiago_description/robots/tiago_no_hand.urdf"
#: By the beginning of a number's name how far it is off by chance, m and rad.
SPREAD = {"offset": 0.02, "xyz": 0.002, "turn": 0.004}
GRID = np.array([[0.03 * i, 0.03 * j, 0.0] for j in range(6) for i in range(9)])
CAMERA = nmm.CameraIntrinsics(800, 805, 640, 360, [-0.12, 0.05, 0.001, -0.0005, 0.0], width=1280, height=720)
BOARD = ([0.55, 0.05, 0.02], [0.02, 0.03, 0.5])
EYE = ([0.01, 0.06, 0.03], [-1.4, 0.1, -0.3])


def matrix(at: tuple[list[float], list[float]]) -> Array:
    """(4, 4) of a place and roll, pitch, yaw."""
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("xyz", at[1]).as_matrix()
    made[:3, 3] = at[0]
    return made


def placements(robot: nmm.Robot, readings: dict[str, Array], frames: tuple[str, ...]) -> list[Array]:
    """(N, 4, 4) of frames in the world, at what encoders of a robot with these numbers read."""
    data, made = robot.model.createData(), [[] for _ in frames]
    for row in zip(*readings.values(), strict=True):
        q = np.zeros(robot.n)
        for name, value in zip(readings, row, strict=True):
            factor, offset = robot.gear(name)
            q[robot.coordinate(name)] = factor * value + offset
        pin.framesForwardKinematics(robot.model, data, robot.following.placed(q))
        for several, frame in zip(made, frames, strict=True):
            several.append(data.oMf[robot.frame_id(frame)].homogeneous)
    return [np.array(several) for several in made]


def postures(
    robot: nmm.Robot, joints: list[str], rng: np.random.Generator, count: int = 40
) -> dict[str, Array]:
    limits = robot.q_limits[[robot.coordinate(joint) for joint in joints]].clip(-2.5, 2.5)
    return {joint: rng.uniform(*limits[k], count) for k, joint in enumerate(joints)}


def tracked(robot: nmm.Robot, joints: list[str], hand: str) -> Callable[..., nmm.Sightings]:
    """A tracker in the hall and a ball on the hand, 0.2 mm."""

    def made(there: nmm.Robot, rng: np.random.Generator) -> tuple[nmm.Sightings, dict[str, float]]:
        readings = postures(robot, joints, rng)
        place, point = [*rng.uniform(-3.0, 3.0, 3)], rng.uniform(-0.1, 0.1, 3)
        angles = [*rng.uniform(-3.1, 3.1, 1), *rng.uniform(-1.0, 1.0, 1), *rng.uniform(-3.1, 3.1, 1)]
        (at,) = placements(there, readings, (hand,))
        seen = (np.linalg.inv(matrix((place, angles))) @ at @ np.array([*point, 1.0]))[:, :3]
        log = nmm.Sightings("tracker", readings, seen + 2e-4 * rng.normal(size=seen.shape), "points", on=hand)
        names = [*(f"tracker.{part}" for part in ("x", "y", "z", "roll", "pitch", "yaw"))]
        truth = dict(zip([*names, "point.x", "point.y", "point.z"], [*place, *angles, *point], strict=True))
        return log, truth

    return made


def looked(robot: nmm.Robot, joints: list[str], hand: str) -> Callable[..., nmm.Sightings]:
    """A camera on the hand and a board on a table, 0.2 px."""
    rng, found = np.random.default_rng(0), []
    eye, middle = matrix(EYE), matrix(BOARD) @ np.array([*GRID.mean(axis=0), 1.0])
    while len(found) < 300:
        readings = postures(robot, joints, rng, 500)
        (at,) = placements(robot, readings, (hand,))
        for k, one in enumerate(np.linalg.inv(at @ eye)):
            x, y, z = (one @ middle)[:3]
            if 0.35 < z < 0.9 and np.hypot(x, y) < 0.25 * z and abs(one[2, :3] @ matrix(BOARD)[:3, 2]) > 0.6:
                found.append([readings[joint][k] for joint in joints])
    pool = np.array(found)

    def made(there: nmm.Robot, rng: np.random.Generator) -> tuple[nmm.Sightings, dict[str, float]]:
        some = pool[rng.choice(len(pool), 25, replace=False)]
        readings = dict(zip(joints, some.T, strict=True))
        (at,) = placements(there, readings, (hand,))
        points = np.einsum(
            "kij,mj->kmi", np.linalg.inv(at @ eye) @ matrix(BOARD), np.c_[GRID, np.ones(len(GRID))]
        )
        seen = CAMERA.project(points[..., :3]) + 0.2 * rng.normal(size=(len(some), len(GRID), 2))
        seen[((seen < 0.0) | (seen > [CAMERA.width - 1, CAMERA.height - 1])).any(axis=2)] = np.nan
        log = nmm.Sightings("camera", readings, seen, "corners", "world", hand, CAMERA, GRID, sensor="eye")
        truth = {
            f"{name}.{part}": value
            for name, at in (("eye", EYE), ("board", BOARD))
            for part, value in zip(("x", "y", "z", "roll", "pitch", "yaw"), [*at[0], *at[1]], strict=True)
        }
        return log, truth

    return made


def kind_of(name: str) -> str:
    if name.startswith("offset"):
        return "offset"
    return "turn" if name.endswith(("roll", "pitch", "yaw")) else "xyz"


def coverage(title: str, robot: nmm.Robot, make: Callable[..., nmm.Sightings], runs: int) -> None:
    rng = np.random.default_rng(1)
    first = nmm.calibrate(robot, make(robot, rng)[0])
    own = [name for name in first.learned if not first.is_mount(name)]
    inside: dict[str, list[bool]] = {}
    failed, learned = 0, []
    for _ in range(runs):
        truth = {name: SPREAD[kind_of(name)] * rng.normal() for name in own}
        log, mounts = make(nmm.with_numbers(robot, truth), rng)
        found = nmm.calibrate(robot, log)
        if any(number.why == "not shown" for number in found.numbers.values()):
            failed += 1  # what is held is not as in the file, and others make up for it
            continue
        learned.append(len(found.learned))
        for name in found.learned:
            off = found.numbers[name].after - (truth | mounts).get(name, 0.0)
            if name.endswith(("roll", "pitch", "yaw")):
                off = np.remainder(off + np.pi, 2.0 * np.pi) - np.pi
            inside.setdefault(name, []).append(abs(off) < 2.0 * found.numbers[name].deviation)
    shares = 100.0 * np.array([np.mean(several) for several in inside.values()])
    every = 100.0 * np.mean(np.concatenate([*inside.values()]))
    print(
        f"{title}: {runs} runs, {np.mean(learned):.0f} numbers, of {failed} runs some not shown; within two "
        f"deviations {every:.1f} % of all, {shares.min():.1f} to {shares.max():.1f} % by number",
        flush=True,
    )


def main(runs: int) -> None:
    arm = {"ur": nmm.load(UR5), "panda": nmm.load(PANDA), "tiago": nmm.load(TIAGO)}
    ur = [f"{name}_joint" for name in
          ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]  # fmt: skip
    panda = [f"panda_joint{i}" for i in range(1, 8)]
    tiago = ["torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8))]
    coverage("UR5, tracker", arm["ur"], tracked(arm["ur"], ur, "tool0"), runs)
    coverage("UR5, camera on the hand", arm["ur"], looked(arm["ur"], ur, "tool0"), runs)
    coverage("Panda, tracker", arm["panda"], tracked(arm["panda"], panda, "panda_link8"), runs)
    coverage("TIAGo, tracker", arm["tiago"], tracked(arm["tiago"], tiago, "arm_tool_link"), runs)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
