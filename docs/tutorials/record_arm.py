"""The arm of calibrate_arm.py beside motion capture, recorded while it moves: a bag for `nmm calibrate`."""

import numpy as np
import pinocchio as pin
from calibrate_arm import BALL, JOINTS, TRACKER, TURNED, there
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import nmm

#: It goes and stands, s, told so often a second; motion capture stamps so much later, s.
GOES, STANDS, RATE, LATE = 0.8, 1.2, 50, 0.03
HALL = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, TURNED), TRACKER)
MARKER = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.5, 1.2), BALL)


def record(path="moved", seed=4):
    """A folder with a bag: /joint_states, and /mocap/hand, the poses of a marker on the hand."""
    rng, store = np.random.default_rng(seed), get_typestore(Stores.ROS2_HUMBLE)
    robot, _ = there(dict.fromkeys(JOINTS, 0.0))
    messages = nmm.ros.Messages(robot, store.types, odom="hall", start=1.7e9)
    stops = np.radians(np.loadtxt("touched.csv", delimiter=",", skiprows=1)[:, :5])
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        made = {}
        for i in range(int((GOES + STANDS) * RATE) * (len(stops) - 1)):
            k, since = divmod(i / RATE, GOES + STANDS)
            share = np.clip((since - STANDS) / GOES, 0.0, 1.0)
            read = stops[int(k)] + share * (stops[int(k) + 1] - stops[int(k)])
            q = robot.q_from(dict(zip(JOINTS, read, strict=True)), base=[0.0, 0.0, 0.0])
            hand = HALL.inverse() * nmm.Configuration(robot, q).placement("ee") * MARKER
            shaken = pin.SE3(pin.exp3(1e-3 * rng.normal(size=3)), 2e-4 * rng.normal(size=3))
            pose = messages.pose(i / RATE + LATE, (hand * shaken).homogeneous)
            for topic, message in (
                ("/joint_states", messages.joint_state(i / RATE, q)),
                ("/mocap/hand", pose),
            ):
                kind = message.__msgtype__
                if topic not in made:
                    made[topic] = bag.add_connection(topic, kind, typestore=store)
                stamp = message.header.stamp
                bag.write(made[topic], stamp.sec * 10**9 + stamp.nanosec, store.serialize_cdr(message, kind))


if __name__ == "__main__":
    record()
    print("written: moved")
