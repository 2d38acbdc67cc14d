"""One file that plays motions in any browser, without a network and without a server."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from nmm.errors import InputError
from nmm.files import replaceable
from nmm.playback.page import file_page
from nmm.playback.scene import Shown, playback_scene
from nmm.runs.ellipsoid_options import Wanted
from nmm.writing import whole_file


def write_html(
    motions: Sequence[Shown],
    path: str | Path,
    *,
    title: str | None = None,
    ghosts: int | None = None,
    fps: float = 60.0,
    autoplay: bool = False,
    ellipsoids: Wanted = False,
) -> Path:
    """Write a page that plays runs or motions, each in its resolver's colour, with its curves beside it.

    It opens at the first instant. `#t=3.2` after the file's address opens it at 3.2 s, `#play` plays.

    Parameters
    ----------
    motions : at least one run (`Trajectory`) or `Motion`
    path : the file to write; it appears whole or not at all, and replaces an older one
    title : heading; the first robot's name when not given
    ghosts : transparent copies of each robot along its way; 6 when not given, 3 of each of several
    fps : frames for each second of motion
    autoplay : whether it plays when it is opened
    ellipsoids : whether manipulability ellipsoids are drawn, or how (`EllipsoidOptions`)

    Raises
    ------
    InputError : no motion, or the file cannot be written; ellipsoids as in `playback_scene`

    Examples
    --------
    >>> runs = [nmm.Scenario.load("unicycle_2r_position").with_resolver(name).run() for name in ("rg", "pg")]
    >>> nmm.playback.write_html(runs, "both.html", title="RG and PG").name
    'both.html'
    """
    options: dict[str, Any] = {"ghosts": ghosts, "fps": fps, "autoplay": autoplay}
    return _write(Path(path), page_of(motions, title, ellipsoids, **options)[1])


def page_of(
    motions: Sequence[Shown], title: str | None, ellipsoids: Wanted, viewer: str = "", **options: Any
) -> tuple[str, str]:
    """The page's heading, and the page; viewer as of `file_page`, options as of `playback_scene`."""
    if title is None:
        title = motions[0].robot.name if motions else ""
    commands = playback_scene(motions, title=title, ellipsoids=ellipsoids, **options)
    return title, file_page(commands, title, viewer=viewer)


def _write(path: Path, text: str) -> Path:
    target = replaceable(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(target) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    return path
