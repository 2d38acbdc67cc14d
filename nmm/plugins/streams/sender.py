"""The process that sends a stream, so that neither a viewer nor its library can hold up the one that drives.

It reads pickles from the process that started it, and answers with pickles; it ends when that one does, or
when the viewer does not take what is left.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import sys
import threading
from typing import IO, Any

from nmm.base.errors import NmmError
from nmm.plugins.streams.sinks import Destination, Sink

#: Pictures on their way at most: live, where older ones are of no use, and into a file.
LIVE, WRITTEN = 64, 4096
#: At most so many are sent together.
BATCH = 256
#: Time between two looks whether the other process is still there, s.
LOOK = 1.0


def main() -> None:
    """Send what comes on standard input: a destination and what does not change, then pictures and lines,
    then what is to be said of the whole."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # the end of its input ends it
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    incoming = sys.stdin.buffer
    try:
        lock = threading.Lock()

        def answer(*what: Any) -> None:
            with lock:
                pickle.dump(what, answers)
                answers.flush()

        try:
            destination, still = pickle.load(incoming)
            sink, address = destination.open(still, lambda: answer("came"))
        except EOFError:  # it has ended
            return
        except Exception as error:  # whatever a library does
            answer("failed", one_error(error))
            return
        answer("ready", address)
        try:
            send(incoming, sink, destination)
        except Exception as error:  # whatever a library does
            answer("failed", one_error(error))
        else:
            answer("closed")
    except (EOFError, BrokenPipeError):
        pass
    finally:
        os._exit(0)  # Rerun's own end waits for its viewer


def one_error(error: Exception) -> NmmError | str:
    return error if isinstance(error, NmmError) else f"{type(error).__name__}: {error}"


def send(incoming: IO[bytes], sink: Sink, destination: Destination) -> None:
    """Send until there is no more, and close; where the input ends too soon, with what came."""
    waiting: queue.Queue[Any] = queue.Queue(LIVE if destination.file is None else WRITTEN)
    reader = threading.Thread(target=read, args=(incoming, waiting, destination), daemon=True)
    reader.start()
    while True:
        items = [waiting.get()]
        while len(items) < BATCH and not isinstance(items[-1], dict):
            try:
                items.append(waiting.get_nowait())
            except queue.Empty:
                break
        about = items.pop() if isinstance(items[-1], dict) else None
        if items:
            sink.take(items)
        if about is not None:
            sink.close(about)
            return


def read(incoming: IO[bytes], waiting: queue.Queue[Any], destination: Destination) -> None:
    """Put what comes into the queue; the last one is a mapping. A viewer that takes nothing more keeps no
    process alive."""
    parent = os.getppid()
    item: Any = None
    while not isinstance(item, dict):
        try:
            item = pickle.load(incoming)
        except Exception:  # its end, or the middle of something
            item = {"complete": "no", "why": "the process that drove has ended"}
        while True:
            try:
                waiting.put(item, timeout=LOOK)
                break
            except queue.Full:
                if os.getppid() != parent:
                    os._exit(1)
    if destination.file is None:
        threading.Event().wait(destination.patience)
        os._exit(1)
