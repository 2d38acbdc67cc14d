#!/usr/bin/env bash
# The store of ROS 1 Noetic's messages lacks the message of /tf.
#
# Expected: get_typestore(Stores.ROS1_NOETIC) knows tf2_msgs/TFMessage, which /tf and /tf_static have had
# since ROS Hydro. The stores of all ROS 2 distributions of the package know it.
#
# What happens: it has 164 types, bond and dynamic_reconfigure among them, but neither tf2_msgs/TFMessage nor
# the older tf/tfMessage. Registering /tf with a writer by it fails, and reading a bag's /tf by it is a
# KeyError. AnyReader reads the same bag: it takes the definitions that the bag brings.
#
# For users: to read ROS 1 bags with the low-level Reader, register the type first (one line, below). To read
# transforms with AnyReader needs nothing. Versions: rosbags 0.11.9.
#
# Output:
#   ROS1_NOETIC: 164 types, tf2_msgs/msg/TFMessage among them: False
#   ROS2_FOXY: 147 types, tf2_msgs/msg/TFMessage among them: True
#   ROS2_JAZZY: 162 types, tf2_msgs/msg/TFMessage among them: True
#   /tf of the bag, by ROS1_NOETIC with its own types: KeyError 'tf2_msgs/msg/TFMessage'
#   /tf of the bag, by ROS1_NOETIC with the type registered: base_link
#   /tf of the bag, by AnyReader: base_link
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q rosbags==0.11.9
venv/bin/python - <<'END'
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

NAME = "tf2_msgs/msg/TFMessage"
plain, full = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS1_NOETIC)
full.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", NAME))
for one in (Stores.ROS1_NOETIC, Stores.ROS2_FOXY, Stores.ROS2_JAZZY):
    print(f"{one.name}: {len(get_typestore(one).types)} types, {NAME} among them: {NAME in get_typestore(one).types}")

types = {name.rsplit("/", 1)[1]: made for name, made in full.types.items() if name.startswith(("geometry_msgs", "tf2_msgs"))}
header = full.types["std_msgs/msg/Header"](seq=0, stamp=full.types["builtin_interfaces/msg/Time"](1, 0), frame_id="odom")
pose = types["Transform"](types["Vector3"](1.0, 0.0, 0.0), types["Quaternion"](0.0, 0.0, 0.0, 1.0))
message = types["TFMessage"]([types["TransformStamped"](header, "base_link", pose)])
with Writer(Path("run.bag")) as writer:
    topic = writer.add_connection("/tf", NAME, typestore=full)
    writer.write(topic, 10**9, full.serialize_ros1(message, NAME))

seen = []
with Reader(Path("run.bag")) as reader:
    for topic, _, raw in reader.messages():
        for told, store in (("its own types", plain), ("the type registered", full)):
            try:
                got = store.deserialize_ros1(raw, topic.msgtype).transforms[0].child_frame_id
            except KeyError as error:
                got = f"KeyError {error}"
            seen.append(got)
            print(f"/tf of the bag, by ROS1_NOETIC with {told}: {got}")
with AnyReader([Path("run.bag")]) as reader:
    for topic, _, raw in reader.messages():
        seen.append(reader.deserialize(raw, topic.msgtype).transforms[0].child_frame_id)
        print(f"/tf of the bag, by AnyReader: {seen[-1]}")
if seen != [f"KeyError '{NAME}'", "base_link", "base_link"] or NAME in plain.types:
    raise SystemExit("The behaviour changed: ROS1_NOETIC reads /tf, or AnyReader does not.")
END
