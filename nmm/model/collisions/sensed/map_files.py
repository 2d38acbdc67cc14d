"""Nav2's map files: YAML beside an image, by the rules of `nav2_map_server` (its `map_io.cpp`) in Humble to
Jazzy. Later ones take pixels at a threshold for occupied and free, too, and transparent ones for unknown."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from nmm.base.arrays import Array, positive, scalar, vector
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.files import read_bytes
from nmm.base.text_format import one_line

#: No file has more bytes.
LONGEST, LONGEST_IMAGE = 1_000_000, 500_000_000
REQUIRED = ("image", "resolution", "origin", "negate", "free_thresh", "occupied_thresh")
MODES = ("trinary", "scale", "raw")
#: What savers write for unknown cells.
UNKNOWN_SHADE = 205


class SeenMap(NamedTuple):
    """cells (ny, nx), the first row lowest; `unknown_as_free` : how many free cells have the shade of unknown
    ones, where these are more than half of all free ones"""

    cells: NDArray[np.int8]
    resolution: float
    origin: Array
    free_thresh: float
    unknown_as_free: int


class Image(NamedTuple):
    """values (ny, nx, channels) of 0 to `most`, the first row highest; `alpha` : whether the last channel
    is that of opacity"""

    values: NDArray[Any]
    most: int
    alpha: bool


def read_map(file: str | Path) -> SeenMap:
    """`InputError` names the file and the key."""
    path = Path(file)
    try:
        keys = yaml.safe_load(read_bytes(path, LONGEST).decode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or one_line(str(error))}", where=file) from None
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        raise InputError(f"is no YAML: {one_line(str(error))}", where=file) from None
    if not isinstance(keys, dict):
        raise InputError(where=file, expected=f"the keys {', '.join(REQUIRED)}", got=keys)
    missing = [key for key in REQUIRED if key not in keys]
    if missing:
        raise InputError(where=f"{file}: {missing[0]}", expected="this key", available=map(str, keys))
    try:
        return _map(path, keys)
    except InputError as error:
        raise error.at(file) from None


def _map(path: Path, keys: dict[str, Any]) -> SeenMap:
    mode, negate = keys.get("mode", "trinary"), keys["negate"]
    expect_known("mode", mode, MODES)
    expect(isinstance(negate, bool | int) and negate in (0, 1), "negate", "0, 1, true or false", negate)
    resolution = positive(keys["resolution"], "resolution")
    origin = vector(keys["origin"], 3, "origin")
    free, occupied = (scalar(keys[key], key) for key in ("free_thresh", "occupied_thresh"))
    expect(free <= occupied, "free_thresh", f"at most occupied_thresh, {occupied:g}", free)
    expect(isinstance(keys["image"], str) and keys["image"], "image", "a file's name", keys["image"])
    named = Path(keys["image"])
    image = read_image(named.expanduser() if keys["image"].startswith("~/") else path.parent / named)
    cells = cells_of(image, mode, bool(negate), free, occupied)
    shades = 255.0 * image.values[..., : image.values.shape[2] - image.alpha].mean(axis=2) / image.most
    unknown = np.count_nonzero((np.rint(shades[::-1]) == UNKNOWN_SHADE) & (cells == 0))
    most = 2 * unknown > np.count_nonzero(cells == 0)
    return SeenMap(cells, resolution, origin, free, int(unknown) if most else 0)


def cells_of(
    image: Image, mode: str, negate: bool, free_thresh: float, occupied_thresh: float
) -> NDArray[np.int8]:
    """-1 and 0 to 100 of an image's pixels (ny, nx), the first row lowest."""
    shares = image.values / float(image.most)
    colours = shares[..., :-1] if image.alpha else shares
    # Of trinary maps the rule takes opacity for a fourth colour.
    shade = (shares if mode == "trinary" else colours).mean(axis=2)
    cells = np.full(shade.shape, -1, dtype=np.int8)
    if mode == "raw":
        values = np.rint(shade * 255.0)
        cells[values <= 100.0] = values[values <= 100.0].astype(np.int8)
        return cells[::-1].copy()
    share = shade if negate else 1.0 - shade
    if mode == "scale":
        span = max(occupied_thresh - free_thresh, 1e-9)
        between = np.rint((share - free_thresh) / span * 100.0)
        cells = np.clip(between, 0, 100).astype(np.int8)
    cells[share > occupied_thresh] = 100
    cells[share < free_thresh] = 0
    if mode == "scale" and image.alpha:
        cells[shares[..., -1] < 1.0] = -1
    return cells[::-1].copy()


def read_image(file: Path) -> Image:
    """A PGM, PNG or BMP file."""
    try:
        content = read_bytes(file, LONGEST_IMAGE)
    except OSError as error:
        what = f"cannot be read: {error.strerror or one_line(str(error))}"
        raise InputError(what, where=f"image {file}") from None
    import PIL.Image

    try:
        with PIL.Image.open(io.BytesIO(content), formats=("PNG", "PPM", "BMP")) as file_image:
            file_image.load()
            image: PIL.Image.Image = file_image
            most, alpha = 255, "A" in image.getbands() or "transparency" in image.info
            deep = image.mode.startswith("I")
            if image.mode in ("1", "P", "PA", "LA", "CMYK") or (alpha and not deep and image.mode != "RGBA"):
                image = image.convert("RGBA" if alpha else "RGB")
            values = np.asarray(image)
            if deep:
                most = 65535
            if deep and alpha:  # pillow converts no grey of 16 bits
                opacity = np.where(values == image.info["transparency"], 0, most)
                values = np.stack([values, opacity], axis=2)
    except Exception as error:  # pillow's readers raise whatever they meet
        what = f"is damaged, or no PGM, PNG or BMP ({type(error).__name__}: {one_line(str(error))})"
        raise InputError(what, where=f"image {file}") from None
    return Image(values if values.ndim == 3 else values[:, :, np.newaxis], most, bool(alpha))
