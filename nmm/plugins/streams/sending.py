"""A stream's own process, as the process that drives sees it."""

from __future__ import annotations

import http.client
import json
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

from nmm.base.errors import InputError, NmmError, RunError
from nmm.base.files import UnwrittenError
from nmm.plugins.streams.pictures import RobotPicture, Said, Still
from nmm.plugins.streams.sinks import PATIENCE, Destination
from nmm.plugins.streams.tools import LOOPBACK, RERUN

_MAIN = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from nmm.plugins.streams.sender import main; main()"
)
ENDED = "the process that sends has ended"
#: How long a viewer may take nothing before a run is shown no further, and until a process has started, s.
HELD, STARTS = 20.0, 120.0
#: What a viewer of Rerun is asked, and how much of an answer is read, bytes.
WRITES, MOST = "/rerun.sdk_comms.v1alpha1.MessageProxyService/WriteMessages", 4096


class SendingEnded(RunError):
    """The process that sends a stream has ended."""


class Sending:
    """A process that sends to a destination; `came` is set when a viewer is there.

    Parameters
    ----------
    destination, still : where to, and what does not change
    ends : whether a viewer that takes nothing for `HELD` ends it, where whoever sends waits for that one

    Raises
    ------
    InputError : the port is taken; no viewer of Rerun listens
    RunError : the process, or the viewer, does not answer
    """

    def __init__(self, destination: Destination, still: Still, *, ends: bool = False) -> None:
        if destination.tool == RERUN and destination.file is None:
            expect_viewer(destination.port)
        self.destination, self.address, self._ends = destination, "", ends
        self.came, self._answered, self._closed = threading.Event(), threading.Event(), threading.Event()
        self._failure: NmmError | str | None = None
        self._process = subprocess.Popen(
            [sys.executable, "-c", _MAIN, json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the process that drives
        )
        try:
            self._listener = threading.Thread(target=self._listen, name="nmm stream answers", daemon=True)
            self._listener.start()
            with suppress(SendingEnded):  # then it has said why
                self._write((destination, still))
            if not self._answered.wait(STARTS):
                self._failure = f"no answer within {STARTS:g} s"
            if self._failure is not None or not self.address:
                raise self._error()
        except BaseException:
            self.kill()
            raise

    def send(self, item: RobotPicture | Said) -> None:
        """Send a picture or a line; waits while too many are on their way. `SendingEnded` where it cannot."""
        with self._at_most(HELD if self._ends else None):
            self._write(item)

    def close(self, about: Mapping[str, str]) -> bool:
        """Send what is left, with what is to be said of the whole, and end the process: live within some
        seconds, whatever the viewer does. `RunError` of a file that is not whole. A first Ctrl-C meanwhile
        loses no file: whether one came."""
        live, asked = self.destination.file is None, False
        try:
            with self._at_most(2.0 * self.destination.patience if live else None):  # it may take no more
                last = threading.Thread(target=self._write_last, args=(dict(about),), daemon=True)
                last.start()
                try:
                    self._closed.wait()
                except KeyboardInterrupt:
                    if live:
                        raise
                    asked = True
                    self._closed.wait()
        finally:
            self.kill()
        if self._failure is not None and not live:
            raise self._error()
        return asked

    def _write_last(self, about: dict[str, str]) -> None:
        """By a thread of its own: Ctrl-C is not to tear it."""
        with suppress(SendingEnded):
            self._write(about)

    @contextmanager
    def _at_most(self, seconds: float | None) -> Iterator[None]:
        """End the process if this takes longer."""
        if seconds is None:
            yield
            return
        last = threading.Timer(seconds, self._give_up)
        last.daemon = True
        last.start()
        try:
            yield
        finally:
            last.cancel()

    def _give_up(self) -> None:
        self._failure = self._failure or "the viewer takes nothing more"
        self._process.kill()

    @property
    def ended(self) -> bool:
        """Whether the process sends no more."""
        return self._closed.is_set()

    def kill(self) -> None:
        """End the process now."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError, ValueError):
                if pipe is not None:
                    pipe.close()

    def _write(self, what: Any) -> None:
        assert self._process.stdin is not None
        try:
            pickle.dump(what, self._process.stdin, protocol=pickle.HIGHEST_PROTOCOL)
            self._process.stdin.flush()
        except (OSError, ValueError):  # it has ended, or was killed
            raise SendingEnded(str(self._failure or ENDED), where="stream") from None

    def _error(self) -> NmmError:
        if isinstance(self._failure, NmmError):
            return self._failure
        what = self._failure or ENDED
        if self.destination.file is None:
            return RunError(what, where="stream")
        return UnwrittenError(f"cannot be written: {what}", where=self.destination.file)

    def _listen(self) -> None:
        assert self._process.stdout is not None
        try:
            while True:
                what, *more = pickle.load(self._process.stdout)
                if what == "ready":
                    self.address = more[0]
                    self._answered.set()
                elif what == "came":
                    self.came.set()
                elif what == "failed":
                    self._failure = more[0]
                    break
                else:
                    break
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            self._failure = self._failure or ENDED
        finally:
            self._closed.set()
            self._answered.set()


def expect_viewer(port: int) -> None:
    """`InputError` where no viewer of Rerun listens, or something else does."""
    start = f"start one with rerun --bind {LOOPBACK} --port"
    asked = http.client.HTTPConnection(LOOPBACK, port, timeout=PATIENCE)
    try:
        # No messages at all: a viewer takes them, by what browsers speak with it, and shows nothing new.
        asked.request("POST", WRITES, b"", {"content-type": "application/grpc-web+proto", "x-grpc-web": "1"})
        answer = asked.getresponse()
        content = answer.read(MOST)
    except ConnectionRefusedError:
        what = f"no viewer of Rerun listens at port {port}: {start} {port}"
        raise InputError(what, where="stream") from None
    except (OSError, http.client.HTTPException):
        content = b""
    else:
        if answer.headers.get("grpc-status") is not None or b"grpc-status" in content:
            return  # also one that has no such service by this name: another version's
    finally:
        asked.close()
    what = f"what listens at port {port} is no viewer of Rerun: {start} and another port"
    raise InputError(what, where="stream")
