"""Work on many items shared out over the cores, by threads: for compiled code that does not hold the GIL."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeAlias

from nmm.base.progress import Progress

#: work(first, last) on the items from `first` up to `last`.
Work: TypeAlias = Callable[[int, int], None]


def cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_cores(
    count: int,
    at_once: int,
    worker: Callable[[], Work],
    progress: Progress | None = None,
    threads: int | None = None,
) -> None:
    """Do pieces of `at_once` items, the last one shorter, in as many threads as there are cores.

    The calling thread works too and reports `progress`, the fraction begun, once per piece, in order. Results
    must not depend on the pieces. Ctrl-C takes effect when the pieces under way are done. `worker` is called
    once per thread and returns that thread's work, with memory of its own. `threads`: at most; None for all.
    """
    left = iter(range(0, count, at_once))  # next(left) is one step to all threads: none takes another's piece
    threads = min(cores() if threads is None else threads, -(-count // at_once))
    untold = iter(range(0, count, at_once))

    def tell(last: int) -> None:
        for first in untold:
            if progress is not None:
                progress(first / count)
            if first >= last:
                break

    def take(begun: Callable[[int], None] | None = None) -> None:
        try:
            work = worker()
            for first in left:
                if begun is not None:
                    begun(first)
                work(first, min(first + at_once, count))
        except BaseException:
            for _ in left:  # no other thread takes it
                pass
            raise

    helping = [_helpers().submit(take) for _ in range(1, threads)]
    try:
        take(tell)
        tell(count)
    finally:
        for future in helping:
            if not future.cancel():
                future.result()


@cache
def _helpers() -> ThreadPoolExecutor:
    """Threads that stay: one that begins costs as much as a hundred items."""
    return ThreadPoolExecutor(max(1, cores() - 1), thread_name_prefix="nmm")


if hasattr(os, "register_at_fork"):  # a forked process has none of them
    os.register_at_fork(after_in_child=_helpers.cache_clear)
