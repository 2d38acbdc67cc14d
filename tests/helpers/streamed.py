"""What tools' own readers make of a stream's file, and clients of live ones."""

from __future__ import annotations

import asyncio
import json
import struct
import subprocess
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from ports import MOST, free_port, listening, wait_for
from tornado.websocket import websocket_connect

import nmm
from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot

#: A message of Foxglove's: its topic, its time (ns), what it says, and when it came (ns).
Message = tuple[str, int, Any, int]


class Json:
    """Reads JSON, as `mcap` asks for it."""

    def decoder_for(self, encoding: str, schema: Any) -> Callable[[bytes], Any] | None:
        return json.loads if encoding == "json" else None


def protobuf() -> Any:
    return pytest.importorskip("mcap_protobuf.decoder", reason="needs mcap-protobuf-support").DecoderFactory()


def by_foxglove(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """The times (ns) and messages of each topic of an .mcap file, by the packages of MCAP."""
    from mcap.reader import make_reader

    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[protobuf(), Json()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found[channel.topic].append((message.log_time, decoded))
    return found


def said_of(path: Path) -> dict[str, str]:
    """The metadata of an .mcap file."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        return {
            name: value for one in make_reader(file).iter_metadata() for name, value in one.metadata.items()
        }


def by_rerun(path: Path) -> dict[str, dict[str, list[Any]]]:
    """The columns of each entity of an .rrd file, by Rerun's own reader."""
    chunk = pytest.importorskip("rerun.chunk", reason="needs rerun-sdk (pip install '.[streams]')")
    found: dict[str, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for one in chunk.RrdReader(path).stream():
        batch = one.to_record_batch()
        for name in batch.schema.names:
            column = batch.column(batch.schema.get_field_index(name))
            if name in ("time", "log_time"):
                values = column.cast("int64").to_pylist()
            elif name == "t":
                values = [1e-9 * ns for ns in column.cast("int64").to_pylist()]
            else:
                values = column.to_pylist()
            found[one.entity_path][name] += values
    return found


def column(found: Mapping[str, Mapping[str, Sequence[Any]]], entity: str, name: str) -> list[Any]:
    """Values that are one a row."""
    return [row[0] for row in found[entity][name]]


class Placed(NamedTuple):
    """A frame: its parent, and where it is in it."""

    parent: str
    at: pin.SE3


def placement(frames: Mapping[str, Placed], frame: str, world: str) -> Array:
    """(4, 4) of a frame in the world by the tree."""
    at = pin.SE3.Identity()
    while frame != world:
        frame, step = frames[frame]
        at = step * at
    return np.asarray(at.homogeneous)


def frames_of_foxglove(found: Mapping[str, list[tuple[int, Any]]], k: int) -> dict[str, Placed]:
    """All frames at the k-th sample."""
    messages = [found["/tf"][k][1], *(message for _, message in found.get("/tf_static", []))]
    return {
        one.child_frame_id: Placed(one.parent_frame_id, se3(one.translation, one.rotation))
        for message in messages
        for one in message.transforms
    }


def frames_of_rerun(found: Mapping[str, Mapping[str, list[Any]]], k: int) -> dict[str, Placed]:
    """The same of Rerun's entities, a row a sample; what is static has one."""
    frames = {}
    for entity, columns in found.items():
        if "Transform3D:child_frame" in columns:
            row = k if "t" in columns else 0
            names = ("child_frame", "parent_frame", "translation", "quaternion")
            child, parent, place, turn = (column(found, entity, f"Transform3D:{name}")[row] for name in names)
            frames[child] = Placed(parent, pin.XYZQUATToSE3(np.r_[place, turn]))
    return frames


def se3(position: Any, turn: Any) -> pin.SE3:
    return pin.XYZQUATToSE3(
        np.array([position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w], dtype=np.float64)
    )


def links_are_where_they_are(
    robot: Robot, q: Array, frames: Mapping[str, Placed], world: str, atol: float
) -> None:
    """Every link but those on wheels, compared with Pinocchio's kinematics."""
    here, model = nmm.Configuration(robot, q), robot.display_model
    turning = {name for wheel in robot.wheels for name in wheel.joints}
    compared = 0
    for frame in [one.name for one in model.frames if one.type == pin.BODY][1:]:
        supports = model.supports[model.frames[model.getFrameId(frame)].parentJoint]
        if not turning & {model.names[j] for j in supports}:
            expected = here.placement(frame).homogeneous
            np.testing.assert_allclose(placement(frames, frame, world), expected, atol=atol)
            compared += 1
    assert compared > 1


class FoxgloveClient:
    """Foxglove's side of a live stream: it subscribes to all topics, and keeps what comes."""

    def __init__(self, address: str) -> None:
        self.messages: list[Message] = []
        self.topics: dict[int, tuple[str, str]] = {}
        self.texts: list[dict[str, Any]] = []
        self._factory, self._schemas = protobuf(), dict[int, Any]()
        self._address = address
        self._socket: Any = None
        self._loop: Any = None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._listen()), daemon=True)
        self._thread.start()

    def of(self, topic: str) -> list[Message]:
        return [one for one in [*self.messages] if one[0] == topic]

    @property
    def gone(self) -> bool:
        """Whether the server has closed the connection."""
        return not self._thread.is_alive()

    def leave(self) -> None:
        wait_for(lambda: self._socket is not None)
        self._loop.call_soon_threadsafe(self._socket.close)
        self._thread.join(MOST)

    async def _listen(self) -> None:
        self._loop = asyncio.get_running_loop()
        socket = await websocket_connect(self._address, subprotocols=["foxglove.sdk.v1"])
        self._socket = socket
        while (got := await socket.read_message()) is not None:
            await self._take(socket, got)

    async def _take(self, socket: Any, got: str | bytes) -> None:
        if isinstance(got, str):
            text = json.loads(got)
            self.texts.append(text)
            if text["op"] == "advertise":
                wanted = []
                for one in text["channels"]:
                    self.topics[one["id"]] = one["topic"], one["schemaName"]
                    self._schemas[one["id"]] = one
                    wanted.append({"id": one["id"], "channelId": one["id"]})
                await socket.write_message(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        elif got[0] == 1:
            number, stamp = struct.unpack("<IQ", got[1:13])
            self.messages.append(
                (self.topics[number][0], stamp, self._decoded(number, got[13:]), time.time_ns())
            )

    def _decoded(self, number: int, data: bytes) -> Any:
        from base64 import b64decode

        from mcap.records import Schema

        one = self._schemas[number]
        if one["encoding"] == "json":
            return json.loads(data)
        schema = Schema(number, b64decode(one["schema"]), "protobuf", one["schemaName"])
        decode = self._factory.decoder_for("protobuf", schema)
        return decode(data)


@contextmanager
def rerun_viewer(file: Path) -> Iterator[tuple[int, subprocess.Popen[bytes]]]:
    """Rerun's own program without a window, which writes what it is sent: its port, and its process."""
    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install '.[streams]')")
    port = free_port()
    import rerun_cli

    program = Path(rerun_cli.__file__).with_name("rerun")  # the script would leave it behind
    viewer = subprocess.Popen(
        [program, "--bind", "127.0.0.1", "--port", str(port), "--save", file],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        wait_for(lambda: port in listening())
        yield port, viewer
    finally:
        viewer.terminate()
        viewer.wait()
