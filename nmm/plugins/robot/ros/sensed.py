"""Clouds of points and occupancy grids in ROS's messages, as obstacles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from nmm.base.errors import InputError, expect
from nmm.model.collisions.sensed import OccupancyMap, PointCloud
from nmm.plugins.robot.ros.reading import name_of, placement, plain, planar, stamp
from nmm.plugins.robot.ros.storage import Log

POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
#: Of PointField's datatypes.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


class SeenCloud(NamedTuple):
    """A cloud of a log.

    Attributes
    ----------
    t : when it was seen, by its header, s
    frame : whose axes its points are in
    cloud : the obstacle, its points in these axes (`PointCloud.transformed`)

    Examples
    --------
    >>> seen = nmm.ros.SeenCloud(3.5, "lidar", nmm.PointCloud([[1.0, 0.0, 0.2]]))
    >>> seen.frame, seen.cloud.points
    ('lidar', array([[1. , 0. , 0.2]]))
    """

    t: float
    frame: str
    cloud: PointCloud


def cloud(message: Any, radius: float = 0.01, name: str = "") -> PointCloud:
    """The points of a PointCloud2, in the axes of its header's frame; those of NaN are left out.

    Parameters
    ----------
    radius, name : as of `PointCloud`

    Raises
    ------
    InputError : no fields x, y and z of numbers; fewer bytes than it says; no finite point

    Examples
    --------
    >>> from types import SimpleNamespace as M
    >>> fields = [M(name=axis, offset=4 * k, datatype=7, count=1) for k, axis in enumerate("xyz")]
    >>> data = np.array([[1, 2, 3], [np.nan, 0, 0]], dtype="<f4").tobytes()
    >>> sizes = {"width": 2, "height": 1, "point_step": 12, "row_step": 24, "is_bigendian": False}
    >>> seen = nmm.ros.cloud(M(fields=fields, data=data, **sizes))
    >>> seen.points, seen.left_out
    (array([[1., 2., 3.]]), 1)
    """
    where = name_of(message)
    if not all(hasattr(message, part) for part in ("fields", "data", "point_step", "row_step")):
        raise InputError(where=where, expected="a PointCloud2")
    fields = {field.name: field for field in message.fields}
    missing = [axis for axis in "xyz" if axis not in fields]
    if missing:
        raise InputError(where=f"{where}: fields", expected="x, y and z", available=fields)
    order, step, pitch = "><"[not message.is_bigendian], int(message.point_step), int(message.row_step)
    width, height = int(message.width), int(message.height)
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    expect(width > 0 and height > 0 and step > 0, where, "points", (width, height))
    pitch = pitch if height > 1 else max(pitch, width * step)
    fits = width * step <= pitch and (height - 1) * pitch + width * step <= len(data)
    expect(fits, f"{where}: data", f"{height} rows of {pitch} bytes, points of {step}", len(data))
    columns = []
    for axis in "xyz":
        kind, offset = _TYPES.get(int(fields[axis].datatype)), int(fields[axis].offset)
        expect(kind, f"{where}: fields: {axis}: datatype", "1 to 8", int(fields[axis].datatype))
        number = np.dtype(f"{order}{kind}")
        fits = 0 <= offset <= step - number.itemsize
        expect(fits, f"{where}: fields: {axis}: offset", "within a point", offset)
        columns.append(np.ndarray((height, width), number, data, offset, (pitch, step)).ravel())
    return PointCloud(np.column_stack(columns).astype(np.float64), radius, name)


def occupancy(message: Any, height: float = 2.0, unknown: str = "occupied", name: str = "") -> OccupancyMap:
    """The map of an OccupancyGrid.

    Parameters
    ----------
    height, unknown, name : as of `OccupancyMap`

    Raises
    ------
    InputError : not as many numbers as cells; an origin that leans; the causes of `OccupancyMap`

    Examples
    --------
    >>> from types import SimpleNamespace as M
    >>> origin = M(position=M(x=1.0, y=0.0, z=0.0), orientation=M(x=0.0, y=0.0, z=0.0, w=1.0))
    >>> grid = M(info=M(width=3, height=1, resolution=0.5, origin=origin), data=[0, 100, -1])
    >>> nmm.ros.occupancy(grid, unknown="free").full
    array([[False,  True, False]])
    """
    where = name_of(message)
    if not (hasattr(message, "info") and hasattr(message, "data")):
        raise InputError(where=where, expected="an OccupancyGrid")
    info = message.info
    width, rows, data = int(info.width), int(info.height), np.asarray(message.data)
    expect(width > 0 and rows > 0, f"{where}: info", "cells", (width, rows))
    expect(data.size == width * rows, f"{where}: data", f"{width * rows} numbers", data.size)
    pose = placement(info.origin)
    origin = planar(pose, f"{where}: info: origin")
    expect(math.isfinite(float(info.resolution)), f"{where}: info: resolution", "a number", info.resolution)
    cells = data.reshape(rows, width).astype(np.int64)
    # As f32 in the message: 0.05 is 0.05000000074505806.
    resolution = float(np.format_float_positional(np.float32(info.resolution), unique=True))
    return OccupancyMap(cells, resolution, origin, height, unknown, name=name)


def clouds(path: str | Path, topic: str = "points", radius: float = 0.01) -> Iterator[SeenCloud]:
    """The clouds of a topic in a rosbag2 folder, an .mcap, a .db3 or ROS 1's .bag file, as recorded.

    Parameters
    ----------
    path : the bag
    topic : of PointCloud2 messages; with a slash in front or without
    radius : as of `PointCloud`

    Raises
    ------
    InputError : no bag, no such topic; the causes of `cloud`

    Examples
    --------
    >>> list(nmm.ros.clouds("no.mcap"))
    Traceback (most recent call last):
        ...
    nmm.base.errors.InputError: no.mcap: cannot be read: No such file or directory
    """
    log = Log(Path(path))
    known = {name: kind for name, kind in log.topics if kind.endswith("/PointCloud2")}
    names = [name for name in known if plain(name) == plain(topic)]
    if not names:
        raise InputError(where=path, expected=f"a topic {topic} of PointCloud2", available=known)
    for name, _, message in log.messages([(name, known[name]) for name in names]):
        try:
            frame = plain(str(message.header.frame_id))
            yield SeenCloud(stamp(message), frame, cloud(message, radius, plain(name)))
        except InputError as error:
            raise error.at(f"{path}: {name}") from None
