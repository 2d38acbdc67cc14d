"""Makes the pictures of the README and the site, but for the drawings of platforms and the gallery's cards:

    python docs/make_pictures.py [NAME …]     all of them, or those named, as car_parks.gif
    python docs/make_pictures.py --check      which are old; exit status 1 where a scenario has changed since

docs/images/made_from.json keeps what each was made from; docs/make_gallery.py makes the gallery's.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "building"))

from made_from import IMAGES, drawn_before, old, record
from make_gallery import save_small
from PIL import Image

import nmm
from nmm.base.errors import expect_known
from nmm.plugins.live.rendering.chromium import HeadlessPage
from nmm.views.figures import overview, save
from nmm.views.playback import write_html

#: Of a picture, at most, px.
WIDTH = 1248
#: Waits until a page has drawn what it was told.
DRAWN = """new Promise((done) => {
  let left = 6;
  const next = () => (left-- ? requestAnimationFrame(next) : done());
  next();
})"""


def film(scenario: str, file: Path) -> None:
    """The moving picture: small, four times as fast as the motion."""
    loaded = nmm.Scenario.load(scenario)
    nmm.rendering.render([loaded.run()], file, size=(640, 360), fps=8, speed=4.0, title=loaded.title)


def page(
    scenario: str, file: Path, time: float, *, resolvers: Sequence[str] = (), ellipsoids: bool = False
) -> None:
    """A picture of the page of a run, or of a comparison, at a time, s."""
    loaded = nmm.Scenario.load(scenario)
    runs = [loaded.with_resolver(name).run() for name in resolvers] or [loaded.run()]
    with tempfile.TemporaryDirectory() as folder:
        written = write_html(runs, Path(folder) / "page.html", title=loaded.title, ellipsoids=ellipsoids)
        with HeadlessPage(written, (1200, 720)) as browser:
            browser.wait_for("window.nmm && nmm.stage && !document.body.classList.contains('loading')")
            browser.evaluate(
                f"nmm.plots.show({str(bool(resolvers)).lower()}); nmm.player.seek({time}); {DRAWN}"
            )
            file.write_bytes(browser.picture())


def command(file: Path, *words: str) -> None:
    """A figure that a command writes; of a map, the one measure's."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        subprocess.run(
            [sys.executable, "-m", "nmm", *words, "--out", str(out)], check=True, stdout=subprocess.DEVNULL
        )
        name = file.name if words[0] != "map" else "sigma_min.png"
        shutil.copyfile(next(out.rglob(name)), file)


#: Each picture's scenario, or robot, and how it is made from it.
PICTURES: dict[str, tuple[str, Callable[[str, Path], None]]] = {
    "car_parks.gif": ("car_parks", film),
    "playback.png": (
        "unicycle_2r_position",
        lambda name, file: page(name, file, 1.6, resolvers=("rg", "pg", "ej")),
    ),
    "overview.png": (
        "unicycle_2r_position",
        lambda name, file: save(overview(nmm.Scenario.load(name).run()), file),
    ),
    "trailers.png": ("small_arm_second_trailer", lambda name, file: page(name, file, 20.0)),
    "singularities/map.png": (
        "unicycle_3r",
        lambda name, file: command(
            file, "map", name, "--task", "position", "--over", "q2,q3", "--measure", "sigma_min"
        ),
    ),
    "singularities/ellipses.png": (
        "unicycle_2r_position",
        lambda name, file: command(file, "run", name, "--ellipsoids"),
    ),
    "singularities/ellipsoids.png": (
        "ur5_unicycle_pose",
        lambda name, file: page(name, file, 0.0, ellipsoids=True),
    ),
}


def make(names: Sequence[str]) -> None:
    """Make these pictures, and keep what they are made from."""
    for name in names:
        expect_known("picture", name, PICTURES, "docs/make_pictures.py")
        source, maker = PICTURES[name]
        file = IMAGES / name
        maker(source, file)
        if file.suffix == ".png":
            with Image.open(file) as picture:
                picture.load()
            save_small(picture, file, WIDTH)
        record({name: source})
        print(f"docs/images/{name}: from {source}")


def check() -> int:
    """Say which pictures are old; 1 where a scenario or robot has changed since one was made."""
    changed, before = old(), drawn_before()
    print(f"{len(changed)} pictures are older than what they show{''.join(f', {one}' for one in changed)}")
    print(f"{len(before)} were drawn before the last change of what draws them; look whether it shows")
    return int(bool(changed))


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        sys.exit(check())
    make(sys.argv[1:] or list(PICTURES))
