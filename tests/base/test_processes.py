"""Work shared out over processes: answers, errors, deaths, Ctrl-C."""

from __future__ import annotations

import multiprocessing.resource_tracker
import multiprocessing.util
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nmm.base.errors import InputError, RunError
from nmm.base.processes import share_out

Progress = Callable[[float], None]

# Jobs for other processes: they are found by name, so they stand here.


def square(number: int, progress: Progress) -> tuple[int, int]:
    for k in range(5):
        progress(k / 4)
    return number * number, os.getpid()


def refuse(number: int, progress: Progress) -> int:
    if number == 2:
        raise InputError("two: expected another number")
    time.sleep(60.0)
    return number


def die(number: int, progress: Progress) -> int:
    if number == 1:
        os._exit(7)
    time.sleep(60.0)
    return number


def fill(number: int, progress: Progress) -> None:
    Path("/dev/full").write_text("more than there is room for", encoding="utf-8")


def nothing(number: int, fraction: float) -> None:
    """Takes a report of progress."""


def test_work_is_shared_out() -> None:
    reports: list[tuple[int, float]] = []
    found = share_out(square, [1, 2, 3, 4, 5], 2, lambda number, done: reports.append((number, done)))
    assert {number: value for number, (value, _) in found.items()} == {1: 1, 2: 4, 3: 9, 4: 16, 5: 25}
    processes = {process for _, process in found.values()}
    assert len(processes) == 2
    assert os.getpid() not in processes
    assert sorted(reports) == [(n, k / 4) for n in range(1, 6) for k in range(5)]
    for process in processes:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_one_process_is_this_one() -> None:
    found = share_out(square, [3, 4], 1, nothing)
    assert found == {3: (9, os.getpid()), 4: (16, os.getpid())}


def test_an_error_ends_the_other_processes() -> None:
    began = time.monotonic()
    with pytest.raises(InputError, match="two: expected another number"):
        share_out(refuse, [1, 2], 2, nothing)
    assert time.monotonic() - began < 40.0


def test_a_full_disk_is_the_callers_to_tell(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(OSError, match="No space left"):
        share_out(fill, [1, 2], 2, nothing)
    assert capfd.readouterr() == ("", "")


def test_a_process_that_dies_is_noticed() -> None:
    began = time.monotonic()
    with pytest.raises(RunError, match="exit status 7"):
        share_out(die, [1, 2], 2, nothing)
    assert time.monotonic() - began < 40.0


INTERRUPTIBLE = """
import sys
from nmm.cli.paper import write_paper

if __name__ == "__main__":
    try:
        write_paper(sys.argv[1], progress=lambda done: print(done, flush=True))
    except KeyboardInterrupt:
        sys.exit(42)
"""


def is_anybody_left(group: int) -> bool:
    """Whether a process of the group lives on; Python's own helper takes a moment to see that it may go."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return False
        time.sleep(0.05)
    return True


def test_an_interrupt_that_another_thread_takes_waits_until_all_have_started(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """A signal goes to any thread that does not block it; a process that has started and not been told what
    it is would end in a traceback."""
    started: list[int] = []
    ended = threading.Event()
    spawn: Any = multiprocessing.util.spawnv_passfds

    def spawned(*given: Any) -> int:
        started.append(spawn(*given))
        if len(started) == 1:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.1)
        return started[-1]

    multiprocessing.resource_tracker.ensure_running()
    monkeypatch.setattr(multiprocessing.util, "spawnv_passfds", spawned)
    other = threading.Thread(target=ended.wait)
    other.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            share_out(square, [3, 4], 2, nothing)
    finally:
        ended.set()
        other.join()
    assert len(started) == 2
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("after", [0.0, pytest.param(0.1, marks=pytest.mark.thorough)])
def test_ctrl_c_leaves_nothing_behind(tmp_path: Path, after: float) -> None:
    """SIGINT goes to the whole group, as a terminal sends it: while the processes start, and at work."""
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTIBLE)
    out = tmp_path / "out"
    out.mkdir()
    with subprocess.Popen(
        [sys.executable, str(script), str(out / "paper")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        if after:
            while float(process.stdout.readline()) < after:
                pass
        else:
            while not list(out.iterdir()):
                time.sleep(0.005)
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60.0)
    assert process.returncode == 42
    assert errors == ""
    assert list(out.iterdir()) == []
    assert not is_anybody_left(process.pid)
