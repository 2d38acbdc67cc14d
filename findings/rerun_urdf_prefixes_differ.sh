#!/usr/bin/env bash
# In Rerun, the same prefix puts the same robot below two different entities, by which call reads its URDF.
#
# Expected: entity_path_prefix="scene/robot" puts a robot r at /scene/robot/r, whether the file is read by
# RecordingStream.log_file_from_path or by rerun.urdf.UrdfTree, which its documentation calls an alternative
# to it: the parameter has the same name in both.
#
# What happens: log_file_from_path reads the slash as one between two parts of a path. UrdfTree takes the whole
# prefix as one part, escapes the slash, and the robot is at /scene\/robot/r. A view of /scene has it in the one
# case and lacks it in the other; nothing is said.
#
# For users: give UrdfTree a prefix without a slash, and name its entity in the contents of a view. Versions:
# rerun-sdk 0.41.0.
#
# Output:
#   log_file_from_path: /scene/robot/r
#   UrdfTree: /scene\/robot/r
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q rerun-sdk==0.41.0 numpy==2.4.6
venv/bin/python - <<'END'
from pathlib import Path

import rerun as rr
from rerun import chunk
from rerun.urdf import UrdfTree

Path("r.urdf").write_text(
    '<robot name="r"><link name="a"><visual><geometry><sphere radius="1"/></geometry></visual></link></robot>'
)
prefix, found = "scene/robot", {}
for name in ("log_file_from_path", "UrdfTree"):
    recording = rr.RecordingStream("one robot")
    recording.save(f"{name}.rrd")
    if name == "UrdfTree":
        UrdfTree.from_file_path("r.urdf", entity_path_prefix=prefix).log_urdf_to_recording(recording)
    else:
        recording.log_file_from_path("r.urdf", entity_path_prefix=prefix)
    recording.flush()
    recording.disconnect()
    paths = {one.entity_path for one in chunk.RrdReader(f"{name}.rrd").stream()}
    found[name] = next(path for path in paths if path.endswith("/r"))
    print(f"{name}: {found[name]}")
if found != {"log_file_from_path": "/scene/robot/r", "UrdfTree": "/scene\\/robot/r"}:
    raise SystemExit("The behaviour changed: the prefixes mean the same now.")
END
