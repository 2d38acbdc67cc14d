"""Work on many items shared out over the cores, by threads: for compiled code that does not hold the GIL."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeAlias

from nmm.progress import Progress

#: work(first, last) on the items from `first` up to `last`.
Work: TypeAlias = Callable[[int, int], None]


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_cores(
    count: int,
    at_once: int,
    worker: Callable[[], Work],
    progress: Progress | None = None,
    threads: int | None = None,
) -> None:
    """Do pieces of `at_once` items, the last one shorter, in as many threads as there are cores.

    What is found must not depend on the pieces. Ctrl-C ends it when the pieces under way are done.

    Parameters
    ----------
    count : how many items
    worker : called once in each thread: what does the pieces there, with memory that is this thread's alone
    progress : called with the fraction done, from this thread
    threads : how many at most, as many as there are cores when None
    """
    pieces = [(first, min(first + at_once, count)) for first in range(0, count, at_once)]
    threads = min(cores() if threads is None else threads, len(pieces))
    if threads <= 1:
        work = worker()
        for first, last in pieces:
            if progress is not None:
                progress(first / count)
            work(first, last)
        return
    own = threading.local()

    def one(piece: tuple[int, int]) -> None:
        if not hasattr(own, "work"):
            own.work = worker()
        own.work(*piece)

    with ThreadPoolExecutor(threads) as pool:
        try:
            waiting = [pool.submit(one, piece) for piece in pieces]
            for (first, _), future in zip(pieces, waiting, strict=True):
                if progress is not None:
                    progress(first / count)
                future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
