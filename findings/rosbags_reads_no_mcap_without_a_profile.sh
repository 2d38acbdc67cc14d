#!/usr/bin/env bash
# A log of ROS 2 messages cannot be opened if its header does not say "ros2".
#
# Expected: MCAP's specification lets a file's profile be empty, and each channel states its own encoding
# ("cdr") and its schema's ("ros2msg"). A reader of rosbag2 logs needs no more than that to read the channel.
#
# What happens: rosbags refuses the whole file, "Profile is not ros2.", by Reader and by AnyReader. The same
# bytes with the profile "ros2" are read. The package mcap reads both. Its writer's start() has the empty
# profile by default.
#
# For users: logs of bridges and of own writers often have no profile. Write profile="ros2" when you make one;
# to mend one, copy its messages by the package mcap into a file that has it. Versions: rosbags 0.11.9, mcap
# 1.3.1.
#
# Output:
#   profile "": mcap reads 1 message
#   profile "": rosbags' Reader: Profile is not ros2.
#   profile "": rosbags' AnyReader: Profile is not ros2.
#   profile "ros2": mcap reads 1 message
#   profile "ros2": rosbags' Reader: [1.5]
#   profile "ros2": rosbags' AnyReader: [1.5]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q rosbags==0.11.9 mcap==1.3.1
venv/bin/python - <<'END'
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
raw = bytes(store.serialize_cdr(store.types["std_msgs/msg/Float64"](1.5), "std_msgs/msg/Float64"))
seen = []
for profile in ("", "ros2"):
    path = Path(f"log{profile}.mcap")
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=profile)
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
        channel = writer.register_channel("/x", "cdr", schema)
        writer.add_message(channel, log_time=10**9, data=raw, publish_time=10**9)
        writer.finish()
    with path.open("rb") as file:
        found = [message.data == raw for _, _, message in make_reader(file).iter_messages()]
    print(f'profile "{profile}": mcap reads {len(found)} message')
    seen.append(found)
    for name, open_it in (("Reader", Reader), ("AnyReader", lambda where: AnyReader([where], default_typestore=store))):
        try:
            with open_it(path) as reader:
                told = [store.deserialize_cdr(data, one.msgtype).data for one, _, data in reader.messages()]
        except Exception as error:
            told = str(error)
        seen.append(told)
        print(f'profile "{profile}": rosbags\' {name}: {told}')
refused = "Profile is not ros2."
if seen != [[True], refused, refused, [True], [1.5], [1.5]]:
    raise SystemExit("The behaviour changed: rosbags reads a file without a profile, or not one with it.")
END
