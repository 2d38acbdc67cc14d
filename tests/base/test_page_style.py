"""The style that pages of figures share, in a real browser."""

from __future__ import annotations

import base64
import io
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playback_browser import browser as browser
from playwright.sync_api import Browser

STYLE = resources.files("nmm.base").joinpath("templates", "page.css").read_text("utf-8")


@pytest.mark.parametrize(("scheme", "ground"), [("light", (255, 255, 255)), ("dark", (20, 23, 28))])
def test_a_figures_white_is_the_pages_ground(
    browser: Browser, tmp_path: Path, scheme: str, ground: tuple[int, int, int]
) -> None:
    """In the dark it was a grey box; a line on it stays one that can be seen."""
    figure, file = Image.new("RGB", (60, 60), "white"), io.BytesIO()
    figure.paste((0, 0, 0), (20, 0, 40, 60))
    figure.save(file, "png")
    picture = base64.b64encode(file.getvalue()).decode("ascii")
    text = f'<style>{STYLE}</style><img src="data:image/png;base64,{picture}" style="display: block">'
    (tmp_path / "page.html").write_text(text, "utf-8")
    page = browser.new_page(color_scheme=scheme)  # type: ignore[arg-type]  # one of two
    page.goto((tmp_path / "page.html").as_uri())
    place = page.locator("img").bounding_box()
    assert place is not None
    shot = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), dtype=int)
    page.close()
    y, x = int(place["y"]) + 30, int(place["x"])
    np.testing.assert_array_equal(shot[2, 2], ground)
    np.testing.assert_allclose(shot[y, x + 5], ground, atol=1)
    assert np.abs(shot[y, x + 30] - ground).min() > 150
