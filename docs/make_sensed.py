"""Writes what the bundled scenarios with sensed obstacles read, into scenarios/sensed/.

    python docs/make_sensed.py

A scan of a doorway: rays of a scanner at two places, off by 3 mm, one point of each 4 cm. A map of two rooms
as Nav2's map saver writes it: a picture and its YAML file.
"""

from pathlib import Path

import numpy as np
from PIL import Image

FOLDER = Path(__file__).resolve().parents[1] / "scenarios" / "sensed"
#: Boxes, centre and edges, m: a wall with a door of 0.9 m, a table, a cupboard.
BOXES = np.array(
    [
        [2.0, 1.475, 1.1, 0.1, 2.05, 2.2],
        [2.0, -1.475, 1.1, 0.1, 2.05, 2.2],
        [2.0, 0.0, 2.1, 0.1, 0.9, 0.2],
        [4.2, -1.4, 0.72, 0.8, 1.4, 0.04],
        *([x, y, 0.35, 0.06, 0.06, 0.7] for x in (3.87, 4.53) for y in (-2.03, -0.77)),
        [4.0, 1.9, 0.9, 1.0, 0.5, 1.8],
    ]
)
#: Where the scanner stood, m, and its noise, m.
STANDS, NOISE = ((-0.5, -0.6, 1.0), (3.2, 0.5, 1.0)), 0.003


def scanned(stand: tuple[float, float, float]) -> np.ndarray:
    """Where the rays of a scanner end, (N, 3), m."""
    turn, up = np.meshgrid(np.radians(np.arange(0.0, 360.0, 0.5)), np.radians(np.arange(-45.0, 50.0, 0.5)))
    rays = np.stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)], axis=-1).reshape(
        -1, 3
    )
    reached = np.full(len(rays), np.inf)
    for box in BOXES:
        with np.errstate(divide="ignore"):
            ends = [(box[:3] + side * 0.5 * box[3:] - stand) / rays for side in (-1.0, 1.0)]
        enters, leaves = np.minimum(*ends).max(axis=1), np.maximum(*ends).min(axis=1)
        hit = (enters <= leaves) & (enters > 0.0)
        reached[hit] = np.minimum(reached[hit], enters[hit])
    return stand + rays[np.isfinite(reached)] * reached[np.isfinite(reached), np.newaxis]


def doorway() -> np.ndarray:
    points = np.vstack([scanned(stand) for stand in STANDS])
    points += np.random.default_rng(0).normal(0.0, NOISE, points.shape)
    _, first = np.unique(np.floor(points / 0.04).astype(int), axis=0, return_index=True)
    return np.round(points[np.sort(first)], 3).astype(np.float32)


def rooms() -> np.ndarray:
    """Pixels, the first row with the greatest y: 254 free, 0 occupied, 205 unknown; 5 cm each."""
    pixels = np.full((100, 140), 205, dtype=np.uint8)
    pixels[10:90, 10:130] = 254
    for rows, columns in (
        ((10, 12), (10, 130)),
        ((88, 90), (10, 130)),
        ((10, 90), (10, 12)),
        ((10, 90), (128, 130)),
        ((10, 62), (66, 68)),
        ((80, 90), (66, 68)),
        ((30, 42), (84, 102)),
        ((40, 46), (24, 36)),
    ):
        pixels[slice(*rows), slice(*columns)] = 0
    return pixels


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    np.savez_compressed(FOLDER / "doorway.npz", points=doorway())
    Image.fromarray(rooms()).save(FOLDER / "rooms.png", optimize=True)
    (FOLDER / "rooms.yaml").write_text(
        "image: rooms.png\nmode: trinary\nresolution: 0.05\norigin: [-1.0, -2.5, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )
