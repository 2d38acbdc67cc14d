"""Pictures at which a test does not look are not drawn: that is more than half of what a command takes."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from PIL import Image

_drawn = Figure.savefig


def draw_only(names: Collection[str], patch: pytest.MonkeyPatch) -> None:
    """Figures are made as ever; as PNG, those of other file names are written as an empty picture."""

    def save(figure: Figure, path: Path, **options: Any) -> None:
        if path.suffix != ".png" or path.name in names:
            _drawn(figure, path, **options)
        else:
            Image.new("L", (8, 8)).save(path)

    patch.setattr(Figure, "savefig", save)
