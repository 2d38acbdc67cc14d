"""Sweeps on a Dask cluster: a real scheduler and worker processes on loopback, and what goes wrong."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster
from findings import refused
from ports import MOST
from short_scenario import MINIMAL

import nmm
from nmm.plugins.sweeps import cluster


@pytest.fixture
def sweep(tmp_path: Path) -> nmm.Sweep:
    path = tmp_path / "short.yaml"
    path.write_text(MINIMAL, encoding="utf-8")
    vary = {"q0.x": (-1, 1), "resolver.kind": ["rg", "pg"], "robot.arguments.d": [0.2, 0.3]}
    return nmm.Sweep(path, vary, samples=16, seed=5, settings={"duration": 0.2})


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Without workers."""
    with LocalCluster(n_workers=0, processes=True, dashboard_address=None) as made:
        yield made.scheduler_address


def test_a_clusters_table_is_the_local_one_bit_for_bit(sweep: nmm.Sweep, tmp_path: Path) -> None:
    """Where an event loop runs, as in a notebook's cell, too."""

    async def cell(address: str) -> nmm.SweepResult:
        return sweep.run(tmp_path / "far", scheduler=address)

    local = sweep.run(tmp_path / "local", jobs=1)
    with LocalCluster(n_workers=2, processes=False, dashboard_address=None) as workers:
        far = asyncio.run(cell(workers.scheduler_address))
    assert far.table.equals(local.table)
    tables = [(swept.folder / "rows.parquet").read_bytes() for swept in (local, far)]
    assert tables[0] == tables[1]


@pytest.mark.thorough
def test_a_worker_is_killed_and_the_table_is_the_local_one_bit_for_bit(
    sweep: nmm.Sweep, tmp_path: Path
) -> None:
    local = sweep.run(tmp_path / "local", jobs=1)
    killed: list[int] = []
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as workers:

        def kill(done: float) -> None:
            if done > 0.0 and not killed:
                killed.append(next(iter(workers.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        far = sweep.run(tmp_path / "far", scheduler=workers.scheduler_address, progress=kill)
    assert len(killed) == 1
    assert far.table.equals(local.table)
    tables = [(swept.folder / "rows.parquet").read_bytes() for swept in (local, far)]
    assert tables[0] == tables[1]


def refuses(sweep: nmm.Sweep, folder: Path, address: str, where: str = "", **fields: Any) -> None:
    with refused(where or f"--scheduler {address}", **fields):
        sweep.run(folder, scheduler=address)
    assert not folder.exists()


def test_a_scheduler_that_does_not_answer(
    sweep: nmm.Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cluster.PATIENCE == 10.0
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        there = f"tcp://127.0.0.1:{deaf.getsockname()[1]}"
        refuses(sweep, tmp_path / "out", there, expected="")
    refuses(sweep, tmp_path / "out", there, expected="")
    refuses(sweep, tmp_path / "out", "my-cluster", "--scheduler", got="my-cluster")
    with refused("jobs"):
        sweep.run(tmp_path / "out", jobs=2, scheduler=there)


def test_a_scheduler_without_workers(
    sweep: nmm.Sweep, tmp_path: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A busy one may take its time to answer; only a worker is waited for briefly."""
    wait = Client.wait_for_workers

    def wait_briefly(client: Client, count: int, timeout: float) -> None:
        assert timeout == cluster.PATIENCE
        wait(client, count, timeout=0.5)

    monkeypatch.setattr(cluster, "PATIENCE", MOST)
    monkeypatch.setattr(Client, "wait_for_workers", wait_briefly)
    refuses(sweep, tmp_path / "out", scheduler, expected=f"a worker within {MOST:g} s")


@pytest.mark.parametrize(
    ("preload", "expected"),
    [
        ("import sys\nsys.modules['nmm'] = None\n", f"nmm {nmm.__version__} on each"),
        ("import nmm\nnmm.__version__ = '0.0.9'\n", f"{nmm.__version__} on each, as here"),
    ],
    ids=["no nmm", "another version"],
)
def test_a_worker_with_another_nmm_or_none(
    sweep: nmm.Sweep,
    tmp_path: Path,
    scheduler: str,
    monkeypatch: pytest.MonkeyPatch,
    preload: str,
    expected: str,
) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", MOST)  # its worker is yet to import its libraries
    (tmp_path / "preload.py").write_text(preload, encoding="utf-8")
    options = ["--preload", "preload.py", "--no-nanny", "--no-dashboard", "--nthreads", "1"]
    command: list[Any] = [sys.executable, "-m", "distributed.cli.dask_worker", scheduler, *options]
    worker = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL)
    try:
        refuses(sweep, tmp_path / "out", scheduler, expected=expected)
    finally:
        worker.kill()
        worker.wait()
