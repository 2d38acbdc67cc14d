"""Pictures made into a video, by ffmpeg."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from nmm.base.errors import InputError, RunError, expect
from nmm.base.files import replaceable, writing, written_at

CODECS = {
    ".mp4": ("-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
    ".webm": ("-c:v", "libvpx-vp9", "-crf", "32", "-b:v", "0", "-pix_fmt", "yuv420p", "-row-mt", "1"),
    ".gif": ("-filter_complex", "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=bayer"),
}  # fmt: skip

#: A disk that has not even as much room is full, bytes.
PROBE = 65_536


def expect_video(file: Path) -> Path:
    """The path of a video to write; `InputError` for another suffix, a missing folder or a device."""
    expect(file.suffix.lower() in CODECS, str(file), f"a file that ends in {', '.join(CODECS)}")
    if file.is_dir() or not file.parent.is_dir():
        what = "is a folder" if file.is_dir() else f"the folder {file.parent} is not there"
        raise InputError(f"cannot be written: {what}", where=str(file))
    return replaceable(file)


def find_ffmpeg() -> str:
    """The system's ffmpeg, or the one of the package imageio-ffmpeg; `RunError` for none."""
    if program := shutil.which("ffmpeg"):
        return program
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise RunError(
            "videos need ffmpeg, and none is installed: pip install imageio-ffmpeg, or the system's own"
        ) from None


def last_words(log: Path) -> str:
    return "".join(log.read_text(errors="replace").strip().splitlines()[-1:])


def encode(pictures: Iterable[bytes], file: Path, fps: float, options: Sequence[str] = ()) -> None:
    """Write PNG pictures of one size with even sides as a video in the format of the file's suffix, whole or
    not at all; `options` are ffmpeg's own besides. `InputError` for a file that cannot be written, `RunError`
    if ffmpeg is missing or fails."""
    target = expect_video(file)
    program = find_ffmpeg()
    with (
        written_at(file),
        writing(target, patience=1.0) as hidden,
        tempfile.TemporaryDirectory(dir=hidden) as folder,
    ):
        made = Path(folder) / f"made{file.suffix.lower()}"
        log = Path(folder) / "log"
        command = [
            program, "-y", "-loglevel", "error", "-f", "image2pipe", "-c:v", "png", "-framerate", f"{fps:g}",
            "-i", "-", *CODECS[file.suffix.lower()], *options, str(made),
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
            words = last_words(log)
            log.write_bytes(bytes(PROBE))  # where the disk is full, this says so
            raise RunError(f"ffmpeg: {words or 'ended without a word'}")
        made.replace(target)
