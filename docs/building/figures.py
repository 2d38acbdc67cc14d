"""Which pictures are figures, drawn on white: the site's style turns them round in the dark."""

from pathlib import Path
from typing import Any

import numpy as np
from docutils import nodes
from PIL import Image

#: Of the pixels round a picture's edge all are as bright as this.
WHITE = 254


def told_from_others(app: Any, doctree: Any, name: str) -> None:
    """Figures of the page `name` have the class "drawn"."""
    for picture in doctree.findall(nodes.image):
        if is_drawn(Path(app.srcdir, picture["uri"])):
            picture["classes"].append("drawn")


def is_drawn(file: Path) -> bool:
    """Whether a picture is a drawing (SVG), or has white all round."""
    if file.suffix == ".svg":
        return True
    with Image.open(file) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    return all(edge.min() >= WHITE for edge in (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]))
