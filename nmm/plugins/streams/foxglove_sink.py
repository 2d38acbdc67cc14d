"""Pictures as Foxglove takes them: live by a WebSocket server, or in an .mcap file."""

from __future__ import annotations

import json
import threading
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.errors import InputError
from nmm.plugins.streams.foxglove_messages import BLUE, GREEN, ORANGE, RED, UPRIGHT, FoxgloveMessages
from nmm.plugins.streams.pictures import CoarseTrail, Pose, RobotPicture, Said, Still, Triangles, finite
from nmm.plugins.streams.sensed_surfaces import SensedSurfaces
from nmm.plugins.streams.tools import FOXGLOVE, LOOPBACK, imported

DESCRIPTION, TF, TF_STATIC = "/robot_description", "/tf", "/tf_static"
JOINTS, INPUTS, ERROR, DISTANCE = "/joint_states", "/inputs", "/error", "/distance"
ODOMETRY, BELIEVED, TARGET, LOG = "/odom", "/believed_pose", "/desired_pose", "/log"
SCENE, MOVING, PATHS, NEAREST = "/scene", "/moving", "/paths", "/nearest"
#: The Foxglove app knows a description by the name of ROS's type.
STRING = {"type": "object", "properties": {"data": {"type": "string"}}}
#: Messages for a client at most that wait to be sent; the oldest go first. What is sent for each picture has
#: some kB, a path of 400 points 11 kB: 20 MB; what is sensed has 2 MB, once a second, for the 7 s of it.
BACKLOG = 4096


class FoxgloveSink:
    """A context of its own with a channel for each topic, into a file, or to whoever connects to the server.

    What is said once, and how paths were up to now, is given again to whoever subscribes later.

    Parameters
    ----------
    still : what does not change
    file : where to write; None to serve
    port : of the server, on 127.0.0.1 only; 0 for a free one
    assets : content of meshes by the addresses that the description has for them
    came : called when a client subscribes
    """

    def __init__(
        self,
        still: Still,
        file: Path | None,
        port: int = 0,
        assets: Mapping[str, str] | None = None,
        came: Callable[[], None] = lambda: None,
    ) -> None:
        self._foxglove = foxglove = imported(FOXGLOVE)
        foxglove.set_log_level("ERROR")
        self._made = FoxgloveMessages(still.world)
        self._kinds, self._channels = self._made.kinds, imported(f"{FOXGLOVE}.channels")
        self._still, self._context = still, foxglove.Context()
        self._trails: dict[str, CoarseTrail] = defaultdict(CoarseTrail)
        self._topics: dict[str, Any] = {}
        # For whoever comes later; the server's threads read both.
        self._kept: dict[str, Any] = {}
        self._drawn: dict[str, dict[str, Any]] = defaultdict(dict)
        self._stamp = still.start
        self._lock = threading.Lock()
        self._bodies: list[tuple[Triangles | None, Pose]] = []
        self._loose: set[int] = set()
        self._surfaces = SensedSurfaces(still)
        self._writer = self._server = None
        self._open_topics()
        if file is not None:
            self._writer = foxglove.open_mcap(file, context=self._context)
        else:
            self._server = self._serve(port, dict(assets or {}), came)
        self._draw_still()

    @property
    def port(self) -> int:
        """Where the server listens."""
        return int(self._server.port) if self._server is not None else 0

    def take(self, items: Sequence[RobotPicture | Said]) -> None:
        """Send pictures and lines of text."""
        for one in items:
            if isinstance(one, RobotPicture):
                self._show(one)
            else:
                self._say(one)

    def close(self, about: Mapping[str, str]) -> None:
        """End the server; a file is whole then, with metadata called nmm."""
        if self._server is not None:
            self._server.stop()
        if self._writer is not None:
            self._writer.write_metadata("nmm", {"title": self._still.title, **about})
            self._writer.close()

    def _serve(self, port: int, assets: dict[str, str], came: Callable[[], None]) -> Any:
        websocket = imported(f"{FOXGLOVE}.websocket")
        sink = self

        class Listener(websocket.ServerListener):  # type: ignore[name-defined]  # imported just now
            def on_subscribe(self, client: Any, channel: Any) -> None:
                came()
                sink._again(channel.topic)

        def asset(address: str) -> bytes | None:
            return Path(assets[address]).read_bytes() if address in assets else None

        try:
            return self._foxglove.start_server(
                name=self._still.title,
                host=LOOPBACK,
                port=port,
                server_listener=Listener(),
                asset_handler=asset,
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except RuntimeError as error:  # what the package raises of everything
            raise InputError(str(error), where=f"port {port}") from None

    def _open_topics(self) -> None:
        channels, of = self._channels, self._context
        for topic, kind in (
            (TF, "FrameTransforms"), (TF_STATIC, "FrameTransforms"), (JOINTS, "JointStates"),
            (ODOMETRY, "Odometry"), (BELIEVED, "PoseInFrame"), (TARGET, "PoseInFrame"), (LOG, "Log"),
            (SCENE, "SceneUpdate"), (PATHS, "SceneUpdate"), (NEAREST, "SceneUpdate"),
        ):  # fmt: skip
            self._topics[topic] = getattr(channels, f"{kind}Channel")(topic, context=of)
        named = {INPUTS: self._still.inputs, ERROR: self._still.errors, DISTANCE: [("distance", "m")]}
        for topic, names in named.items():
            numbers = {name: {"type": "number", "description": unit} for name, unit in names}
            if topic == DISTANCE:
                numbers["between"] = {"type": "string", "description": ""}
            self._topics[topic] = self._json(
                topic, f"nmm.{topic[1:]}", {"type": "object", "properties": numbers}
            )
        self._topics[DESCRIPTION] = self._json(DESCRIPTION, "std_msgs/String", STRING)

    def _json(self, topic: str, name: str, schema: dict[str, Any]) -> Any:
        text = json.dumps(schema).encode()
        made = self._foxglove.Schema(name=name, encoding="jsonschema", data=text)
        return self._context._create_channel(topic, message_encoding="json", schema=made)

    def _send(self, topic: str, message: Any, stamp: int, *, keep: bool = False) -> None:
        """Send a message; one to keep is sent again to whoever subscribes later."""
        if isinstance(message, dict):
            message = json.dumps(message).encode()
        with self._lock:
            self._stamp = max(self._stamp, stamp)
            if keep:
                self._kept[topic] = message
            self._topics[topic].log(message, log_time=stamp)

    def _draw(
        self, topic: str, entities: list[tuple[str, Any]], stamp: int, gone: Sequence[str] = ()
    ) -> None:
        """Send a topic's entities, these in place of earlier ones of their names, without those that are
        gone: who jumps in a recording is given the last message of each topic."""
        with self._lock:
            self._stamp = max(self._stamp, stamp)
            drawn = self._drawn[topic]
            drawn.update(entities)
            for name in gone:
                drawn.pop(name, None)
            kind, at = self._kinds.SceneEntityDeletionType.MatchingId, self._made.time(stamp)
            deleted = [self._kinds.SceneEntityDeletion(timestamp=at, type=kind, id=name) for name in gone]
            update = self._kinds.SceneUpdate(deletions=deleted, entities=[*drawn.values()])
            self._topics[topic].log(update, log_time=stamp)

    def _again(self, topic: str) -> None:
        """What somebody who has just subscribed to a topic has missed."""
        with self._lock:
            if topic in self._kept:
                self._topics[topic].log(self._kept[topic], log_time=self._stamp)
            if drawn := [*self._drawn.get(topic, {}).values()]:
                self._topics[topic].log(self._kinds.SceneUpdate(entities=drawn), log_time=self._stamp)

    def _draw_still(self) -> None:
        still, stamp = self._still, self._still.start
        self._send(DESCRIPTION, {"data": still.description}, stamp, keep=True)
        if still.fixed:
            self._send(TF_STATIC, self._made.frames(still.fixed, stamp), stamp, keep=True)
        entities = []
        if len(still.desired):
            entities.append(
                self._made.entity("desired path", stamp, lines=[self._made.line(still.desired, GREEN)])
            )
        if len(still.marks):
            entities.append(self._made.entity("targets", stamp, spheres=self._made.at(still.marks)))
        self._bodies = [(body.surface, body.pose) for body in still.bodies]
        entities += [self._body(i, stamp) for i in range(len(still.bodies))]
        if entities:
            self._draw(SCENE, entities, stamp)

    def _called(self, number: int) -> str:
        return f"obstacle {self._still.bodies[number].name}"

    def _body(self, number: int, stamp: int) -> tuple[str, Any]:
        """A body in the world; one that moves in a frame of its own, so that its surface is sent once."""
        (surface, pose), name = self._bodies[number], self._called(number)
        if number in self._loose:
            pose = np.zeros(3), UPRIGHT
        triangles = [] if surface is None else [self._made.surface(surface, pose)]
        frame = name if number in self._loose else ""
        return self._made.entity(name, stamp, frame, triangles=triangles)

    def _say(self, said: Said) -> None:
        level = self._kinds.LogLevel.Warning if said.warns else self._kinds.LogLevel.Info
        line = self._kinds.Log(
            timestamp=self._made.time(said.stamp), level=level, name=said.who, message=said.text
        )
        self._send(LOG, line, said.stamp)

    def _show(self, picture: RobotPicture) -> None:
        m, still, stamp, at = self._kinds, self._still, picture.stamp, self._made.time(picture.stamp)
        self._show_bodies(picture)
        loose = [(still.world, self._called(i), *self._bodies[i][1]) for i in sorted(self._loose)]
        self._send(TF, self._made.frames([*picture.transforms, *loose], stamp), stamp)
        states = [m.JointState(name=name, position=float(value))
                  for (name, _), value in zip(still.coordinates, picture.q, strict=True)]  # fmt: skip
        self._send(JOINTS, m.JointStates(timestamp=at, joints=states), stamp)
        self._send(INPUTS, finite(still.inputs, picture.u), stamp)
        if still.errors:
            self._send(ERROR, finite(still.errors, picture.error), stamp)
        if picture.twist is not None:
            vx, vy, omega = picture.twist.tolist()
            odometry = m.Odometry(
                timestamp=at,
                frame_id=still.odom,
                body_frame_id=still.base,
                pose=self._made.pose(picture.stand),
                linear_velocity=m.Vector3(x=vx, y=vy, z=0.0),
                angular_velocity=m.Vector3(x=0.0, y=0.0, z=omega),
            )
            self._send(ODOMETRY, odometry, stamp)
        posed = [(BELIEVED, picture.seen)]
        if picture.wanted is not None:
            posed.append((TARGET, (picture.wanted, UPRIGHT)))
        for topic, pose in posed:
            if pose is not None:
                self._send(
                    topic,
                    m.PoseInFrame(timestamp=at, frame_id=still.world, pose=self._made.pose(pose)),
                    stamp,
                )
        self._show_paths(picture)
        self._show_near(picture)

    def _show_paths(self, picture: RobotPicture) -> None:
        ends = [("driven", picture.reached, BLUE),
                ("odometry", picture.seen[0] if picture.seen else None, ORANGE)]  # fmt: skip
        if not len(self._still.desired):
            ends.append(("desired", picture.wanted, GREEN))
        lines = []
        for name, point, rgb in ends:
            if point is not None:
                line = self._made.line(self._trails[name].add(point), rgb)
                lines.append(self._made.entity(f"{name} path", picture.stamp, lines=[line]))
        if lines:
            self._draw(PATHS, lines, picture.stamp)

    def _show_near(self, picture: RobotPicture) -> None:
        """The line between the nearest points, which goes where nothing is near any more."""
        near, stamp = picture.near, picture.stamp
        if near is not None:
            self._send(DISTANCE, {"distance": near.distance, "between": near.between}, stamp)
        if near is not None and near.points is not None:
            words = self._made.text(f"{near.between}: {near.distance:.3g} m", near.points.mean(axis=0))
            line = self._made.entity(
                "nearest", stamp, lines=[self._made.line(near.points, RED)], texts=[words]
            )
            self._draw(NEAREST, [line], stamp)
        elif self._drawn[NEAREST]:
            with self._lock:
                self._drawn[NEAREST].clear()
            kind = self._kinds.SceneEntityDeletionType.All
            deleted = self._kinds.SceneEntityDeletion(timestamp=self._made.time(stamp), type=kind)
            self._send(NEAREST, self._kinds.SceneUpdate(deletions=[deleted]), stamp)

    def _show_bodies(self, picture: RobotPicture) -> None:
        """What moves, or is sensed anew, is on a topic of its own from then on, so that nothing else is sent
        again with it."""
        for i in sorted({*picture.moved, *picture.changed}):
            topic, name = f"{MOVING}/{self._still.bodies[i].name}", self._called(i)
            surface, pose = self._bodies[i]
            if i in picture.changed:
                surface, said = self._surfaces.of(i, picture)
                if said is not None:
                    self._say(said)
            self._bodies[i] = surface, picture.moved.get(i, pose)
            begins = i not in self._loose
            if begins:
                self._loose.add(i)
                self._topics[topic] = self._channels.SceneUpdateChannel(topic, context=self._context)
                self._draw(SCENE, [], picture.stamp, [name])
            if surface is not None and (begins or i in picture.changed):
                self._draw(topic, [self._body(i, picture.stamp)], picture.stamp)
            elif i in picture.changed:
                self._draw(topic, [], picture.stamp, [name])
