"""A sweep's chunks computed by the workers of a Dask cluster, with the results of this machine."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from nmm import __version__
from nmm.errors import InputError, NmmError, RunError
from nmm.sweeps.extra import needed
from nmm.sweeps.work import Computed
from nmm.words import listed

#: How long a scheduler may take to answer, and to have a worker, s.
PATIENCE = 10.0
#: Chunks that each thread of a worker has waiting beside the one that it computes.
AHEAD = 2
#: Text, because a worker without nmm could not load a function of ours that would say so.
_ASK_VERSION = (
    "__import__('nmm').__version__ if __import__('importlib.util').util.find_spec('nmm') else 'none'"
)


@contextmanager
def cluster(address: str) -> Iterator[Any]:
    """A Dask client of the scheduler at an address, whose workers all have this version of nmm.

    Raises
    ------
    InputError : no such address; no scheduler answers, or has a worker, within `PATIENCE`; a worker
        without nmm, or with another version
    """
    distributed = needed("distributed", "a sweep on a cluster")
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)  # what goes wrong is told once, by us
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
    """A question of our own before there is a client, because one that cannot connect goes on trying."""

    async def kind() -> str:
        async with asyncio.timeout(PATIENCE), distributed.rpc(address, timeout=PATIENCE) as server:
            return str((await server.identity()).get("type", ""))

    try:
        found = asyncio.run(kind())
    except (OSError, TimeoutError):
        raise InputError(f"--scheduler {address}: no scheduler answers there within {PATIENCE:g} s") from None
    except (ValueError, TypeError) as error:
        raise InputError(
            f"--scheduler: expected an address such as tcp://127.0.0.1:8786, got {address!r} ({error})"
        ) from None
    if found != "Scheduler":
        raise InputError(f"--scheduler {address}: expected a Dask scheduler, found a {found or 'stranger'}")


def _check_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise InputError(
            f"--scheduler {address}: the scheduler has no worker, and none came within {PATIENCE:g} s"
        ) from None
    versions = client.run(eval, _ASK_VERSION)
    without = sorted(worker for worker, version in versions.items() if version == "none")
    if without:
        raise InputError(
            f"--scheduler {address}: no nmm on {'worker' if len(without) == 1 else 'workers'} "
            f"{listed(without)}; expected nmm {__version__} on each"
        )
    others = [
        f"{version} on {worker}" for worker, version in sorted(versions.items()) if version != __version__
    ]
    if others:
        raise InputError(
            f"--scheduler {address}: nmm {listed(others)}; expected {__version__} on each, as here"
        )


def as_done_by(
    client: Any, job: Callable[[int, None], Computed], chunks: Sequence[int]
) -> Generator[tuple[int, Computed]]:
    """The chunks, each with what job(chunk, None) gives, as they are done; a lost worker's go to others.

    Raises
    ------
    NmmError : what a job raised
    RunError : the scheduler was lost, or a chunk took several workers with it
    """
    distributed = needed("distributed", "a sweep on a cluster")
    waiting = iter(chunks)
    submit = partial(client.submit, job, pure=False)
    threads = sum(client.nthreads().values())
    numbers: dict[Any, int] = {}

    def following(count: int) -> list[Any]:
        """So many futures of chunks that come next."""
        made = []
        for _, chunk in zip(range(count), waiting, strict=False):
            future = submit(chunk, None)
            numbers[future] = chunk
            made.append(future)
        return made

    done = distributed.as_completed(following((1 + AHEAD) * threads), loop=client.loop)
    try:
        for future in done:
            try:
                found = future.result(timeout=PATIENCE)
            except NmmError:
                raise
            except Exception as error:
                text = " ".join(str(error).split())
                raise RunError(
                    f"the cluster did not compute a part: {type(error).__name__}: {text}"
                ) from None
            done.update(following(1))
            yield numbers.pop(future), found
    finally:
        client.cancel(list(numbers))
