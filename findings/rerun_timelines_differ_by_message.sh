#!/usr/bin/env bash
# In a ROS 2 log, Rerun puts everything on the timeline of stamps but the transforms.
#
# Expected: messages with the same header stamp are seen together on Rerun's timeline ros2_timestamp, /tf
# among them: each of its transforms has a header with a stamp.
#
# What happens: PoseStamped, JointState, Odometry and a single TransformStamped are on message_log_time,
# message_publish_time and ros2_timestamp. TFMessage (/tf) is on the first two only. Whoever picks
# ros2_timestamp sees poses and curves move, and a robot that stands still.
#
# For users: choose message_log_time to see a robot move with its curves. Where stamps and log times differ
# (simulated time, slow networks), no timeline shows poses and transforms by their stamps together. Versions:
# rerun-sdk 0.41.0; the log is written by rosbags 0.11.9.
#
# Output:
#   /pose: message_log_time, message_publish_time, ros2_timestamp
#   /joint_states: message_log_time, message_publish_time, ros2_timestamp
#   /one_transform: message_log_time, message_publish_time, ros2_timestamp
#   /tf: message_log_time, message_publish_time
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q rerun-sdk==0.41.0 rosbags==0.11.9 numpy==2.4.6
venv/bin/python - <<'END'
from collections import defaultdict
from pathlib import Path

import numpy as np
from rerun import chunk
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)


def make(name, *fields):
    return store.types[name.replace("/", "/msg/")](*fields)


turn = make("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0)
with Writer(Path("log"), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
    topics = {}
    for second in (100, 101):
        header = make("std_msgs/Header", make("builtin_interfaces/Time", second, 0), "odom")
        pose = make("geometry_msgs/Pose", make("geometry_msgs/Point", 1.0, 0.0, 0.0), turn)
        moved = make("geometry_msgs/Transform", make("geometry_msgs/Vector3", 1.0, 0.0, 0.0), turn)
        link = make("geometry_msgs/TransformStamped", header, "base_link", moved)
        nothing = np.zeros(0)
        for topic, name, fields in (
            ("/pose", "geometry_msgs/PoseStamped", (header, pose)),
            ("/joint_states", "sensor_msgs/JointState", (header, ["a"], np.array([0.5]), nothing, nothing)),
            ("/one_transform", "geometry_msgs/TransformStamped", (header, "base_link", moved)),
            ("/tf", "tf2_msgs/TFMessage", ([link],)),
        ):
            kind = name.replace("/", "/msg/")
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], (second + 5) * 10**9, store.serialize_cdr(make(name, *fields), kind))

found = defaultdict(set)
for one in chunk.McapReader(next(Path("log").glob("*.mcap"))).stream():
    found["/" + one.entity_path.split("/")[1]].update(one.timeline_names)
for topic in topics:
    print(f"{topic}: {', '.join(sorted(found[topic]))}")
times = {"message_log_time", "message_publish_time"}
if any(found[topic] != times | ({"ros2_timestamp"} if topic != "/tf" else set()) for topic in topics):
    raise SystemExit("The behaviour changed: the topics are on other timelines.")
END
