"""Pages inside a notebook: JupyterLab, VS Code, and what else shows an object's HTML."""

from __future__ import annotations

import html
from collections.abc import Sequence

from nmm.playback.html import page_of
from nmm.playback.page import file_page
from nmm.playback.scene import Shown
from nmm.playback.viewer import SCRIPTS, STYLES
from nmm.playback.viewer_scene import viewer_scene
from nmm.robots.robot import Robot
from nmm.runs.ellipsoid_options import Wanted

#: Height of a page in a notebook, px.
HEIGHT = 600


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
    """A run's page for a notebook; None for one without samples."""
    return Page([run])._repr_html_() if len(run.t) else None


def of_robot(robot: Robot) -> str:
    """A robot's page for a notebook: with a slider for each coordinate, as `view` shows it."""
    page = file_page(viewer_scene(robot, robot.rest), robot.name, scripts=SCRIPTS, styles=STYLES)
    return framed(page, robot.name, HEIGHT)


def framed(page: str, title: str, height: int) -> str:
    """A page in an element of another one, from which it is shut off.

    Of a notebook that is not trusted JupyterLab leaves out the frame, and shows the words in it.
    """
    instead = f"{html.escape(title)}: this page is drawn once the notebook is trusted."
    return (
        f'<iframe sandbox="allow-scripts" title="{html.escape(title)}" '
        f'style="width: 100%; height: {height}px; border: 0" srcdoc="{html.escape(page)}">{instead}</iframe>'
    )
