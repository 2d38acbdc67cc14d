"""Pictures of a data set's frames, as videos that LeRobot decodes."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nmm.base.arrays import Array
from nmm.base.errors import expect, expect_known, one_or_several
from nmm.motion.trajectory import Trajectory
from nmm.plugins.live.rendering.chromium import find_browser
from nmm.plugins.live.rendering.encoder import encode, find_ffmpeg
from nmm.plugins.live.rendering.still_views import scene_views
from nmm.plugins.live.rendering.video import VIEWS, checked_size
from nmm.plugins.robot.lerobot import layout
from nmm.plugins.robot.lerobot.stats import statistics

#: A picture can be decoded without all before it, and none is shown before one that was sent earlier.
SEEKABLE = ("-g", "2", "-bf", "0")
#: Statistics are of so many pictures of an episode at most, and of every so many-th pixel of their rows and
#: columns.
PICTURES, PIXELS = 100, 8


class EpisodeVideos:
    """Videos of episodes, one for each side that a run is seen from: `observation.images.iso` and so on.

    Parameters
    ----------
    folder : of the data set
    fps : frames a second
    views : sides, as of `rendering.render`, one after the other
    size : width and height, px, even numbers

    Raises
    ------
    InputError : no such side, or one twice; a size that cannot be
    RunError : no Chromium, no ffmpeg
    """

    def __init__(self, folder: Path, fps: int, views: str | Sequence[str], size: tuple[int, int]) -> None:
        self.views = one_or_several(views, str, "video", "a side, or several")
        for view in self.views:
            expect_known("view", view, VIEWS, "video")
        expect(len({*self.views}) == len(self.views), "video", "each side once", self.views)
        self._folder, self._fps = folder, fps
        self._size = checked_size(size)
        self._seen: dict[str, list[NDArray[np.uint8]]] = {view: [] for view in self.views}
        self._places = layout.places()
        find_browser(), find_ffmpeg()

    def features(self) -> dict[str, dict[str, Any]]:
        """As info.json has them."""
        width, height = self._size
        info = {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": self._fps,
            "video.channels": 3,
            "has_audio": False,
        }
        told = {"dtype": "video", "shape": [height, width, 3], "names": ["height", "width", "channels"]}
        return {key_of(view): {**told, "info": info} for view in self.views}

    def add(self, run: Trajectory, count: int) -> dict[str, Any]:
        """Write the videos of an episode of `count` frames; what its row of episodes says of them."""
        chunk, file = next(self._places)
        times = run.t[0] + np.arange(count) / self._fps
        told: dict[str, Any] = {}
        with scene_views(run, self._size) as pictures:
            for view in self.views:
                key = key_of(view)
                name = layout.VIDEO.format(video_key=key, chunk_index=chunk, file_index=file)
                (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
                some: list[NDArray[np.uint8]] = []
                shown = pictures.of(view, np.minimum(times, run.t[-1]).tolist())
                encode(_looked_at(shown, count, some), self._folder / name, self._fps, SEEKABLE)
                self._seen[view] += some
                told |= {
                    f"videos/{key}/chunk_index": chunk,
                    f"videos/{key}/file_index": file,
                    f"videos/{key}/from_timestamp": 0.0,
                    f"videos/{key}/to_timestamp": count / self._fps,
                }
                told |= {f"stats/{key}/{kind}": values for kind, values in _of_colors(some).items()}
        return told

    def statistics(self) -> dict[str, dict[str, Any]]:
        """Of all episodes."""
        return {key_of(view): _of_colors(seen) for view, seen in self._seen.items()}


def key_of(view: str) -> str:
    return f"{layout.VIDEOS}.{view}"


def _looked_at(shown: Iterator[bytes], count: int, some: list[NDArray[np.uint8]]) -> Iterator[bytes]:
    """The same pictures; pixels (N, 3) of some of them are added to `some`."""
    from PIL import Image

    wanted = {*np.linspace(0, count - 1, min(count, PICTURES)).round().astype(int).tolist()}
    for k, picture in enumerate(shown):
        if k in wanted:
            pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=np.uint8)
            some.append(pixels[::PIXELS, ::PIXELS].reshape(-1, 3))
        yield picture


def _of_colors(some: Sequence[NDArray[np.uint8]]) -> dict[str, Any]:
    """Statistics of red, green and blue, 0 to 1, as LeRobot shapes them: (3, 1, 1); of how many pictures."""
    rows: Array = np.concatenate(some) / 255.0
    found = statistics(rows)
    shaped = {name: [[[value]] for value in values] for name, values in found.items() if name != "count"}
    return {**shaped, "count": [len(some)]}
