"""What a bag of a moving arm is worth: `python benchmarks/arm_bag.py [RUNS]`.

A UR5 whose zeros and placements are other than its file's, by chance, goes through 40 postures, 2 s each
way, and stands for 1.5 s in each; joints are told at 100 Hz, a tracker sees a ball to 0.2 mm, 100 times a
second, and stamps it late. The hand swings on after each stop, by a millimetre, which no encoder sees. Of
each way to read this the table has how far zeros are off (root of the mean square) and how often all numbers
but the tracker's are within two of their deviations:

- all: every 25th sighting, with joints interpolated at its stamp
- standing: every 10th, where the arm stands
- from_bag: `nmm.Sightings.from_bag`, of each posture one mean
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
from arm_coverage import SPREAD, UR5, kind_of, matrix, placements, postures
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import nmm

Array = np.ndarray
Ways = dict[str, nmm.Sightings]
STORE = get_typestore(Stores.ROS2_HUMBLE)
JOINTS = [f"{name}_joint" for name in
          ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]  # fmt: skip
RATE, GOES, STANDS, NOISE, FLICKER = 100.0, 2.0, 1.5, 2e-4, 5e-5
#: The hand's swing: m, turns a second, s until it is a third.
SWING, TURNS, FADES = 1e-3, 4.0, 0.15
DELAYS = (0.0, 0.01, 0.05, 0.2)


def motion(robot: nmm.Robot, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Times (N,), joints (N, 6), and how long the arm stands already, s, negative where it goes."""
    stops = np.column_stack([*postures(robot, JOINTS, rng).values()])
    t = np.arange(0.0, len(stops) * (GOES + STANDS), 1.0 / RATE)
    k, since = np.divmod(t, GOES + STANDS)
    k = k.astype(int)
    s = np.clip((since - STANDS) / GOES, 0.0, 1.0)[:, np.newaxis]
    ahead = stops[np.minimum(k + 1, len(stops) - 1)]
    return (
        t,
        stops[k] + (10 * s**3 - 15 * s**4 + 6 * s**5) * (ahead - stops[k]),
        np.where(since < STANDS, since, -1.0),
    )


def seen_by(
    there: nmm.Robot, t: Array, q: Array, since: Array, late: float, rng: np.random.Generator
) -> tuple[Array, dict[str, float]]:
    """Where the tracker sees the ball (N, 3) at what it takes for t, and where the ball is on the hand."""
    place, point = [*rng.uniform(-3.0, 3.0, 3)], rng.uniform(-0.1, 0.1, 3)
    angles = [*rng.uniform(-3.1, 3.1, 1), *rng.uniform(-1.0, 1.0, 1), *rng.uniform(-3.1, 3.1, 1)]
    q_then = np.column_stack([np.interp(t - late, t, column) for column in q.T])
    since_then = np.interp(t - late, t, since)
    (at,) = placements(there, dict(zip(JOINTS, q_then.T, strict=True)), ("tool0",))
    swing = np.where(
        since_then >= 0.0, np.exp(-since_then / FADES) * np.cos(2 * np.pi * TURNS * since_then), 1.0
    )
    ball = (at @ np.array([*point, 1.0]))[:, :3] + SWING * np.outer(swing, [0.3, 0.5, 0.8])
    T = np.linalg.inv(matrix((place, angles)))
    seen = ball @ T[:3, :3].T + T[:3, 3] + NOISE * rng.normal(size=ball.shape)
    return seen, dict(zip([f"point.{axis}" for axis in "xyz"], point, strict=True))


def bag(path: Path, t: Array, q: Array, seen: Array) -> Path:
    types = STORE.types
    kinds = {"/joint_states": "sensor_msgs/msg/JointState", "/ball": "geometry_msgs/msg/PointStamped"}
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as out:
        made = {topic: out.add_connection(topic, kind, typestore=STORE) for topic, kind in kinds.items()}
        for now, row, at in zip(t + 1.7e9, q, seen, strict=True):
            ns = round(now * 1e9)
            stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="tracker")
            none = np.zeros(0)
            state = types[kinds["/joint_states"]](header, JOINTS, row, none, none)
            point = types[kinds["/ball"]](header, types["geometry_msgs/msg/Point"](*map(float, at)))
            for topic, message in (("/joint_states", state), ("/ball", point)):
                out.write(made[topic], ns, STORE.serialize_cdr(message, kinds[topic]))
    return path


def readings_of(rows: Array) -> dict[str, Array]:
    return dict(zip(JOINTS, rows.T, strict=True))


def ways(robot: nmm.Robot, t: Array, read: Array, since: Array, seen: Array, file: Path) -> Ways:
    """Sightings by each way to read the recording."""

    def some(rows: Array) -> nmm.Sightings:
        return nmm.Sightings("some", readings_of(read[rows]), seen[rows], "points", on="tool0")

    every, often = np.arange(0, len(t), 25), np.arange(0, len(t), 10)
    still = often[(since[often] > 0.25) & (since[often] < STANDS - 0.25)]
    of_bag = nmm.Sightings.from_bag(bag(file, t, read, seen), robot, "tool0", reference="ball")
    return {"all": some(every), "standing": some(still), "from_bag": of_bag}


def main(runs: int) -> None:
    robot, rng = nmm.load(UR5), np.random.default_rng(1)
    t, q, since = motion(robot, rng)
    seen, _ = seen_by(robot, t, q, since, 0.0, rng)
    still = (since > 0.5) & (since < 0.55)
    first = nmm.calibrate(robot, nmm.Sightings("", readings_of(q[still]), seen[still], "points", on="tool0"))
    own = [name for name in first.learned if not first.is_mount(name)]
    for late in DELAYS:
        off: dict[str, list[float]] = {}
        inside: dict[str, list[bool]] = {}
        many: dict[str, int] = {}
        refused: dict[str, int] = {}
        for _ in range(runs):
            truth = {name: SPREAD[kind_of(name)] * rng.normal() for name in own}
            t, q, since = motion(robot, rng)
            seen, mounts = seen_by(nmm.with_numbers(robot, truth), t, q, since, late, rng)
            read = q + FLICKER * rng.normal(size=q.shape)
            with tempfile.TemporaryDirectory() as folder:
                made = ways(robot, t, read, since, seen, Path(folder) / "bag")
            for way, log in made.items():
                many[way] = len(log)
                try:
                    found = nmm.calibrate(robot, log)
                except nmm.InputError:
                    refused[way] = refused.get(way, 0) + 1
                    continue
                for name in {*found.learned} & {*own, *mounts}:
                    by = found.numbers[name].after - (truth | mounts)[name]
                    inside.setdefault(way, []).append(abs(by) < 2.0 * found.numbers[name].deviation)
                    if name.startswith("offset"):
                        off.setdefault(way, []).append(by)
        for way, count in many.items():
            rms = 1e3 * np.sqrt(np.mean(np.square(off.get(way, [np.nan]))))
            share = 100.0 * np.mean(inside.get(way, [np.nan]))
            print(
                f"{1e3 * late:.0f} ms late, {way}: {count} samples, zeros {rms:.3f} mrad off, {share:.0f} % "
                f"within two deviations; {refused.get(way, 0)} of {runs} refused",
                flush=True,
            )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
