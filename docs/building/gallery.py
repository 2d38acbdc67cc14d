"""The gallery: every bundled scenario, run, with a picture, a page that plays it, its numbers and its file.

`python docs/make_gallery.py --folder DIR` writes it.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from jinja2 import ChoiceLoader, Environment, FileSystemLoader, PackageLoader, StrictUndefined

import nmm
from nmm.base.bundled import bundled_scenarios
from nmm.base.errors import NmmError, expect_known
from nmm.base.processes import share_out
from nmm.base.progress import Progress, between
from nmm.motion.table import summary_rows
from nmm.plugins.live.rendering.chromium import HeadlessPage
from nmm.views.figures import save, stroboscopic
from nmm.views.folders.whole import FolderKind, replaced_folder
from nmm.views.playback.html import page_of, viewer_script

#: Marks a folder as one of ours.
FORMAT, MARKER = "nmm gallery 1", "gallery.json"
#: The file in the gallery's folder that its pages play with.
VIEWER = "viewer.js"
#: Pictures of a page for each second of motion; the page draws what is between them.
FPS = 30.0
#: Of a picture in 3D, px, and what leaves the scene alone in its page.
SIZE = (640, 400)
ALONE = """new Promise((done) => {
  nmm.plots.show(false);
  for (const card of document.querySelectorAll(".card")) card.style.display = "none";
  if (nmm.player.time === 0) nmm.player.seek(0.4 * nmm.stage.duration);
  nmm.camera.fit();
  nmm.texts.fit();
  nmm.viewer.set_dirty();
  let left = 3;
  const next = () => (left-- ? requestAnimationFrame(next) : done());
  next();
})"""
#: Which rows of a run's table a card has.
LABELS = (
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
    picture : the file with its picture: scene.png, in 3D, or motion.png where no browser took one
    """

    name: str
    title: str
    outcome: str
    message: str
    numbers: tuple[tuple[str, str], ...]
    shown: bool
    picture: str = "motion.png"

    @property
    def ran(self) -> bool:
        """Whether it ran to its end; missing a target that is out of reach is such an end."""
        return self.outcome in ("completed", "missed")


@dataclass(frozen=True)
class Gallery:
    """A gallery's folder, the page in it, and a card a scenario, by name."""

    folder: Path
    index: Path
    cards: tuple[Card, ...]


def write_gallery(folder: Path, only: Sequence[str] = (), *, jobs: int = 2, scenes: bool = False) -> Gallery:
    """Run the bundled scenarios, or those named `only`, and write the folder, whole or not at all.

    A scenario that cannot be run has a card that says why. Scenarios are shared out over `jobs` processes.
    `scenes`: whether a browser takes pictures in 3D, one after the other.
    """
    available = bundled_scenarios()
    for name in only:
        expect_known("scenario", name, available, "only")
    names = sorted({*only} or available)
    with replaced_folder(folder, FolderKind(FORMAT, MARKER), patience=1.0) as temporary:
        (temporary / VIEWER).write_text(viewer_script(), encoding="utf-8")
        found = share_out(_Cards(names, temporary), range(len(names)), jobs, lambda number, fraction: None)
        cards = tuple(found[number] for number in sorted(found))
        if scenes:
            cards = tuple(_with_scene(card, temporary / card.name) for card in cards)
        (temporary / "index.html").write_text(render(cards), encoding="utf-8")
        content = {"format": FORMAT, "nmm": nmm.__version__, "scenarios": [asdict(card) for card in cards]}
        text = json.dumps(content, indent=2, ensure_ascii=False)
        (temporary / MARKER).write_text(text + "\n", encoding="utf-8")
    return Gallery(folder, folder / "index.html", cards)


def _with_scene(card: Card, folder: Path) -> Card:
    """A card with scene.png, the page's scene alone as it opens, or at two fifths of its time."""
    if not card.shown:
        return card
    with HeadlessPage(folder / "playback.html", SIZE) as page:
        page.wait_for("window.nmm && nmm.stage && !document.body.classList.contains('loading')")
        page.evaluate(ALONE)
        (folder / "scene.png").write_bytes(page.picture())
    return replace(card, picture="scene.png")


def render(cards: Sequence[Card]) -> str:
    """index.html; every link in it is relative to the page's folder."""
    places = ChoiceLoader([FileSystemLoader(Path(__file__).parent), PackageLoader("nmm.base.templates", ".")])
    pages = Environment(
        loader=places, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return pages.get_template("gallery.html").render(cards=cards, version=nmm.__version__)


@dataclass(frozen=True)
class _Cards:
    """A card by the number of its scenario, for a process that makes some of them."""

    names: Sequence[str]
    folder: Path

    def __call__(self, number: int, progress: Progress, /) -> Card:
        name = self.names[number]
        return make_card(name, self.folder / name, progress)


def make_card(name: str, folder: Path, progress: Progress | None = None) -> Card:
    """Run a bundled scenario; NAME.yaml, summary.json, motion.png and playback.html in a new folder."""
    folder.mkdir()
    shutil.copyfile(bundled_scenarios()[name], folder / f"{name}.yaml")
    title = name
    try:
        scenario = nmm.Scenario.load(name)
        title = scenario.title or name
        run = scenario.run(between(progress, 0.0, 0.5))
        if run.outcome == "interrupted":
            raise KeyboardInterrupt
        summary = run.summary()
        if len(run):
            save(stroboscopic(run), folder / "motion.png")
            page = page_of([run], title, False, viewer=f"../{VIEWER}", fps=FPS)[1]
            (folder / "playback.html").write_text(page, encoding="utf-8")
    except NmmError as error:
        return Card(name, title, "refused", str(error), (), False)
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    numbers = [("robot", f"{run.robot.name}, {summary['platform']}")]
    numbers += [(label, value) for label, value in summary_rows(run, summary) if label in LABELS]
    message = "" if run.complete else run.message
    return Card(name, title, str(run.outcome), message, tuple(numbers), len(run) > 0)
