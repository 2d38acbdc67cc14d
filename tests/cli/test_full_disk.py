"""Every command that writes, on a disk that gets full: a line, the old result or the new one whole."""

from __future__ import annotations

import errno
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from killing import Commands
from test_killed_commands import CASES, content, each, files, hidden

import nmm
from nmm.base.files import UnwrittenError
from nmm.model.robots.motion import Motion
from nmm.views.playback import write_html

#: NMM_KILLS=30 fills the disk so often for each command.
TIMES = max(2, int(os.environ.get("NMM_KILLS", "0")))
SIZE = 64_000_000
#: The system counts in pages, and needs one for each folder.
PAGE = 4096


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A small disk of its own."""
    place = tmp_path_factory.mktemp("disk")
    mounted = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(place)]
    if sys.platform != "linux" or subprocess.run(mounted, capture_output=True, check=False).returncode:
        pytest.skip("nobody may mount a disk here")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commands]:
    with Commands(tmp_path_factory.mktemp("scratch")) as found:
        yield found


def filled(disk: Path, room: int) -> Path:
    """A file that leaves as many bytes."""
    filler = disk / "filler"
    with filler.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(PAGE, shutil.disk_usage(disk).free - room))
    return filler


def line(name: str, made: str, number: int) -> str:
    where = f"--out: {made}" if name == "init" else made
    return f"nmm {name}: {where}: cannot be written: {os.strerror(number)}\n"


@pytest.mark.parametrize(
    "name", [case for case in each("run", "init") if case.values[0] not in ("sweep", "render")]
)
def test_a_file_that_gets_too_long(tmp_path: Path, commands: Commands, name: str) -> None:
    """What needs no disk of its own. A sweep's run is written elsewhere first; a film by another program."""
    case, folder = CASES[name], tmp_path / "here"
    made = folder / case.made
    folder.mkdir()
    assert commands.run(folder, [*case.arguments], prepared=case.prepared).status == 0
    longest = max(path.stat().st_size for path in [made, *made.rglob("*")] if path.is_file())
    if name == "init":
        made.unlink()
    old = content(made)
    ended = commands.run(folder, [*case.arguments], prepared=case.prepared, longest=longest - 1)
    assert (ended.status, ended.err) == (1, line(name, case.made, errno.EFBIG))
    assert content(made) == old
    assert hidden(folder) == []


def test_a_disk_without_room_for_names(disk: Path, robot_2r: nmm.Robot) -> None:
    """A hidden folder, for whose lock there is no room, goes again."""
    full = disk / "names"
    full.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "nr_inodes=2", "tmpfs", str(full)], check=True)
    q = robot_2r.rest[None]
    motion = Motion(robot_2r, np.array([0.0]), q, np.zeros((1, robot_2r.n_u)))
    try:
        with pytest.raises(
            UnwrittenError, match=r"names/o\.html: cannot be written: No space left on device"
        ):
            write_html([motion], full / "o.html")
        assert list(full.iterdir()) == []
    finally:
        subprocess.run(["umount", "-l", str(full)], check=True)


@pytest.mark.parametrize("name", each("run", "init"))
def test_a_disk_that_gets_full(disk: Path, commands: Commands, name: str) -> None:
    rng, case, folder = random.Random(name), CASES[name], disk / name / "here"
    made = folder / case.made
    if name == "render":
        nmm.Scenario.load("unicycle_2r_position").override("duration", 0.2).run().save(disk / name / "run")
    folder.mkdir(parents=True)
    before = shutil.disk_usage(disk).used
    first = commands.run(folder, [*case.arguments], prepared=case.prepared)
    assert (first.status, first.err) == (0, "")
    whole, size = files(made), shutil.disk_usage(disk).used - before
    for k in range(TIMES):
        if name in ("sweep", "init") or k % 2 == 0:
            shutil.rmtree(made) if made.is_dir() else made.unlink(missing_ok=True)
        old, filler = content(made), filled(disk, rng.choice((0, PAGE, rng.randrange(size))))
        ended = commands.run(folder, [*case.arguments], prepared=case.prepared)
        filler.unlink()
        if ended.status == 0:
            assert files(made) == whole
        else:
            assert (ended.status, ended.err) == (1, line(name, case.made, errno.ENOSPC))
            assert name == "sweep" or content(made) == old
        assert hidden(folder) == []
    if name == "init":
        made.unlink(missing_ok=True)
    last = commands.run(folder, [*case.arguments], prepared=case.prepared)
    assert (last.status, last.err) == (0, "")
    assert files(made) == whole
    shutil.rmtree(disk / name)
