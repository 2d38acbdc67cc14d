"""Pages as text: MeshCat's viewer, our controls, and the commands or where they come from. A page with its
commands plays in any browser without network or server, as a file or inside a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib import metadata, resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from nmm.base.ellipsoid_options import Wanted
from nmm.base.errors import RunError
from nmm.base.files import replaceable, whole_file, written_at
from nmm.views.playback.drawing import Command, encode
from nmm.views.playback.scene import Shown, playback_scene

#: Of a page in a notebook, px.
HEIGHT = 600
#: In the order in which they depend on one another.
_NAMES = (
    "commands elements theme runs legend scenery texts ghosts rooms ellipsoids obstacles sights apart "
    "camera axes curves plots own_plots values facts player triads measure film webm record keys embedded "
    "address start"
)
SCRIPTS = tuple(f"{name}.js" for name in _NAMES.split())

#: What the browser may load: nothing but the page itself (and the socket that it came with, or the script
#: beside it). MeshCat evaluates text, and so do the tools that test pages.
POLICY = (
    "default-src 'none'; script-src {beside}'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src {sources}"
)


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

    It opens at the first instant, or at the one that the surroundings say. `#t=3.2` after the file's address
    opens it at 3.2 s, `#play` plays.

    Parameters
    ----------
    motions : at least one run (`Trajectory`) or `Motion`
    path : the file to write; it appears whole or not at all, and replaces an older one
    title : heading; the first robot's name when not given
    ghosts : transparent copies of each robot along its way; three or four at round times when not given, none
        where they overlap
    fps : frames for each second of motion
    autoplay : whether it plays when it is opened
    ellipsoids : whether manipulability ellipsoids are drawn, or how (`EllipsoidOptions`)

    Raises
    ------
    InputError : no motion, or one without samples; ellipsoids of a frame or with sizes that a robot does not
        have; a file that cannot be written

    Examples
    --------
    >>> runs = [nmm.Scenario.load("unicycle_2r_position").with_resolver(name).run() for name in ("rg", "pg")]
    >>> nmm.playback.write_html(runs, "both.html", title="RG and PG").name
    'both.html'
    """
    _, text = page_of(motions, title, ellipsoids, ghosts=ghosts, fps=fps, autoplay=autoplay)
    path, target = Path(path), replaceable(Path(path))
    with written_at(path):
        target.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(target) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return path


def page_of(
    motions: Sequence[Shown], title: str | None, ellipsoids: Wanted, viewer: str = "", **options: Any
) -> tuple[str, str]:
    """The heading and the page; viewer as of `file_page`, options as of `playback_scene`."""
    if title is None:
        title = motions[0].robot.name if motions else ""
    commands = playback_scene(motions, title=title, ellipsoids=ellipsoids, **options)
    return title, file_page(commands, title, viewer=viewer)


class Page:
    """Runs that a notebook plays where they stand: the last value of a cell, or `display(Page([rg, pg]))`.

    The page is the one of `write_html`, in a frame that may run scripts and nothing else: it reaches neither
    the notebook nor a network, and stays in the saved notebook.

    Parameters
    ----------
    motions, title, ghosts, fps, ellipsoids : as of `write_html`
    height : px

    Raises
    ------
    InputError : as `write_html`

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> page = nmm.playback.Page([run], fps=10)
    >>> page.title
    'unicycle_2r'
    """

    def __init__(
        self,
        motions: Sequence[Shown],
        *,
        title: str | None = None,
        ghosts: int | None = None,
        fps: float = 60.0,
        ellipsoids: Wanted = False,
        height: int = HEIGHT,
    ) -> None:
        self.title, self.html = page_of(motions, title, ellipsoids, ghosts=ghosts, fps=fps)
        self.height = height

    def __repr__(self) -> str:
        return f"Page({self.title!r}, {len(self.html) / 1e6:.1f} MB)"

    def _repr_html_(self) -> str:
        return framed(self.html, self.title, self.height)


def of_run(run: Shown) -> str | None:
    """A run's page for a notebook; None without samples."""
    return Page([run])._repr_html_() if len(run.t) else None


def framed(page: str, title: str, height: int) -> str:
    """A page in a sandboxed frame; in an untrusted notebook JupyterLab shows its text instead."""
    instead = f"{escape(title)}: this page is drawn once the notebook is trusted."
    return (
        f'<iframe sandbox="allow-scripts" title="{escape(title)}" '
        f'style="width: 100%; height: {height}px; border: 0" srcdoc="{escape(page)}">{instead}</iframe>'
    )


def file_page(
    commands: Iterable[Command],
    title: str,
    scripts: Sequence[str] = (),
    styles: Sequence[str] = (),
    *,
    viewer: str = "",
) -> str:
    """A page that holds its commands and needs nothing else; scripts and styles as of `socket_page`. With
    `viewer`, it needs the text of `viewer_script` in that file, whose path is relative to the page."""
    lines = "\n".join(encode(command) for command in commands)
    block = f'<script type="application/json" id="commands">\n{lines}\n</script>\n'
    if viewer:
        linked = f'{block}<script src="{escape(viewer)}"></script>'
        code, beside = {"meshcat": "", "scripts": linked}, "'self' file: "
    else:
        code, beside = _inline_scripts(scripts, block), ""
    return _page(title, styles, "'none'", beside, source="page", token="", **code)


def viewer_script() -> str:
    """The scripts of pages that play, to be shared by many pages: most of a short run's page."""
    return "\n".join([_meshcat_viewer(), *(_resource(name) for name in SCRIPTS)])


def socket_page(
    title: str, host: str, token: str, scripts: Sequence[str] = (), styles: Sequence[str] = ()
) -> str:
    """A page that gets its commands from the server at `host` (address:port), which knows it by the token;
    further scripts of web/ run before the commands come."""
    sources = f"ws://{host} ws://localhost:{host.rpartition(':')[2]}"
    return _page(title, styles, sources, source="socket", token=token, **_inline_scripts(scripts))


def _inline_scripts(scripts: Sequence[str], before: str = "") -> dict[str, str]:
    *libraries, start = SCRIPTS
    own = "\n".join(f"<script>\n{_resource(name)}</script>" for name in (*libraries, *scripts, start))
    return {"meshcat": f"<script>\n{_meshcat_viewer()}\n</script>", "scripts": before + own}


def _page(title: str, styles: Sequence[str], sources: str, beside: str = "", **own: str) -> str:
    """The page's text, with what it may load, and `own`: its source, token, viewer and scripts."""
    parts = {
        **own,
        "policy": POLICY.format(sources=sources, beside=beside),
        "version": metadata.version("nmm"),
        "title": escape(title),
        "style": "\n".join(_resource(name) for name in ("style.css", "plots.css", "sights.css", *styles)),
    }
    # Split once, so that inserted text is not searched for places.
    pieces = _resource("page.html").split("@")
    return "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))


def _resource(name: str) -> str:
    return resources.files("nmm.views.playback").joinpath("web", name).read_text(encoding="utf-8")


def _meshcat_viewer() -> str:
    spec = find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise RunError("playback needs the package meshcat, which is not installed")
    path = Path(spec.origin).parent / "viewer" / "dist" / "main.min.js"
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise RunError(f"{path}: MeshCat's viewer cannot be read: {error.strerror}") from None
