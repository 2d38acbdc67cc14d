"""Pictures made into a video, by ffmpeg."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

from nmm.errors import InputError, RunError
from nmm.files import replaceable
from nmm.writing import writing

#: ffmpeg's options by the file's suffix.
CODECS = {
    ".mp4": ("-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
    ".webm": ("-c:v", "libvpx-vp9", "-crf", "32", "-b:v", "0", "-pix_fmt", "yuv420p", "-row-mt", "1"),
    ".gif": ("-filter_complex", "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=bayer"),
}  # fmt: skip


def expect_video(file: Path) -> Path:
    """The file that a video takes the place of; `InputError` for another suffix, a folder that is not there,
    a device."""
    if file.suffix.lower() not in CODECS:
        raise InputError(f"{file}: expected a file that ends in {', '.join(CODECS)}")
    if file.is_dir() or not file.parent.is_dir():
        what = "is a folder" if file.is_dir() else f"the folder {file.parent} is not there"
        raise InputError(f"{file}: cannot be written: {what}")
    return replaceable(file)


def find_ffmpeg() -> str:
    """ffmpeg's program, the system's or the one of the package imageio-ffmpeg; `RunError` for none."""
    found = shutil.which("ffmpeg")
    if found is not None:
        return found
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise RunError(
            "videos need ffmpeg, and none is installed: pip install 'nmm[video]', or the system's own"
        ) from None


def encode(pictures: Iterable[bytes], file: Path, fps: float) -> None:
    """Write PNG pictures as a video, which appears whole or not at all.

    Parameters
    ----------
    pictures : all of one size, whose sides are even
    file : its suffix says the format: .mp4, .webm, .gif
    fps : pictures a second

    Raises
    ------
    InputError : another suffix, a file that cannot be written
    RunError : no ffmpeg, or one that fails
    """
    target = expect_video(file)
    program = find_ffmpeg()
    with writing(target, patience=1.0) as hidden, tempfile.TemporaryDirectory(dir=hidden) as folder:
        made = Path(folder) / f"made{file.suffix.lower()}"
        log = Path(folder) / "log"
        command = [
            program, "-y", "-loglevel", "error", "-f", "image2pipe", "-c:v", "png", "-framerate", f"{fps:g}",
            "-i", "-", *CODECS[file.suffix.lower()], str(made),
        ]  # fmt: skip
        read, write = os.pipe()
        with log.open("wb") as errors:
            process = subprocess.Popen(command, stdin=read, stderr=errors, start_new_session=True)
        os.close(read)
        try:
            with os.fdopen(write, "wb") as pipe:
                for picture in pictures:
                    pipe.write(picture)
        except BrokenPipeError:
            pass  # it has ended, and says why
        except BaseException:
            process.kill()
            process.wait()
            raise
        if process.wait() != 0:
            lines = log.read_text(errors="replace").strip().splitlines()
            raise RunError(f"ffmpeg: {lines[-1] if lines else 'ended without a word'}")
        try:
            made.replace(target)
        except OSError as error:
            raise InputError(f"{file}: cannot be written: {error.strerror}") from None
