"""Writes docs/gallery.md, with a picture of each bundled scenario in docs/images/gallery/.

    python docs/make_gallery.py             the page and the pictures, by running every scenario
    python docs/make_gallery.py --page      the page alone
    python docs/make_gallery.py --folder DIR [NAME …]     a folder with every scenario, or those named:
                                            index.html with pictures, numbers, files, pages that play them

The titles are those of the scenario files; a test compares the page with them.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import nmm
from nmm.base.bundled import bundled_scenarios
from nmm.plugins.live.rendering.chromium import NAMES

if TYPE_CHECKING:
    from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "building"))
PICTURES = HERE / "images" / "gallery"
#: Of a card's picture, px, and how many colours pictures have.
WIDTH, COLOURS = 640, 256
COLUMNS = 3
INTRODUCTION = """\
# Gallery

Every scenario that comes with `nmm`, with copies of the robot along its way. `nmm run NAME --play` plays
one in the browser; a picture leads to its file. From the repository,
`python docs/make_gallery.py --folder DIR` writes a page with all of them, which play where they stand, with
their numbers. To begin one of your own, copy the file and change it ([all keys](scenarios.md)).

"""


def page() -> str:
    """The page, from the scenario files."""
    cells = []
    for name, path in bundled_scenarios().items():
        title = nmm.Scenario.load(name).title
        file = f"../{path.relative_to(HERE.parent)}"
        cells.append(f"[![{title}](images/gallery/{name}.png)]({file})<br>**{name}**<br>{title}")
    cells += [""] * (-len(cells) % COLUMNS)
    rows = [cells[k : k + COLUMNS] for k in range(0, len(cells), COLUMNS)]
    lines = ["| | | |", "|---|---|---|", *(f"| {' | '.join(row)} |" for row in rows)]
    return INTRODUCTION + "\n".join(lines) + "\n"


def draw() -> None:
    """A small picture of each scenario's run."""
    from gallery import write_gallery
    from made_from import record
    from PIL import Image

    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()
    with tempfile.TemporaryDirectory() as folder:
        for card in write_gallery(Path(folder) / "gallery", scenes=True).cards:
            with Image.open(Path(folder) / "gallery" / card.name / card.picture) as picture:
                save_small(picture, PICTURES / f"{card.name}.png", WIDTH)
            record({f"gallery/{card.name}.png": card.name})


def save_small(picture: "Image.Image", file: Path, width: int) -> None:
    """Save a picture at most `width` pixels wide, in few colours."""
    from PIL import Image

    if picture.width > width:
        size = (width, round(picture.height * width / picture.width))
        picture = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    # FASTOCTREE: the other methods lose the colours of small marks.
    few = picture.convert("RGB").quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(file, optimize=True)


def write_folder(folder: str, *only: str) -> bool:
    """The gallery's folder; whether every scenario ran to its end."""
    from gallery import write_gallery

    made = write_gallery(Path(folder), only, scenes=any(map(shutil.which, NAMES)))
    for card in made.cards:
        print(f"{card.name}: {card.outcome}" + ("" if card.ran else f": {card.message}"))
    print(f"open {made.index}")
    return all(card.ran for card in made.cards)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--folder"]:
        sys.exit(0 if write_folder(*sys.argv[2:]) else 1)
    if "--page" not in sys.argv:
        draw()
    (HERE / "gallery.md").write_text(page(), encoding="utf-8")
