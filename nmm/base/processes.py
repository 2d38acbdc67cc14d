"""Work shared out over processes that end with the one that started them.

`ProcessPoolExecutor` leaves its children working after Ctrl-C until their jobs are done, and
`multiprocessing.Pool` waits for ever for a child that was killed; hence these few lines.
"""

import multiprocessing
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Protocol, TypeVar

from nmm.base.errors import NmmError, RunError
from nmm.base.lazy_call import interrupts_wait
from nmm.base.progress import Progress

Result = TypeVar("Result", covariant=True)
#: How long a child may take to end when it is told to, s.
PATIENCE = 5.0


class Job(Protocol[Result]):
    """Something to do, by number, that reports the fraction done."""

    def __call__(self, number: int, progress: Progress, /) -> Result: ...


@dataclass(frozen=True)
class _Message:
    kind: str  #: of the content: "progress", a fraction; "result"; "error", an exception
    number: int
    content: Any


def share_out(
    job: Job[Result], numbers: Sequence[int], processes: int, progress: Callable[[int, float], None]
) -> dict[int, Result]:
    """job(number, report) for each number, over several processes, or in this one when `processes` is 1.

    The job and its results are picklable; `progress` gets a job's number and the fraction done of it. An
    `NmmError` or `OSError` of a job (a full disk) ends all of them; `RunError` where a process ended without
    an answer.
    """
    return dict(as_done(job, numbers, processes, progress))


def as_done(
    job: Job[Result], numbers: Sequence[int], processes: int, progress: Callable[[int, float], None]
) -> Generator[tuple[int, Result]]:
    """As `share_out`, each number with its result when done; closing the generator ends the children."""
    if processes == 1 or len(numbers) == 1:
        for number in numbers:
            yield number, job(number, partial(progress, number))
        return
    waiting, left = iter(numbers), len(numbers)
    with _children(job, min(processes, len(numbers))) as children:
        for connection, number in zip(children, waiting, strict=False):
            connection.send(number)
        while left:
            wait(list(children))
            for connection in children:
                if not connection.poll():
                    continue
                message = _receive(connection, children[connection])
                if message.kind == "progress":
                    progress(message.number, message.content)
                elif message.kind == "error":
                    raise message.content
                else:
                    following = next(waiting, None)
                    if following is not None:  # before the answer is looked at: the child goes on meanwhile
                        connection.send(following)
                    left -= 1
                    yield message.number, message.content


def _receive(connection: Connection, process: SpawnProcess) -> _Message:
    try:
        message: _Message = connection.recv()
    except (EOFError, ConnectionResetError):
        process.join(PATIENCE)
        raise RunError(
            f"a process that computed a part ended with exit status {process.exitcode}; a script that "
            'shares work out over processes has to begin with if __name__ == "__main__":'
        ) from None
    return message


@contextmanager
def _children(job: Job[Any], count: int) -> Iterator[dict[Connection, SpawnProcess]]:
    """Children that wait for jobs, each behind its connection; they end with the block."""
    # Spawned, not forked: a fork of a process with threads (numba's, BLAS's) may hang.
    context = multiprocessing.get_context("spawn")
    children: dict[Connection, SpawnProcess] = {}
    try:
        with interrupts_wait(), _interrupts_masked():
            for _ in range(count):
                ours, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(theirs, job), daemon=True)
                process.start()
                # The child's end lives on in the child alone, so that we hear of its death.
                theirs.close()
                children[ours] = process
        yield children
    finally:
        for connection, process in children.items():
            process.terminate()
            connection.close()
        for process in children.values():
            process.join(PATIENCE)
            if process.is_alive():
                process.kill()
                process.join()


@contextmanager
def _interrupts_masked() -> Iterator[None]:
    """Processes started in the block never hear of Ctrl-C.

    They inherit the signal mask from their first instruction on; a handler of their own would come too late.
    The mask is this thread's: others (numba's, BLAS's) still hear of it, for this one.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    # Starting the tracker clears the mask, so it has to run already.
    resource_tracker.ensure_running()
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)


def _serve(connection: Connection, job: Job[Any]) -> None:
    """In a child: do the jobs that come until the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        while True:
            number = connection.recv()
            connection.send(_answer(connection, job, number))
    except (EOFError, BrokenPipeError, ConnectionResetError):  # the parent is gone
        return


def _answer(connection: Connection, job: Job[Any], number: int) -> _Message:
    def report(fraction: float) -> None:
        connection.send(_Message("progress", number, fraction))

    try:
        return _Message("result", number, job(number, report))
    except (NmmError, OSError) as error:
        return _Message("error", number, error)
