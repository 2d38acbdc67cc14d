"""A sweep's chunks computed by a Dask cluster's workers, with the same results as on this machine."""

import asyncio
import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import islice
from typing import Any

from nmm import __version__
from nmm.base.errors import InputError, NmmError, RunError, expect
from nmm.base.extras import needed
from nmm.base.text_format import listed
from nmm.plugins.sweeps.rows import Computed

#: How long a scheduler may take to answer and to have a worker, s.
PATIENCE = 10.0
#: Chunks that wait in each thread of a worker, besides the one being computed.
AHEAD = 2
#: As text, because a worker without nmm could not load a function of ours that reports it.
_ASK_VERSION = (
    "__import__('nmm').__version__ if __import__('importlib.util').util.find_spec('nmm') else 'none'"
)


@contextmanager
def cluster(address: str) -> Iterator[Any]:
    """A Dask client of the scheduler at an address; each of its workers has this version of nmm."""
    distributed = needed("distributed", "a sweep on a cluster")
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)  # errors are reported once, by us
    try:
        _check_answers(distributed, address)
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        try:
            _check_workers(client, address)
            yield client
        finally:
            client.close(timeout=PATIENCE)
    finally:
        logger.setLevel(level)


def _check_answers(distributed: Any, address: str) -> None:
    """Ask before there is a client, because a client that cannot connect goes on trying."""

    async def kind() -> str:
        async with asyncio.timeout(PATIENCE), distributed.rpc(address, timeout=PATIENCE) as server:
            return str((await server.identity()).get("type", ""))

    try:
        with ThreadPoolExecutor(1) as thread:  # a notebook's own thread has an event loop that runs
            node_type = thread.submit(asyncio.run, kind()).result()
    except (OSError, TimeoutError):
        problem = f"no scheduler answers there within {PATIENCE:g} s"
        raise InputError(problem, where=f"--scheduler {address}") from None
    except (ValueError, TypeError) as error:
        expected = "an address such as tcp://127.0.0.1:8786"
        raise InputError(str(error), where="--scheduler", expected=expected, got=address) from None
    expect(node_type == "Scheduler", f"--scheduler {address}", "a Dask scheduler", node_type or "a stranger")


def _check_workers(client: Any, address: str) -> None:
    where = f"--scheduler {address}"
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        problem, expected = "the scheduler has no worker", f"a worker within {PATIENCE:g} s"
        raise InputError(problem, where=where, expected=expected) from None
    versions = sorted(client.run(eval, _ASK_VERSION).items())
    without = [worker for worker, version in versions if version == "none"]
    if without:
        problem = f"no nmm on {'worker' if len(without) == 1 else 'workers'} {listed(without)}"
        raise InputError(problem, where=where, expected=f"nmm {__version__} on each")
    others = [f"{version} on {worker}" for worker, version in versions if version != __version__]
    if others:
        raise InputError(f"nmm {listed(others)}", where=where, expected=f"{__version__} on each, as here")


def as_done_by(
    client: Any, job: Callable[[int, None], Computed], chunks: Sequence[int]
) -> Generator[tuple[int, Computed]]:
    """Each chunk with the result of job(chunk, None), as they finish; a lost worker's go to others. Raises
    what a job raised, or `RunError` if the scheduler was lost or a chunk took several workers down."""
    distributed = needed("distributed", "a sweep on a cluster")
    waiting = iter(chunks)
    submit = partial(client.submit, job, pure=False)
    threads = sum(client.nthreads().values())
    numbers: dict[Any, int] = {}

    def following(count: int) -> list[Any]:
        made = {submit(chunk, None): chunk for chunk in islice(waiting, count)}
        numbers.update(made)
        return list(made)

    done = distributed.as_completed(following((1 + AHEAD) * threads), loop=client.loop)
    try:
        for future in done:
            try:
                result = future.result(timeout=PATIENCE)
            except NmmError:
                raise
            except Exception as error:
                text = f"{type(error).__name__}: {' '.join(str(error).split())}"
                raise RunError(f"the cluster did not compute a part: {text}") from None
            done.update(following(1))
            yield numbers.pop(future), result
    finally:
        client.cancel(list(numbers))
