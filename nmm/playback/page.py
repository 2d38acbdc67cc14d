"""The page: MeshCat's viewer, our controls around it, and where its commands come from."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from importlib import metadata, resources
from importlib.util import find_spec
from pathlib import Path

from nmm.errors import RunError
from nmm.playback.drawing import Command
from nmm.playback.encoding import encode

#: In the order in which they depend on one another.
SCRIPTS = (
    "commands.js",
    "elements.js",
    "theme.js",
    "runs.js",
    "legend.js",
    "scenery.js",
    "texts.js",
    "ghosts.js",
    "ellipsoids.js",
    "obstacles.js",
    "apart.js",
    "camera.js",
    "curves.js",
    "plots.js",
    "values.js",
    "facts.js",
    "player.js",
    "film.js",
    "webm.js",
    "record.js",
    "keys.js",
    "address.js",
    "start.js",
)

#: What the browser may load: nothing but the page itself (and the socket that it came with, or the script
#: beside it). MeshCat evaluates text, and so do the tools that test pages.
POLICY = (
    "default-src 'none'; script-src {beside}'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src {sources}"
)


def file_page(
    commands: Iterable[Command],
    title: str,
    *,
    scripts: Sequence[str] = (),
    styles: Sequence[str] = (),
    viewer: str = "",
) -> str:
    """A page that holds its commands and needs nothing else; scripts and styles as of `socket_page`.

    Parameters
    ----------
    viewer : where, seen from the page, a file with the text of `viewer_script` is, which it then needs
    """
    lines = "\n".join(encode(command) for command in commands)
    block = f'<script type="application/json" id="commands">\n{lines}\n</script>\n'
    return _page(
        title,
        source="page",
        sources="'none'",
        before_scripts=block,
        scripts=scripts,
        styles=styles,
        viewer=viewer,
    )


def viewer_script() -> str:
    """The scripts of pages that play, for many pages beside one another: most of a short run's page."""
    return "\n".join([_meshcat_viewer(), *(_resource(name) for name in SCRIPTS)])


def socket_page(
    title: str, host: str, token: str, *, scripts: Sequence[str] = (), styles: Sequence[str] = ()
) -> str:
    """A page that gets its commands from the server at `host` (address:port), which knows it by the token.

    Parameters
    ----------
    scripts, styles : files of web/ that this page has besides; the scripts run before the commands come
    """
    return _page(
        title,
        source="socket",
        sources=f"ws://{host} ws://localhost:{host.rpartition(':')[2]}",
        before_scripts="",
        token=token,
        scripts=scripts,
        styles=styles,
    )


def _page(
    title: str,
    *,
    source: str,
    sources: str,
    before_scripts: str,
    token: str = "",
    scripts: Sequence[str] = (),
    styles: Sequence[str] = (),
    viewer: str = "",
) -> str:
    *libraries, start = SCRIPTS
    if viewer:
        meshcat, code = "", f'<script src="{html.escape(viewer)}"></script>'
    else:
        meshcat = f"<script>\n{_meshcat_viewer()}\n</script>"
        code = "\n".join(f"<script>\n{_resource(name)}</script>" for name in (*libraries, *scripts, start))
    parts = {
        "policy": POLICY.format(sources=sources, beside="'self' file: " if viewer else ""),
        "version": metadata.version("nmm"),
        "title": html.escape(title),
        "source": source,
        "token": token,
        "style": "\n".join(_resource(name) for name in ("style.css", "plots.css", *styles)),
        "meshcat": meshcat,
        "scripts": before_scripts + code,
    }
    # Split once, so that nothing that is put in is searched for more places.
    pieces = _resource("page.html").split("@")
    return "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))


def _resource(name: str) -> str:
    return resources.files("nmm.playback").joinpath("web", name).read_text(encoding="utf-8")


def _meshcat_viewer() -> str:
    """The JavaScript that MeshCat's own server sends."""
    spec = find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise RunError("playback needs the package meshcat, which is not installed")
    path = Path(spec.origin).parent / "viewer" / "dist" / "main.min.js"
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise RunError(f"{path}: MeshCat's viewer cannot be read: {error.strerror}") from None
