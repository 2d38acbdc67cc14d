"""Logs of ROS opened: rosbag2's folders and files, MCAP files without their end, ROS 1's bags."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from nmm.base.errors import InputError, RunError
from nmm.base.files import expect_file
from nmm.base.findings import Finding
from nmm.plugins.robot.ros.chunks import (
    MOST_OF_METADATA,
    Allowance,
    bound_readers,
    check_claims,
    claims_of,
    records_of,
)
from nmm.plugins.robot.ros.log import rosbags, typestore
from nmm.plugins.robot.ros.transforms import told_in_cdr

#: A topic and the type of its messages.
Topic = tuple[str, str]
#: One message: its topic, when it was recorded (ns), itself.
Taken = tuple[str, int, Any]
#: What mends a file, by its suffix.
MENDS = {
    ".mcap": "mcap recover {}",
    ".db3": "sqlite3 {} .recover",
    ".bag": "rosbag reindex {}",
    ".active": "rosbag reindex {}",
}
#: As tf2 calls it, and as tf did before.
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


class Log:
    """The messages of a log; `InputError` where nothing of it can be read.

    topics : all of it, with their types
    findings : where a file lacks its end
    """

    def __init__(self, path: Path) -> None:
        self.path, self.findings = path, list[Finding]()
        try:
            expect_file(path)
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", where=path) from None
        rosbags("rosbag2")
        bound_readers()
        self._parts = self._opened(path)
        self.topics = [*dict.fromkeys(topic for part in self._parts for topic in part.topics)]

    def messages(self, wanted: Collection[Topic]) -> Iterator[Taken]:
        """All messages of those topics with those types, a file after another."""
        for part in self._parts:
            with _Refusing(part.path):
                yield from Allowance(part.path).over(part.messages(wanted))
            if isinstance(part, _Streamed) and part.reason:
                self._tell(part.path, part.reason)

    def _opened(self, path: Path) -> list[_Indexed | _Streamed]:
        inside = sorted(path.iterdir(), key=_counted) if path.is_dir() else []
        files = [file for file in inside if file.suffix in (".bag", ".mcap", ".db3")]
        for file in inside:
            if file in files or file.name == "metadata.yaml":
                _expect_readable(file)
        whole = not path.is_dir() or (path / "metadata.yaml").exists()
        try:
            if whole:
                return [_Indexed(path)]
        except InputError:
            raise
        except Exception as error:
            if not files and path.suffix != ".mcap":
                raise _refused(path, error) from None
            reason = str(error) or type(error).__name__
        else:
            reason = "there is no metadata.yaml"
        if not files and path.is_dir():
            mend = f"ros2 bag reindex {path.name}"
            raise InputError(f"is no bag, or one whose metadata.yaml is missing: {mend}", where=path)
        parts: list[_Indexed | _Streamed] = []
        for file in files or [path]:
            with _Refusing(file):
                parts.append(_Streamed(file) if file.suffix == ".mcap" else _Indexed(file))
        if files and files[0].suffix != ".bag":
            self._tell(path, reason)
        return parts

    def _tell(self, path: Path, reason: str) -> None:
        mend = "ros2 bag reindex {}" if path.is_dir() else MENDS[path.suffix]
        self.findings.append(
            Finding("bag_cut", {"file": path.name, "reason": reason, "mend": mend.format(path.name)})
        )


class _Indexed:
    """What the package rosbags reads, by the index."""

    def __init__(self, path: Path) -> None:
        self.path = path
        first = path.suffix in (".bag", ".active")
        self._reader: Callable[[Path], Any] = rosbags("rosbag1" if first else "rosbag2").Reader
        self._decoded = of_ros1() if first else of_ros2()
        with Allowance(path).counting(), self._reader(path) as bag:
            for file, claims in claims_of(bag):
                check_claims(file, claims)
            self.topics = [(connection.topic, connection.msgtype) for connection in bag.connections]

    def messages(self, wanted: Collection[Topic]) -> Iterator[Taken]:
        with self._reader(self.path) as bag:
            some = [
                connection
                for connection in bag.connections
                if (connection.topic, connection.msgtype) in wanted
            ]
            for connection, time, data in bag.messages(connections=some) if some else ():
                yield _taken(connection.topic, connection.msgtype, time, data, self._decoded)


class _Streamed:
    """An MCAP file from its beginning on, as far as whole chunks go.

    reason : why no further, once it was read; "" where its end is there
    """

    def __init__(self, path: Path) -> None:
        self.path, self.reason = path, ""
        self._decoders = {"cdr": of_ros2(), "ros1": of_ros1()}
        records = Allowance(path).over(self._records())
        self.topics = [*dict.fromkeys((topic, kind) for topic, kind, _ in records if topic)]
        if not self.topics:
            raise InputError(self.reason or "has no topics", where=path)

    def messages(self, wanted: Collection[Topic]) -> Iterator[Taken]:
        for topic, kind, message in self._records():
            if message is not None and (topic, kind) in wanted:
                encoding, record = message
                yield _taken(topic, kind, record.log_time, record.data, self._decoders[encoding])

    def _records(self) -> Iterator[tuple[str, str, Any]]:
        """Topic, type and None for each channel, (encoding, record) for a message."""
        stream, records = mcap("stream_reader"), mcap("records")
        kinds: dict[int, str] = {}
        channels: dict[int, tuple[str, str, str]] = {}
        with self.path.open("rb") as file:
            try:
                for record in records_of(stream, file, records.Chunk):
                    if isinstance(record, records.Schema):
                        kinds[record.id] = _with_msg(record.name)
                    elif isinstance(record, records.Channel):
                        kind = kinds.get(record.schema_id, "")
                        channels[record.id] = record.topic, kind, record.message_encoding
                        yield record.topic, kind, None
                    elif isinstance(record, records.Message):
                        topic, kind, encoding = channels[record.channel_id]
                        if encoding in self._decoders:
                            yield topic, kind, (encoding, record)
            except InputError:  # a chunk that is longer than any
                raise
            except Exception as error:  # of bytes that are cut or are others
                cut = type(error).__name__ in ("EndOfFile", "error")  # mcap's, and that of struct
                self.reason = "it lacks its end" if cut else "bytes of it are others than written"


class _Refusing:
    """In the block, whatever a reader says of a stranger's bytes is an `InputError`."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        return

    def __exit__(self, kind: object, error: BaseException | None, _: object) -> None:
        if isinstance(error, Exception) and not isinstance(error, InputError | RunError):
            raise _refused(self._path, error) from None


def _taken(topic: str, kind: str, time: int, data: bytes, decoded: Callable[[bytes, str], Any]) -> Taken:
    """A message decoded at once; what its decoder says of other bytes is told with the topic."""
    try:
        return topic, time, decoded(data, kind)
    except Exception as error:
        raise ValueError(f"{topic}: {error or type(error).__name__}") from None


def _expect_readable(file: Path) -> None:
    """`InputError` for a pipe or a device among a bag's files, and for metadata as long as none are."""
    try:
        expect_file(file)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=file) from None
    if file.name == "metadata.yaml" and (size := file.stat().st_size) > MOST_OF_METADATA:
        raise InputError(where=file, expected=f"at most {MOST_OF_METADATA:,} bytes", got=size)


def _refused(path: Path, error: Exception) -> InputError:
    if isinstance(error, InputError | RunError):
        return error if isinstance(error, InputError) else InputError(str(error), where=path)
    reason = str(error) or type(error).__name__
    mend = f"; {MENDS[path.suffix].format(path.name)} may mend it" if path.suffix in MENDS else ""
    return InputError(f"is no bag of ROS, or a damaged one ({reason}){mend}", where=path)


def mcap(part: str) -> Any:
    """A module of the package mcap; `InputError` says how to install it."""
    try:
        return import_module(f"mcap.{part}")
    except ImportError:
        raise InputError(
            "an MCAP file without its end needs the package mcap: pip install mcap, or mcap recover"
        ) from None


def of_ros2() -> Callable[[bytes, str], Any]:
    """What decodes a message of ROS 2 of a type: transforms as numbers, others as objects."""
    objects: Callable[[bytes, str], Any] = typestore().deserialize_cdr

    def decoded(data: bytes, kind: str) -> Any:
        return told_in_cdr(data) if kind == TRANSFORMS[0] else objects(data, kind)

    return decoded


def of_ros1() -> Callable[[bytes, str], Any]:
    """What decodes a message of ROS 1 of a type."""
    typesys = rosbags("typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    for name in TRANSFORMS:
        store.register(typesys.get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
    decoded: Callable[[bytes, str], Any] = store.deserialize_ros1
    return decoded


def _with_msg(kind: str) -> str:
    """A type's name as ROS 2 writes it."""
    package, slash, name = kind.partition("/")
    return kind if not slash or "/" in name else f"{package}/msg/{name}"


def _counted(path: Path) -> tuple[int, str]:
    """The order of a split bag's files: _2 before _10."""
    number = path.stem.rpartition("_")[2]
    return (int(number) if number.isdigit() else -1, path.name)
