"""What the site's pictures are made from, so that one can tell which are old: docs/images/made_from.json.

A picture is made from a scenario (or a robot) and drawn by the package. It is old when the scenario or its
robot has changed since. What draws it may have changed, too: that is told apart, since one rarely sees it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import yaml

from nmm.base.bundled import bundled_robots, bundled_scenarios

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"
RECORD = IMAGES / "made_from.json"
#: What draws, below `nmm/`.
DRAWING = ("views/playback", "views/figures")


def content(source: str) -> str:
    """A bundled scenario's keys with its robot's file, or a robot's file, as twelve digits."""
    told = b""
    if scenario := bundled_scenarios().get(source):
        keys = yaml.safe_load(scenario.read_bytes())
        told, source = json.dumps(keys, sort_keys=True, default=str).encode(), str(keys["robot"])
    robot = bundled_robots().get(source)
    return _digest([told, robot.read_bytes() if robot else b""])


def drawing() -> str:
    """The files that draw, as twelve digits."""
    files = (path for room in DRAWING for path in (ROOT / "nmm" / room).rglob("*") if path.suffix in _DRAW)
    return _digest(path.read_bytes() for path in sorted(files))


def record(made: Mapping[str, str]) -> None:
    """Keep what pictures, named by their files below docs/images, were made from: a scenario or a robot."""
    now = {picture: [source, content(source), drawing()] for picture, source in made.items()}
    kept = {name: how for name, how in (recorded() | now).items() if (IMAGES / name).is_file()}
    RECORD.write_text(json.dumps(dict(sorted(kept.items())), indent=1) + "\n", encoding="utf-8")


def recorded() -> dict[str, list[str]]:
    """Of each picture: its source, the source's content then, and the drawing then."""
    found: dict[str, list[str]] = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    return found


def old() -> list[str]:
    """The pictures whose scenario or robot has changed since."""
    return [picture for picture, (source, then, _) in recorded().items() if content(source) != then]


def drawn_before() -> list[str]:
    """The pictures that another state of the package drew."""
    now = drawing()
    return [picture for picture, (_, _, then) in recorded().items() if now != then]


_DRAW = (".py", ".js", ".css", ".html")


def _digest(parts: Iterable[bytes]) -> str:
    made = hashlib.sha256()
    for part in parts:
        made.update(part)
    return made.hexdigest()[:12]
