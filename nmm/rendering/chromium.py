"""A page in a Chromium without a window, spoken to through its debugging protocol."""

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
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from nmm.errors import RunError

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
#: How long a browser may take to start, and to answer, s.
PATIENCE = 60.0


def find_browser() -> str:
    """Chromium's or Chrome's program; `RunError` where there is none."""
    for name in NAMES:
        found = shutil.which(name)
        if found is not None:
            return found
    raise RunError(
        "videos need Chromium or Chrome, and none is installed (Debian: apt-get install chromium); "
        f"looked for {', '.join(NAMES)}"
    )


class HeadlessPage:
    """A file in a browser without a window: `with HeadlessPage(path, (width, height)) as page:`.

    The browser is a process of its own, which ends with this, and has its files in a temporary folder.

    Parameters
    ----------
    file : an HTML file
    size : width and height, px

    Raises
    ------
    RunError : no browser; one that does not start or answer
    """

    def __init__(self, file: Path, size: tuple[int, int]) -> None:
        self._file, self._size = file, size
        self._browser = find_browser()
        self._number, self._session, self._read = 0, "", b""

    def __enter__(self) -> HeadlessPage:
        self._folder = tempfile.TemporaryDirectory(prefix="nmm-browser-", ignore_cleanup_errors=True)
        self._log = Path(self._folder.name) / "log"
        theirs_in, self._to = os.pipe()
        self._from, theirs_out = os.pipe()
        # Root has no sandbox to be put into.
        unboxed = ["--no-sandbox"] if os.geteuid() == 0 else []
        command = [self._browser, *OPTIONS, *unboxed, f"--user-data-dir={self._folder.name}", "about:blank"]
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
        os.close(theirs_in)
        os.close(theirs_out)
        try:
            self._open()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def _open(self) -> None:
        pages = self._ask("Target.getTargets")["targetInfos"]
        page = next(one["targetId"] for one in pages if one["type"] == "page")
        self._session = self._ask("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        width, height = self._size
        self._ask(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        self._ask("Page.enable")
        self._ask("Page.navigate", url=self._file.resolve().as_uri())

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """What the browser answers; messages both ways are JSON, each with a zero byte behind it."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        try:
            os.write(self._to, json.dumps(message).encode() + b"\0")
        except BrokenPipeError:
            raise self._ended() from None
        end = time.monotonic() + PATIENCE
        while True:
            told = json.loads(self._message(end))
            if told.get("id") == self._number:
                if "error" in told:
                    raise RunError(f"{self._browser}: {method}: {told['error'].get('message')}")
                result: dict[str, Any] = told["result"]
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
        lines = self._log.read_text(errors="replace").strip().splitlines()
        return RunError(f"{self._browser} has ended: {lines[-1] if lines else 'without a word'}")

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page, or of its promise; `RunError` for what it throws."""
        told = self._ask("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in told:
            problem = told["exceptionDetails"]
            raise RunError(f"the page: {problem.get('exception', {}).get('description') or problem['text']}")
        return told["result"].get("value")

    def wait_for(self, expression: str) -> None:
        """Until an expression is true."""
        end = time.monotonic() + PATIENCE
        while not self.evaluate(f"Boolean({expression})"):
            if time.monotonic() > end:
                raise RunError(f"the page did not come up within {PATIENCE:g} s")
            time.sleep(0.02)

    def picture(self) -> bytes:
        """What it shows, as PNG."""
        return base64.b64decode(self._ask("Page.captureScreenshot", format="png")["data"])

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        # Its helpers, too: they are of its session.
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        os.close(self._to)
        os.close(self._from)
        self._folder.cleanup()
