"""A scenario of the gallery: run, its files written, and what its card says."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.bundled import bundled_scenarios
from nmm.errors import NmmError
from nmm.progress import Progress, between
from nmm.runs.table import rows

if TYPE_CHECKING:
    from nmm.runs.trajectory import Trajectory

#: The file in the gallery's folder that its pages play with.
VIEWER = "viewer.js"
#: Pictures of a page for each second of motion; the page draws what is between them.
FPS = 30.0
#: Which rows of a run's table a card has.
TOLD = (
    *("resolver", "outcome", "tracking ‖e‖", "objective H", "smallest σ_min"),
    *("least margin to a limit", "least clearance"),
)


@dataclass(frozen=True)
class Card:
    """What the gallery says of a scenario.

    Attributes
    ----------
    name, title : of the scenario
    outcome : how its run ended (`nmm.Outcome`); "refused" where it could not begin
    message : why it did not end as asked; empty where it did
    numbers : labels with values, rows of the table that `nmm run` prints
    shown : whether there is something to see: motion.png and playback.html

    Examples
    --------
    >>> from nmm.gallery import write_gallery
    >>> made = write_gallery("gallery", ["unicycle_2r_position"], jobs=1)
    >>> made.cards[0].outcome, dict(made.cards[0].numbers)["resolver"]
    ('completed', 'RG, rk4, dt 0.005 s')
    """

    name: str
    title: str
    outcome: str
    message: str
    numbers: tuple[tuple[str, str], ...]
    shown: bool

    @property
    def ran(self) -> bool:
        """Whether it ran to its end; a target that is out of reach and therefore missed is such an end."""
        return self.outcome in ("completed", "missed")


def make_card(name: str, folder: Path, progress: Progress | None = None) -> Card:
    """Run a bundled scenario and write NAME.yaml, summary.json, motion.png and playback.html.

    Parameters
    ----------
    name : of the scenario
    folder : a new folder, made here
    progress : called with the fraction done

    Raises
    ------
    KeyboardInterrupt : the run was interrupted
    """
    from nmm.scenario import Scenario

    folder.mkdir()
    shutil.copyfile(bundled_scenarios()[name], folder / f"{name}.yaml")
    title = name
    try:
        scenario = Scenario.load(name)
        title = scenario.title or name
        run = scenario.run(between(progress, 0.0, 0.5))
        if run.outcome == "interrupted":
            raise KeyboardInterrupt
        summary = run.summary()
        if len(run):
            _draw(run, title, folder)
    except NmmError as error:
        return Card(name, title, "refused", str(error), (), False)
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    message = "" if run.complete else run.message
    return Card(name, title, str(run.outcome), message, tuple(_numbers(run, summary)), len(run) > 0)


def _draw(run: Trajectory, title: str, folder: Path) -> None:
    from nmm.figures import save, stroboscopic
    from nmm.playback.html import page_of

    save(stroboscopic(run), folder / "motion.png")
    page = page_of([run], title, False, viewer=f"../{VIEWER}", fps=FPS)[1]
    (folder / "playback.html").write_text(page, encoding="utf-8")


def _numbers(run: Trajectory, summary: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "robot", f"{run.robot.name}, {summary['platform']}"
    yield from ((label, value) for label, value in rows(run, summary) if label in TOLD)
