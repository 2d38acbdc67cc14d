"""The text of files."""

from __future__ import annotations

from pathlib import Path

from nmm.errors import RobotError
from nmm.files import read_bytes

#: A description with its meshes beside it is far shorter, bytes.
LONGEST = 50_000_000


def read_text(path: Path) -> str:
    """The text of a UTF-8 file.

    Raises
    ------
    FileNotFoundError : there is no such file (the caller knows who named it)
    RobotError : a directory, unreadable, or not UTF-8
    """
    try:
        content = read_bytes(path, LONGEST)
        return content.decode("utf-8-sig")
    except FileNotFoundError:
        raise
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise RobotError(f"{path}: line {line}: not UTF-8 text") from None
    except IsADirectoryError:
        raise RobotError(f"{path}: expected a .urdf or .xacro file, this is a directory") from None
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from None
