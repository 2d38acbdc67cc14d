"""Writes docs/gallery.md, with a picture of each bundled scenario in docs/images/gallery/.

    python docs/make_gallery.py             the page and the pictures, by running every scenario
    python docs/make_gallery.py --page      the page alone

The titles are those of the scenario files; a test compares the page with them.
"""

import sys
import tempfile
from pathlib import Path

import nmm
from nmm.bundled import bundled_scenarios

HERE = Path(__file__).resolve().parent
PICTURES = HERE / "images" / "gallery"
#: Of a picture, px, and how many colours.
WIDTH, COLOURS = 640, 256
INTRODUCTION = """\
# Gallery

Every scenario that comes with `nmm`, drawn at instants of its motion, from above and, where the arm
rises, from the side. `nmm run NAME --play` plays one in the browser; `nmm gallery` writes a page with all
of them to play, with their numbers.
To begin one of your own, copy the file and change it ([all keys](scenarios.md)).

"""


def page() -> str:
    """The page, from the scenario files."""
    cards = []
    for name, path in bundled_scenarios().items():
        title = nmm.Scenario.load(name).title
        file = f"../{path.relative_to(HERE.parent)}"
        cards.append(
            f"## {name}\n\n{title}. [The file]({file}).\n\n"
            f"![{title}](images/gallery/{name}.png)\n\n```console\n$ nmm run {name} --play\n```\n"
        )
    return INTRODUCTION + "\n".join(cards)


def draw() -> None:
    """A small picture of each scenario's run."""
    from PIL import Image

    from nmm.gallery import write_gallery

    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()
    with tempfile.TemporaryDirectory() as folder:
        for card in write_gallery(Path(folder) / "gallery").cards:
            with Image.open(Path(folder) / "gallery" / card.name / "motion.png") as picture:
                size = (WIDTH, round(picture.height * WIDTH / picture.width))
                small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
            # FASTOCTREE: the other methods lose the colours of small marks.
            few = small.quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
            few.save(PICTURES / f"{card.name}.png", optimize=True)


if __name__ == "__main__":
    if "--page" not in sys.argv:
        draw()
    (HERE / "gallery.md").write_text(page(), encoding="utf-8")
