"""Command lines run in this process, in a process of their own, and on a terminal."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
import threading
from _thread import interrupt_main
from pathlib import Path

import pytest
from ports import MOST

from nmm.cli.exit_status import status_of

NMM = [sys.executable, "-m", "nmm"]


class Result:
    """What a command line printed, and its exit status."""

    def __init__(self, status: int, out: str, err: str) -> None:
        self.status, self.out, self.err = status, out, err

    def value(self, label: str) -> str:
        """The text beside a label of a table."""
        line = next(line for line in self.out.splitlines() if line.startswith(label))
        return line[len(label) :].strip()


def refused(captured: pytest.CaptureFixture[str], *arguments: str) -> Result:
    """A command line in this process; one that is not refused, and would stay, gets Ctrl-C."""
    late = threading.Timer(MOST, interrupt_main)
    late.start()
    try:
        return Result(status_of(arguments), *captured.readouterr())
    finally:
        late.cancel()


def process(folder: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    """Start a command line in a process of its own."""
    return subprocess.Popen(
        [*NMM, *arguments],
        cwd=folder,
        env=os.environ | environment,
        text=True,
        encoding="utf-8",
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def page_of(folder: Path, *arguments: str) -> tuple[subprocess.Popen[str], str]:
    """Start a command line that shows a page, without a browser, and wait for the page's address."""
    running = process(folder, *arguments, "--no-open")
    assert running.stdout is not None
    line = running.stdout.readline()
    found = re.search(r" at (http://127\.0\.0\.1:\d+/) \(Ctrl-C ends it\)", line)
    if found is None:
        running.kill()
    assert found, line + running.communicate()[1]
    return running, found[1]


class Terminal:
    """A command line on a terminal of that width."""

    def __init__(self, folder: Path, width: int, *arguments: str) -> None:
        self._ours, theirs = pty.openpty()
        environment = {
            key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")
        }
        environment |= {"COLUMNS": str(width), "TERM": "xterm-256color"}
        self.process = subprocess.Popen(
            [*NMM, *arguments],
            cwd=folder,
            env=environment,
            stdout=theirs,
            stderr=theirs,
            start_new_session=True,
        )
        os.close(theirs)

    def read_until(self, pattern: str | None) -> str:
        """What is shown until something comes that a pattern matches, or to the end."""
        shown = b""
        while pattern is None or re.search(pattern.encode(), shown) is None:
            try:
                part = os.read(self._ours, 65536)
            except OSError:  # how Linux says that the other end is closed
                part = b""
            if not part:
                os.close(self._ours)
                break
            shown += part
        return shown.decode()


def imported(folder: Path, *arguments: str) -> set[str]:
    """The modules that a command line imports."""
    command = [sys.executable, "-X", "importtime", "-m", "nmm", *arguments]
    report = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stderr
    return {line.split("|")[-1].strip() for line in report.splitlines() if line.startswith("import time:")}
