#!/usr/bin/env bash
# Rerun finds a robot's mesh by a wrong address and not by the right one.
#
# Expected: <mesh filename="file:///home/me/my%20robot/base.stl"/> is the address of the file base.stl in "my
# robot". This is how RFC 8089 and RFC 3986 write it, what pathlib's as_uri() gives, and what a browser opens.
#
# What happens: Rerun looks for a folder called "my%20robot", and the link has no mesh; there is a line in the
# log, no error. An address with a literal blank, which is not a valid URI, shows the mesh. The same holds for
# letters beyond ASCII.
#
# For users: a URDF that Rerun is to show needs file:// and the path as it is. Readers that unquote addresses
# take that one, too, unless the path has a percent sign of its own. Versions: rerun-sdk 0.41.0.
#
# Output:
#   file:///.../robot/base.stl: the mesh is there
#   file:///.../my%20robot/base.stl: no mesh
#   file:///.../my robot/base.stl: the mesh is there
#   file:///.../gr%C3%B6%C3%9Fe/base.stl: no mesh
#   file:///.../größe/base.stl: the mesh is there
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q rerun-sdk==0.41.0 numpy==2.4.6
venv/bin/python - <<'END'
import logging
import struct
from pathlib import Path

import rerun as rr
from rerun import chunk

corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
faces = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
solid = bytes(80) + struct.pack("<I", 4)
for face in faces:
    solid += struct.pack("<12fH", 0, 0, 0, *(value for k in face for value in corners[k]), 0)

seen = {}
for folder in ("robot", "my robot", "größe"):
    path = Path.cwd() / folder / "base.stl"
    path.parent.mkdir()
    path.write_bytes(solid)
    for address in dict.fromkeys((path.as_uri(), f"file://{path}")):
        number = len(seen)
        urdf, saved = Path(f"{number}.urdf"), Path(f"{number}.rrd")
        urdf.write_text(
            '<robot name="r"><link name="a"><visual><geometry>'
            f'<mesh filename="{address}"/></geometry></visual></link></robot>'
        )
        recording = rr.RecordingStream("one robot")
        recording.save(str(saved))
        recording.log_file_from_path(str(urdf))
        recording.flush()
        recording.disconnect()
        tables = [one.to_record_batch() for one in chunk.RrdReader(saved).stream()]
        names = [name for table in tables for name in table.schema.names]
        short = address.split("/", 3)[3].rsplit("/", 2)[1]
        seen[short] = any(name.endswith("Asset3D:blob") for name in names)
        print(f"file:///.../{short}/base.stl:", "the mesh is there" if seen[short] else "no mesh")
if seen != {"robot": True, "my%20robot": False, "my robot": True, "gr%C3%B6%C3%9Fe": False, "größe": True}:
    raise SystemExit("The behaviour changed: Rerun finds other meshes now.")
END
