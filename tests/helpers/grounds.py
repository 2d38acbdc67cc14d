"""The colours of a picture in a page, as they are on the screen."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image
from playwright.sync_api import Locator

#: Pixels beside a picture, where the page's own ground is, and within it, where a figure has only its own.
BESIDE, WITHIN = 3, 5


def grounds(picture: Locator) -> tuple[np.ndarray, np.ndarray, int]:
    """The page's ground left of a picture (3,), the picture's own at its left and upper edge (K, 3), and how
    far what is farthest from the page's ground is off it, 0 to 255."""
    picture.scroll_into_view_if_needed()
    picture.evaluate("one => one.decode()")
    place = picture.bounding_box()
    assert place is not None
    shot = np.asarray(Image.open(io.BytesIO(picture.page.screenshot())).convert("RGB"), dtype=int)
    left, top = round(place["x"]), round(place["y"])
    right, bottom = round(left + place["width"]), round(top + place["height"])
    ground = shot[(top + bottom) // 2, left - BESIDE]
    own = shot[max(top, 0) : bottom, max(left, 0) : right]
    edges = np.vstack([own[WITHIN:-WITHIN, WITHIN], own[WITHIN, WITHIN:-WITHIN]])
    return ground, edges, int(np.abs(own - ground).max())
