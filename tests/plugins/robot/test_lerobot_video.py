"""Pictures in a data set of LeRobot's, decoded by ffmpeg; by LeRobot itself in test_lerobot_loader."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pyarrow")
import pyarrow.parquet as pq

import nmm
from nmm.cli.exit_status import status_of
from nmm.plugins.live.rendering.encoder import find_ffmpeg
from nmm.plugins.robot.lerobot.videos import PIXELS

ISO, TOP = "observation.images.iso", "observation.images.top"
SIZE = (96, 64)


def runs() -> list[nmm.Trajectory]:
    return [
        nmm.Scenario.load("unicycle_2r_position", {"duration": duration, "dt": 0.05}).run()
        for duration in (0.6, 0.4)
    ]


def decoded(file: Path) -> np.ndarray:
    """Pictures (N, height, width, 3), 0 to 1."""
    command = [
        find_ffmpeg(),
        "-loglevel",
        "error",
        "-i",
        str(file),
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-",
    ]
    done = subprocess.run(command, check=True, capture_output=True)
    return np.frombuffer(done.stdout, np.uint8).reshape(-1, SIZE[1], SIZE[0], 3) / 255.0


@pytest.mark.browser
def test_each_episode_has_a_video_in_step_with_its_frames(tmp_path: Path) -> None:
    several = runs()
    place = nmm.write_lerobot(several, tmp_path / "set", fps=10, video=("iso", "top"), size=SIZE)
    info = json.loads((place / "meta" / "info.json").read_text())
    stats = json.loads((place / "meta" / "stats.json").read_text())
    rows = pq.read_table(place / "meta" / "episodes").to_pylist()
    assert [row["length"] for row in rows] == [7, 5]
    for key in (ISO, TOP):
        told = info["features"][key]
        assert (told["dtype"], told["shape"]) == ("video", [64, 96, 3])
        assert (told["info"]["video.fps"], told["info"]["video.codec"]) == (10, "h264")
        seen = []
        for row in rows:
            name = info["video_path"].format(
                video_key=key,
                chunk_index=row[f"videos/{key}/chunk_index"],
                file_index=row[f"videos/{key}/file_index"],
            )
            pictures = decoded(place / name)
            assert len(pictures) == row["length"]
            assert row[f"videos/{key}/from_timestamp"] == 0.0
            assert row[f"videos/{key}/to_timestamp"] == pytest.approx(row["length"] / 10)
            steps = np.abs(np.diff(pictures, axis=0)).mean(axis=(1, 2, 3))
            assert steps.min() > 0.0  # it moves
            own = np.array(row[f"stats/{key}/mean"])
            assert own.shape == (3, 1, 1)
            few = pictures[:, ::PIXELS, ::PIXELS]
            np.testing.assert_allclose(own.ravel(), few.mean(axis=(0, 1, 2)), atol=0.02)
            assert row[f"stats/{key}/count"] == [row["length"]]
            seen.append(few.reshape(-1, 3))
        np.testing.assert_allclose(np.ravel(stats[key]["mean"]), np.concatenate(seen).mean(axis=0), atol=0.02)
        assert stats[key]["count"] == [12]
    assert not np.allclose(
        *(decoded(place / "videos" / key / "chunk-000" / "file-000.mp4")[0] for key in (ISO, TOP))
    )
    columns = pq.read_table(place / "data").column_names
    assert ISO not in columns
    for run, read in zip(several, nmm.read_lerobot(place, several[0].robot), strict=True):
        np.testing.assert_allclose(read.q, run.q[::2], atol=1e-6)
    again = nmm.write_lerobot(several[:1], place, fps=10)  # nobody has changed it
    assert not (again / "videos").exists()


@pytest.mark.browser
def test_pictures_show_the_robot_and_not_what_it_is_to_do(tmp_path: Path) -> None:
    """The same motion with another task looks the same: no path, target or clock is drawn."""
    from dataclasses import replace

    run = runs()[1]
    other = replace(run, desired=run.desired + np.array([0.3, 0.2, 0.1]))
    first, second = (
        nmm.write_lerobot([one], tmp_path / name, task="go", fps=10, video="iso", size=SIZE)
        for one, name in ((run, "a"), (other, "b"))
    )
    video = Path("videos") / ISO / "chunk-000" / "file-000.mp4"
    np.testing.assert_array_equal(decoded(first / video), decoded(second / video))


@pytest.mark.browser
def test_export_writes_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runs()[1].save("run")
    asked = ["--fps", "10", "--video", "top", "--size", "96x64"]
    assert status_of(["export", "run", "--lerobot", "set", *asked]) == 0
    assert len(decoded(Path("set") / "videos" / TOP / "chunk-000" / "file-000.mp4")) == 5


@pytest.mark.parametrize("missing", ["find_browser", "find_ffmpeg"])
def test_without_chromium_or_ffmpeg_nothing_is_written(
    missing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none() -> str:
        raise nmm.RunError("none is installed")

    monkeypatch.setattr(f"nmm.plugins.robot.lerobot.videos.{missing}", none)
    with pytest.raises(nmm.RunError, match="none is installed"):
        nmm.write_lerobot(runs()[:1], tmp_path / "set", fps=10, video="iso")
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"video": "below"}, "unknown view 'below'"),
        ({"video": ["iso", "iso"]}, "each side once"),
        ({"video": "iso", "size": (95, 64)}, "even numbers"),
        ({"video": 5}, "video"),
    ],
)
def test_what_cannot_be_seen_is_told(options: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(nmm.InputError, match=said):
        nmm.write_lerobot(runs()[:1], tmp_path / "set", fps=10, **options)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--mcap", "--video", "iso"], "--lerobot"),
        (["--lerobot", "set", "--size", "96x64"], "--video"),
        (["--lerobot", "set", "--video", "iso", "--size", "big"], "WIDTHxHEIGHT"),
        (["--lerobot", "set", "--video", "below"], "unknown view 'below'"),
    ],
)
def test_export_says_what_pictures_are_of(
    asked: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    runs()[1].save("run")
    assert status_of(["export", "run", *asked]) == 2
    assert said in capsys.readouterr().err
    assert [*tmp_path.iterdir()] == [tmp_path / "run"]
