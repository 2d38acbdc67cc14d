"""Whatever fails says so in one line, whatever its output is connected to."""

from __future__ import annotations

import errno
import os
import random
import re
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
from command_line import NMM, process
from findings import refused

import nmm
from nmm.cli.app import app
from nmm.cli.exit_status import main, status_of
from nmm.cli.output import readable, show_table, show_text
from nmm.model.robots.motion import Motion
from nmm.plugins.live.rendering.encoder import expect_video
from nmm.views.playback import write_html

MOST = 120.0
#: NMM_KILLS=30 interrupts so often.
KILLS = int(os.environ.get("NMM_KILLS", "1"))


def shell(folder: Path, command: str) -> tuple[int, str]:
    """Exit status and standard error of a command line in a shell."""
    text = command.replace("nmm ", f"{' '.join(NMM)} ", 1)
    done = subprocess.run(["bash", "-c", text], cwd=folder, capture_output=True, text=True, timeout=MOST)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("command", "status", "words"),
    [
        ("nmm robots >&-", 0, ""),
        ("nmm info unicycle_2r >&- 2>&- <&-", 0, ""),
        ("nmm info nothing >&-", 2, "nmm info: unknown robot 'nothing'"),
        ("nmm nothing 2>/dev/full", 2, ""),
        ("nmm robots >/dev/full", 1, "nmm robots: cannot write or read: No space left on device"),
        ("nmm --version >/dev/full", 1, "nmm: cannot write or read: No space left on device"),
        ("nmm scenarios --keys | head -1; exit ${PIPESTATUS[0]}", 0, ""),
    ],
)
def test_where_the_output_goes(tmp_path: Path, command: str, status: int, words: str) -> None:
    found, err = shell(tmp_path, command)
    assert found == status
    assert err.startswith(words)
    assert err.count("\n") == (1 if words else 0)


def test_a_file_opened_is_not_taken_for_the_output(tmp_path: Path) -> None:
    """With standard output closed, its number is free: what is opened next would get what is printed."""
    assert shell(tmp_path, "nmm run unicycle_2r_position --set duration=0.1 --out o >&- 2>&-")[0] == 0
    assert len(nmm.Trajectory.load(tmp_path / "o")) == 21


def test_a_reader_that_has_gone_costs_nothing_of_what_is_written(tmp_path: Path) -> None:
    command = "nmm run unicycle_2r_position --set duration=0.1 --out o | true; exit ${PIPESTATUS[0]}"
    status, err = shell(tmp_path, command)
    assert (status, err) == (1, "nmm run: nobody reads the output any more; what is written is whole\n")
    assert len(nmm.Trajectory.load(tmp_path / "o")) == 21


def test_an_interrupt_is_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def raises(error: BaseException) -> None:
        def read(**_: object) -> None:
            raise error

        read.registered_commands = app.registered_commands  # type: ignore[attr-defined]
        monkeypatch.setattr("nmm.cli.exit_status.app", read)

    for error, status, words in (
        (KeyboardInterrupt(), 130, "interrupted"),
        (MemoryError(), 1, "there is not enough memory for this"),
        (OSError(28, "No space left on device", "/a/b"), 1, "/a/b: No space left on device"),
        (BrokenPipeError(), 1, "nobody reads the output any more; what is written is whole"),
    ):
        raises(error)
        monkeypatch.setattr("nmm.cli.exit_status._discard_output", lambda: None)
        assert status_of(["run"]) == status
        assert capsys.readouterr().err == f"nmm run: {words}\n"


def test_the_end_of_a_file_is_no_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def raises(*_: object, **__: object) -> None:
        raise EOFError

    monkeypatch.setattr("nmm.plugins.live.cli.runs_in", raises)
    assert status_of(["play", "o"]) == 1
    assert capsys.readouterr().err.strip() == "nmm play: what was read ended too early"


def catches(pid: int, number: signal.Signals) -> bool:
    """Whether a process has a handler for a signal, as the kernel says."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    caught = re.search(r"^SigCgt:\s*([0-9a-f]+)$", status, re.MULTILINE)
    assert caught is not None
    return bool(int(caught[1], 16) >> (number - 1) & 1)


def test_ending_while_figures_are_drawn_or_imported(tmp_path: Path) -> None:
    """SIGTERM at instants of a map, with its imports and figures: one line, no leftovers."""
    rng = random.Random(14)
    for _ in range(KILLS):
        running = process(
            tmp_path, "map", "unicycle_2r", "--task", "position", "--samples", "20", "--out", "o"
        )
        while not catches(running.pid, signal.SIGTERM):  # from then on it is nmm that ends, not Python
            assert running.poll() is None, running.communicate()
            time.sleep(0.005)
        time.sleep(rng.uniform(0.0, 2.0))
        running.send_signal(signal.SIGTERM)
        out, err = running.communicate(timeout=MOST)
        if running.returncode == 130:
            assert (out, err) == ("", "nmm map: interrupted\n")
        else:
            assert (running.returncode, err) == (0, "")
        assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


RED = "\x1b[31mred\x1b[0m\x07"


def test_titles_and_names_move_no_cursor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show_text(f"{RED}\nnext")
    show_table([RED, ""], [[RED, RED]], title=RED)
    status_of(["info", RED])
    status_of(["play", str(tmp_path / RED)])
    status_of(["run", "unicycle_2r_position", "--set", f"title={RED}", "--set", f"{RED}=1"])
    out, err = capsys.readouterr()
    shown = out + err
    assert "\x1b" not in shown
    assert "\x07" not in shown
    assert out.startswith("\\x1b[31mred\\x1b[0m\\x07\nnext\n")
    assert err.count("\n") == 3


@pytest.mark.parametrize(
    "command",
    [
        ["info", "x" * 5000],
        ["run", "x" * 5000],
        ["run", "unicycle_2r_position", "--resolver", "x" * 5000],
        ["run", "unicycle_2r_position", "--set", f"dt={'9' * 5000}"],
        ["run", "unicycle_2r_position", "--set", f"method={'x' * 5000}"],
        ["run", "unicycle_2r_position", "--set", f"{'x' * 5000}=1"],
        ["run", "unicycle_2r_position", "--set", "x " * 2500],
        ["map", "unicycle_2r", "--task", "position", "--range", "x" * 5000],
        ["map", "unicycle_2r", "--task", "x" * 5000],
        ["redundancy", "unicycle_2r", "--task", "position", "--self-motion", "x" * 5000],
        ["render", "x" * 5000, "--video", "a.mp4"],
        ["play", "x" * 5000],
        ["x" * 5000],
        ["info", "unicycle_2r", f"--{'x' * 5000}"],
    ],
)
def test_long_values_are_cut(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(command) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert len(err) < 1700
    assert "…" in err or "5000" in err


def test_a_message_is_one_line_of_so_many_characters() -> None:
    assert readable(f"a\n b\t{RED}") == "a b \\x1b[31mred\\x1b[0m\\x07"
    assert len(readable("word " * 9000)) == 4000
    path = "/".join(["folder"] * 60)
    assert readable(path) == path


@pytest.mark.parametrize("kind", ["link", "broken link", "device", "pipe", "folder", "loop"])
def test_a_page_replaces_files_alone(tmp_path: Path, robot_2r: nmm.Robot, kind: str) -> None:
    page, real = tmp_path / "page.html", tmp_path / "real.html"
    if kind == "link":
        real.write_text("old")
    if "link" in kind:
        page.symlink_to(real)
    elif kind == "device":
        page.symlink_to("/dev/null")
    elif kind == "pipe":
        os.mkfifo(page)
    elif kind == "folder":
        page.mkdir()
    else:
        page.symlink_to(page)
    q = robot_2r.rest[None]
    motion = Motion(robot_2r, np.array([0.0, 1.0]), np.vstack([q, q]), np.zeros((2, robot_2r.n_u)))
    if "link" in kind:
        write_html([motion], page)
        assert page.is_symlink()
        assert real.read_text().startswith("<!")
    else:
        with refused("page.html"):
            write_html([motion], page)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("option", ["--html", "--video"])
def test_devices_stay_what_they_are(tmp_path: Path, option: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Before anything is computed."""
    link = tmp_path / "a.mp4"
    link.symlink_to("/dev/zero")
    if option == "--html":
        assert (
            status_of(["redundancy", "unicycle_2r", "--task=position", "--self-motion=0", f"--html={link}"])
            == 2
        )
        assert capsys.readouterr().err.startswith(
            f"nmm redundancy: --html: {link}: expected a file, this is a dev"
        )
    else:
        with refused("a.mp4"):
            expect_video(link)
    assert Path("/dev/zero").is_char_device()


@pytest.mark.parametrize("kind", ["visual", "collision"])
@pytest.mark.parametrize("platform", ["fixed", "unicycle"])
def test_text_between_elements_is_nothing(tmp_path: Path, kind: str, platform: str) -> None:
    """After a shape that is a mesh, too, in whose place Pinocchio gets a ball."""
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    (tmp_path / "tri.stl").write_bytes(b"x" * 80 + struct.pack("<I", 1) + triangle)
    shape = f'<{kind}>in<geometry>in<mesh filename="tri.stl"/>in</geometry>in</{kind}>'
    link = f'<link name="{{}}">in{shape}stray text {shape}more</link>'
    joint = (
        '<joint name="j" type="continuous"><parent link="a"/>in<child link="b"/>in<axis xyz="0 0 1"/></joint>'
    )
    file = tmp_path / "a.urdf"
    file.write_text(f'<robot name="r">in{link.format("a")}in{joint}in{link.format("b")}in</robot>')
    robot = nmm.load(file, platform=platform)
    model = robot.visual_model if kind == "visual" else robot.collision_model
    assert len(model.geometryObjects) == 4


def test_an_interrupt_before_anything_is_read(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    for name in ("_open_streams", "tell_what_takes_long", "ignore_interrupts"):
        monkeypatch.setattr(f"nmm.cli.exit_status.{name}", lambda: None)
    monkeypatch.setattr("nmm.cli.exit_status.gc", MagicMock())
    monkeypatch.setattr("nmm.cli.exit_status.raise_interrupts", interrupted)
    monkeypatch.setattr("sys.argv", ["nmm", "run"])
    with pytest.raises(SystemExit, match="130"):
        main()
    assert capsys.readouterr().err == "nmm run: interrupted\n"


RUN = "nmm run unicycle_2r_position --set duration=0.1 --out o"


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("elsewhere", b"nonsense\nfigure.dpi: many\nfoo: 3\n"),
        pytest.param("matplotlibrc", b"\xff\xfe\x00", marks=pytest.mark.thorough),
    ],
)
def test_figures_are_drawn_whatever_matplotlib_is_told(tmp_path: Path, settings: bytes, name: str) -> None:
    """A backend that there is not, and settings that are none, here or where a variable says."""
    (tmp_path / name).write_bytes(settings)
    assert shell(tmp_path, f"MATPLOTLIBRC=$PWD/{name} MPLBACKEND=nope {RUN}") == (0, "")
    assert (tmp_path / "o" / "motion.png").stat().st_size > 0


def test_few_files_may_be_open(tmp_path: Path) -> None:
    assert shell(tmp_path, f"ulimit -n 20; {RUN}") == (0, "")
    status, err = shell(tmp_path, f"ulimit -n 6; {RUN}")
    assert (status, err.count("\n")) == (1, 1)
    assert err.endswith(f"{os.strerror(errno.EMFILE)}\n")


def test_a_working_directory_that_is_gone(tmp_path: Path) -> None:
    status, err = shell(tmp_path, f"mkdir gone; cd gone; rmdir ../gone; {RUN}")
    assert (status, err) == (1, f"nmm run: the working directory is gone: {os.strerror(errno.ENOENT)}\n")


INTERRUPTED = """
import signal, sys

class Finder:
    waiting = True

    def find_spec(self, name, path=None, target=None):
        if name == "numba.core.types" and self.waiting:
            self.waiting = False
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Finder())
import numpy as np
import nmm

def velocity_map():
    G, G_q = np.zeros((3, 2)), np.zeros((3, 2, 3))
    nmm.Unicycle().velocity_map(np.zeros(3), np.zeros(0), G, G_q)
    return G[0].tolist()

try:
    velocity_map()
except KeyboardInterrupt:
    print(velocity_map())
"""


@pytest.mark.skipif(bool(int(os.environ.get("NUMBA_DISABLE_JIT", "0"))), reason="numba is not imported")
def test_an_interrupted_import_leaves_python_as_it_was(tmp_path: Path) -> None:
    """Ctrl-C while numba is imported, as nothing is in the cache, and the same call again."""
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        env=os.environ | {"XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=MOST,
    )
    assert (done.stdout, done.stderr) == ("[1.0, 0.0]\n", "")
