"""Clouds and grids in messages, against the package rosbags' own serialisation, and bags of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nmm
from nmm.base.errors import InputError

typesys = pytest.importorskip("rosbags.typesys")
STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
POINTS = np.random.default_rng(0).uniform(-2.0, 2.0, (6, 4, 3))


def message(order: str = "<", number: str = "f4", gap: int = 0) -> Any:
    """A PointCloud2 of 6 × 4 points with a field between y and z, rows that are longer by a gap."""
    types = STORE.types
    stamp = types["builtin_interfaces/msg/Time"](3, 500_000_000)
    layout = np.dtype([("x", order + number), ("y", order + number), ("i", "u1"), ("z", order + number)])
    rows = np.zeros((6, 4), dtype=layout)
    for k, axis in enumerate("xyz"):
        rows[axis] = POINTS[:, :, k]
    data = b"".join(row.tobytes() + b"\0" * gap for row in rows)
    field, code = types["sensor_msgs/msg/PointField"], {"f4": 7, "f8": 8}[number]
    fields = [
        field(name, layout.fields[name][1], 2 if name == "i" else code, 1)  # type: ignore[index]  # it has some
        for name in ("x", "y", "i", "z")
    ]
    made = types["sensor_msgs/msg/PointCloud2"](
        types["std_msgs/msg/Header"](stamp, "lidar"), 6, 4, fields, order == ">", layout.itemsize,
        4 * layout.itemsize + gap, np.frombuffer(data, dtype=np.uint8), True,
    )  # fmt: skip
    made.width, made.height = 4, 6
    name = "sensor_msgs/msg/PointCloud2"
    return STORE.deserialize_cdr(STORE.serialize_cdr(made, name), name)


@pytest.mark.parametrize("gap", [0, 5])
@pytest.mark.parametrize(("order", "number"), [("<", "f4"), (">", "f4"), ("<", "f8"), (">", "f8")])
def test_a_cloud_of_any_layout_has_its_points(order: str, number: str, gap: int) -> None:
    cloud = nmm.ros.cloud(message(order, number, gap), radius=0.02)
    expected = POINTS.reshape(-1, 3).astype(number)
    assert np.array_equal(cloud.points, expected.astype(np.float64))
    assert cloud.radius == 0.02


def test_a_cloud_without_z_or_with_too_few_bytes_is_refused() -> None:
    short = message()
    short.data = short.data[:-1]
    with pytest.raises(InputError, match="data"):
        nmm.ros.cloud(short)
    flat = message()
    flat.fields = flat.fields[:3]
    with pytest.raises(InputError, match="x, y and z"):
        nmm.ros.cloud(flat)
    beyond = message()
    beyond.fields[3].offset = 10
    with pytest.raises(InputError, match="offset"):
        nmm.ros.cloud(beyond)
    with pytest.raises(InputError, match="PointCloud2"):
        nmm.ros.cloud(object())


def test_a_bags_clouds_come_with_their_times_and_frames(tmp_path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer

    file = tmp_path / "seen"
    with Writer(file, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        name = "sensor_msgs/msg/PointCloud2"
        connection = bag.add_connection("/front/points", name, typestore=STORE)
        for time in (1, 2, 3):
            bag.write(connection, time, STORE.serialize_cdr(message(), name))
    seen = list(nmm.ros.clouds(file, "front/points", radius=0.03))
    assert [(t, frame, len(cloud.points)) for t, frame, cloud in seen] == [(3.5, "lidar", 24)] * 3
    with pytest.raises(InputError, match="front/points"):
        list(nmm.ros.clouds(file, "back/points"))


def test_a_grid_is_the_map_that_it_says() -> None:
    types = STORE.types
    half = np.sqrt(0.5)
    pose = types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](1.0, 2.0, 0.0),
        types["geometry_msgs/msg/Quaternion"](0, 0, half, half),
    )
    stamp = types["builtin_interfaces/msg/Time"](3, 0)
    info = types["nav_msgs/msg/MapMetaData"](stamp, 0.05, 3, 2, pose)
    data = np.array([0, 100, -1, 0, 0, 50], dtype=np.int8)
    name = "nav_msgs/msg/OccupancyGrid"
    made = types[name](types["std_msgs/msg/Header"](stamp, "map"), info, data)
    grid = nmm.ros.occupancy(STORE.deserialize_cdr(STORE.serialize_cdr(made, name), name), height=1.2)
    assert grid.cells.tolist() == [[0, 100, -1], [0, 0, 50]]
    assert grid.full.tolist() == [[False, True, True], [False, False, False]]
    assert (grid.resolution, grid.height) == (0.05, 1.2)
    assert np.allclose(grid.origin, [1.0, 2.0, np.pi / 2])
    made.data = data[:-1]
    with pytest.raises(InputError, match="data"):
        nmm.ros.occupancy(made)
