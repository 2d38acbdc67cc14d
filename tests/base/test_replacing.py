"""A folder that is replaced: whole at every moment, whoever is killed, reads or writes meanwhile."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from command_line import NMM
from whole_folders import NAMES, ours, write

import nmm
from nmm.base.errors import InputError
from nmm.base.files import UnwrittenError, writing
from nmm.cli.exit_status import status_of
from nmm.views.folders import whole
from nmm.views.folders.whole import check_folder, replaced_folder, steady

#: NMM_KILLS=30 kills each command so often; few do not.
KILLS = int(os.environ.get("NMM_KILLS", "0"))
MOST = 600.0


def numbers(folder: Path) -> set[str]:
    return {(folder / name).read_text() for name in NAMES}


WRITER = """
import sys
from itertools import count
from pathlib import Path
from whole_folders import write
for number in count():
    write(Path(sys.argv[1]), number, 1e-4)
    if number == 0:
        print(flush=True)
"""


def writer(folder: Path) -> subprocess.Popen[str]:
    """A process that replaces a folder again and again, once it has done so for the first time."""
    command = [sys.executable, "-c", WRITER, str(folder)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    found = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    assert found.stdout is not None
    found.stdout.readline()
    return found


def test_a_reader_sees_the_old_or_the_new_one(tmp_path: Path) -> None:
    folder = tmp_path / "o"
    with writer(folder) as writing_process:
        try:
            seen, until = set(), time.monotonic() + 1.5
            while time.monotonic() < until:
                assert all(os.path.exists(folder) for _ in range(2000)), "a moment without a folder"
                found = steady(folder, lambda: numbers(folder))
                assert len(found) == 1
                seen |= found
        finally:
            writing_process.kill()
    assert len(seen) > 3, "it was replaced meanwhile"


def test_a_killed_writer_leaves_a_whole_folder(tmp_path: Path) -> None:
    folder, rng = tmp_path / "o", random.Random(1)
    left = 0
    for _ in range(max(12, KILLS)):
        with writer(folder) as process:
            time.sleep(rng.uniform(0.0, 0.05))
            process.send_signal(signal.SIGKILL)
        assert len(numbers(folder)) == 1
        assert [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")] == ["o"]
        left += len([*tmp_path.iterdir()]) > 1
    assert left > 0, "some were killed while they wrote"
    write(folder, -1)
    assert [path.name for path in tmp_path.iterdir()] == ["o"]


def test_a_second_writer_is_told(tmp_path: Path) -> None:
    """Before it computes, and if the first began meanwhile, after some patience; what that wrote stays."""
    folder = tmp_path / "o"
    write(folder, 0)
    with writing(folder, 0.0) as hidden:
        (hidden / "part").mkdir()
        words = r"o: another process is writing it; wait for its end, or name another folder"
        with pytest.raises(InputError, match=words):
            check_folder(folder, ours)
        with pytest.raises(InputError, match=words), replaced_folder(folder, ours, patience=0.1):
            pass
        (hidden / "part").rmdir()
    check_folder(folder, ours)
    assert [path.name for path in tmp_path.iterdir()] == ["o"]


def test_a_second_writer_waits_for_the_first(tmp_path: Path) -> None:
    folder, begun = tmp_path / "o", threading.Event()

    def write_first() -> None:
        with replaced_folder(folder, ours) as temporary:
            begun.set()
            time.sleep(0.4)
            for name in NAMES:
                (temporary / name).write_text('{"format": "ours", "number": 1}')

    first = threading.Thread(target=write_first)
    first.start()
    begun.wait()
    write(folder, 2)
    first.join()
    assert numbers(folder) == {'{"format": "ours", "number": 2}'}
    assert [path.name for path in tmp_path.iterdir()] == ["o"]


def test_a_first_writer_that_ends_while_the_second_looks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its hidden folder was there, and is gone a moment later."""
    mkdir, calls = os.mkdir, []

    def there_first(path: str, mode: int = 0o777) -> None:
        calls.append(path)
        if len(calls) == 1:
            raise FileExistsError(path)
        mkdir(path, mode)

    monkeypatch.setattr(os, "mkdir", there_first)
    with writing(tmp_path / "o", 1.0) as hidden:
        assert hidden.is_dir()


@pytest.fixture
def without_exchange(monkeypatch: pytest.MonkeyPatch) -> None:
    """A system that cannot exchange two folders in one step."""
    monkeypatch.setattr(whole, "exchanged", lambda one, other: False)


@pytest.mark.usefixtures("without_exchange")
def test_where_two_folders_cannot_be_exchanged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "o"
    for number in range(3):
        write(folder, number)
    assert numbers(folder) == {'{"format": "ours", "number": 2}'}
    assert [path.name for path in tmp_path.iterdir()] == ["o"]
    # Killed between the two renames: the next writer, even one that fails, puts the old one back.
    hidden = tmp_path / ".o.nmm-writing"
    hidden.mkdir()
    folder.rename(hidden / "old")
    with pytest.raises(ZeroDivisionError), replaced_folder(folder, ours):
        raise ZeroDivisionError
    assert numbers(folder) == {'{"format": "ours", "number": 2}'}
    # The second rename fails: the old one is back at once.
    rename = Path.rename

    def fails(self: Path, target: Path) -> Path:
        if target == folder and self.name != "old":
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fails)
    with pytest.raises(UnwrittenError, match=r"o: cannot be written: No space left on device"):
        write(folder, 3)
    assert numbers(folder) == {'{"format": "ours", "number": 2}'}
    assert [path.name for path in tmp_path.iterdir()] == ["o"]


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "o").symlink_to("real")
    write(tmp_path / "o", 1)
    write(tmp_path / "o", 2)
    assert (tmp_path / "o").is_symlink()
    assert numbers(tmp_path / "real") == {'{"format": "ours", "number": 2}'}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["o", "real"]


@pytest.mark.parametrize("target", ["/dev/null", "/dev/zero", "loop", "x" * 250, "file/inside"])
def test_a_place_where_no_folder_can_be(
    tmp_path: Path, target: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "file").write_text("")
    assert status_of(["run", "unicycle_2r_position", "--out", target]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("nmm run: ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "loop"]


#: With their imports and processes of their own; all others, forked: test_killed_commands.py.
COMMANDS = {
    "run": ["run", "unicycle_2r_position", "--set", "duration=0.5", "--html", "--out", "o"],
    "paper": ["paper", "--out", "o"],
}


def files_in(folder: Path) -> Iterator[tuple[str, bytes]]:
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            yield str(path.relative_to(folder)), path.read_bytes()


@pytest.mark.thorough
@pytest.mark.parametrize("name", COMMANDS if KILLS else ["run"])
def test_a_killed_command_leaves_what_was_whole(tmp_path: Path, name: str) -> None:
    """SIGKILL at random instants: the folder is the old one or a new one, and nothing hidden stays."""
    rng = random.Random(name)
    began = time.monotonic()
    subprocess.run([*NMM, *COMMANDS[name]], cwd=tmp_path, check=True, capture_output=True, timeout=MOST)
    takes = time.monotonic() - began
    parts = {path for path, _ in files_in(tmp_path / "o")}
    for _ in range(max(KILLS, 1)):
        process = subprocess.Popen(
            [*NMM, *COMMANDS[name]], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        time.sleep(rng.uniform(0.2, 1.0) * takes)
        process.kill()
        process.wait()
        there = {path for path, _ in files_in(tmp_path / "o")}
        assert parts <= there
        if name == "run":
            nmm.Trajectory.load(tmp_path / "o")
    done = subprocess.run([*NMM, *COMMANDS[name]], cwd=tmp_path, capture_output=True, text=True, timeout=MOST)
    assert (done.returncode, done.stderr) == (0, "")
    assert [path.name for path in tmp_path.iterdir()] == ["o"]
    hidden = {path for path, _ in files_in(tmp_path / "o") if "/." in f"/{path}"}
    assert hidden <= {".lock"}


@pytest.mark.parametrize("name", ["a\0b", "a\ud800b", "a" * 300], ids=["null", "half a character", "long"])
def test_what_no_file_can_be_called_is_refused(tmp_path: Path, name: str) -> None:
    """From Python, or from a file that names it: no command line can hold a null character."""
    path = str(tmp_path / name)
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.02})
    run, robot = scenario.run(), scenario.robot()
    calls: list[Callable[[], object]] = [
        lambda: nmm.load(path + ".urdf"),
        lambda: nmm.load("unicycle_2r", srdf=path),
        lambda: nmm.Scenario.load(path + ".yaml"),
        lambda: nmm.Trajectory.load(path),
        lambda: nmm.PointCloud.load(path + ".ply"),
        lambda: nmm.OccupancyMap.load(path + ".yaml"),
        lambda: nmm.ElevationMap.load(path + ".npz"),
        lambda: nmm.read_bag(path, robot),
        lambda: run.save(path, figures=False),
        lambda: run.save_mcap(path + ".mcap"),
        lambda: nmm.Sweep("unicycle_2r_position", {"q0.x": [0, 1]}, settings={"duration": 0.02}).run(path),
    ]
    for call in calls:
        with pytest.raises(nmm.NmmError) as caught:
            call()
        assert str(caught.value).isprintable()
