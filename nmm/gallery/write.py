"""The gallery's folder: written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from nmm import __version__
from nmm.bundled import bundled_scenarios
from nmm.errors import InputError, expect_known
from nmm.folders.whole import has_format, replaced_folder
from nmm.gallery.card import VIEWER, Card, make_card
from nmm.processes import share_out
from nmm.progress import Progress
from nmm.templates import template

#: Marks a folder as one of ours.
FORMAT = "nmm gallery 1"
_MARKER = "gallery.json"


@dataclass(frozen=True)
class Gallery:
    """What `write_gallery` wrote.

    Attributes
    ----------
    folder, index : the folder, and the page in it
    cards : a card a scenario, by name

    Examples
    --------
    >>> from nmm.gallery import write_gallery
    >>> made = write_gallery("gallery", ["unicycle_2r_position"], jobs=1)
    >>> made.index.name, len(made.cards)
    ('index.html', 1)
    """

    folder: Path
    index: Path
    cards: tuple[Card, ...]


def write_gallery(
    folder: str | Path,
    only: Sequence[str] | None = None,
    *,
    progress: Progress | None = None,
    jobs: int = 2,
) -> Gallery:
    """Run the bundled scenarios and write a page with a picture, numbers, playback and file of each.

    A scenario that cannot be run is told on its card; the others are there all the same.

    Parameters
    ----------
    folder : a new folder, or one that an earlier call wrote, which is replaced
    only : names of bundled scenarios; all of them when not given
    progress : called with the fraction done
    jobs : over how many processes the scenarios are shared out; with more than 1, a script needs
        `if __name__ == "__main__":`

    Raises
    ------
    InputError : a name that is not bundled; jobs below 1; the folder exists and is not ours, or cannot be
        written

    Examples
    --------
    >>> from nmm.gallery import write_gallery
    >>> made = write_gallery("gallery", ["unicycle_2r_position"], jobs=1)
    >>> sorted(path.name for path in made.folder.iterdir())
    ['gallery.json', 'index.html', 'unicycle_2r_position', 'viewer.js']
    """
    names = checked(only)
    if jobs < 1:
        raise InputError(f"jobs: expected at least 1, got {jobs}")
    done = [0.0] * len(names)

    def advance(number: int, fraction: float) -> None:
        done[number] = max(done[number], fraction)
        if progress is not None:
            progress(sum(done) / len(done))

    with replaced_folder(folder, is_gallery, patience=1.0) as temporary:
        from nmm.playback.page import viewer_script

        (temporary / VIEWER).write_text(viewer_script(), encoding="utf-8")
        found = share_out(_Cards(names, temporary), range(len(names)), jobs, advance)
        cards = tuple(found[number] for number in sorted(found))
        (temporary / "index.html").write_text(render(cards), encoding="utf-8")
        content = {"format": FORMAT, "nmm": __version__, "scenarios": [asdict(card) for card in cards]}
        text = json.dumps(content, indent=2, ensure_ascii=False)
        (temporary / _MARKER).write_text(text + "\n", encoding="utf-8")
    folder = Path(folder)
    return Gallery(folder, folder / "index.html", cards)


def checked(only: Sequence[str] | None, where: str = "only") -> list[str]:
    """Names of bundled scenarios, each once, sorted; all for None; `InputError` for one that is not."""
    available = bundled_scenarios()
    for name in only or ():
        expect_known("scenario", name, available, where)
    return sorted({*only}) if only else list(available)


def is_gallery(folder: Path) -> bool:
    """Whether a folder was written by `write_gallery`."""
    return has_format(folder / _MARKER, FORMAT)


def render(cards: Sequence[Card]) -> str:
    """index.html; every link in it is relative to the page's folder."""
    page = template("nmm.gallery", "templates", "index.html")
    return page.render(cards=cards, version=__version__)


@dataclass(frozen=True)
class _Cards:
    """A card by the number of its scenario, for a process that makes some of them."""

    names: Sequence[str]
    folder: Path

    def __call__(self, number: int, progress: Progress, /) -> Card:
        name = self.names[number]
        card = make_card(name, self.folder / name, progress)
        progress(1.0)
        return card
