"""A page in a headless Chromium, controlled through its debugging protocol."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from nmm.base.errors import RunError
from nmm.plugins.live.rendering.encoder import last_words

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
OPTIONS = (
    "--headless", "--remote-debugging-pipe", "--no-first-run", "--no-default-browser-check", "--mute-audio",
    "--hide-scrollbars", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-extensions", "--disable-background-networking",
)  # fmt: skip
#: A browser has its pipes as numbers 3 and 4. (Some shells know no number above 9.)
PIPED = """
import fcntl, os, sys
read, write = (fcntl.fcntl(int(number), fcntl.F_DUPFD, 10) for number in sys.argv[1:3])
os.dup2(read, 3)
os.dup2(write, 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
#: How long a browser may take to start and to answer, s.
PATIENCE = 60.0


def find_browser() -> str:
    """Chromium's or Chrome's program; `RunError` if there is none."""
    if program := next(filter(None, map(shutil.which, NAMES)), None):
        return program
    raise RunError(
        "videos need Chromium or Chrome, and none is installed (Debian: apt-get install chromium); "
        f"looked for {', '.join(NAMES)}"
    )


class HeadlessPage:
    """An HTML file in a browser without a window: `with HeadlessPage(path, (width, height)) as page:`. The
    browser ends with it and keeps its files in a temporary folder; `RunError` if there is none, or it does
    not start or answer."""

    def __init__(self, file: Path, size: tuple[int, int]) -> None:
        self._file, self._size = file, size
        self._browser = find_browser()
        self._number, self._session, self._read = 0, "", b""

    def __enter__(self) -> HeadlessPage:
        with ExitStack() as opened:
            temporary = tempfile.TemporaryDirectory(prefix="nmm-browser-", ignore_cleanup_errors=True)
            folder = opened.enter_context(temporary)
            self._log = Path(folder) / "log"
            theirs_in, self._to = os.pipe()
            self._from, theirs_out = os.pipe()
            for pipe in (self._to, self._from):
                opened.callback(os.close, pipe)
            # Chromium's sandbox does not run as root.
            unboxed = ["--no-sandbox"] if os.geteuid() == 0 else []
            command = [self._browser, *OPTIONS, *unboxed, f"--user-data-dir={folder}", "about:blank"]
            begin = [sys.executable, "-I", "-S", "-c", PIPED, str(theirs_in), str(theirs_out)]
            with self._log.open("wb") as log:
                self._process = subprocess.Popen(
                    [*begin, *command],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    pass_fds=(theirs_in, theirs_out),
                    start_new_session=True,
                )
            opened.callback(_end, self._process)
            os.close(theirs_in)
            os.close(theirs_out)
            self._open()
            self._opened = opened.pop_all()
        return self

    def _open(self) -> None:
        pages = self._ask("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in pages if target["type"] == "page")
        self._session = self._ask("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        width, height = self._size
        self._ask(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        self._ask("Page.enable")
        self._ask("Page.navigate", url=self._file.resolve().as_uri())

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The browser's answer; messages both ways are JSON, each followed by a zero byte."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        try:
            os.write(self._to, json.dumps(message).encode() + b"\0")
        except BrokenPipeError:
            raise self._ended() from None
        end = time.monotonic() + PATIENCE
        answer: dict[str, Any] = {}
        while answer.get("id") != self._number:
            answer = json.loads(self._message(end))
        if "error" in answer:
            raise RunError(f"{self._browser}: {method}: {answer['error'].get('message')}")
        result: dict[str, Any] = answer["result"]
        return result

    def _message(self, end: float) -> bytes:
        while b"\0" not in self._read:
            ready, _, _ = select.select([self._from], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                raise RunError(f"{self._browser} did not answer within {PATIENCE:g} s")
            part = os.read(self._from, 1 << 20)
            if not part:
                raise self._ended()
            self._read += part
        message, _, self._read = self._read.partition(b"\0")
        return message

    def _ended(self) -> RunError:
        return RunError(f"{self._browser} has ended: {last_words(self._log) or 'without a word'}")

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page, or of its promise; `RunError` for what it throws."""
        answer = self._ask("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            problem = answer["exceptionDetails"]
            raise RunError(f"the page: {problem.get('exception', {}).get('description') or problem['text']}")
        return answer["result"].get("value")

    def wait_for(self, expression: str) -> None:
        end = time.monotonic() + PATIENCE
        while not self.evaluate(f"Boolean({expression})"):
            if time.monotonic() > end:
                raise RunError(f"the page did not come up within {PATIENCE:g} s")
            time.sleep(0.02)

    def picture(self) -> bytes:
        """What it shows, as PNG."""
        return base64.b64decode(self._ask("Page.captureScreenshot", format="png")["data"])

    def __exit__(self, *_: object) -> None:
        self._opened.close()


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the browser and its helpers, which share its session."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
