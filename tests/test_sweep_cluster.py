"""Sweeps on a Dask cluster: a real scheduler and worker processes on loopback, and what goes wrong."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster
from short_scenario import MINIMAL

import nmm
from nmm.sweeps import cluster


@pytest.fixture
def sweep(tmp_path: Path) -> nmm.Sweep:
    path = tmp_path / "short.yaml"
    path.write_text(MINIMAL, encoding="utf-8")
    vary = {"q0.x": (-1, 1), "resolver.kind": ["rg", "pg"], "robot.arguments.d": [0.2, 0.3]}
    return nmm.Sweep(path, vary, samples=16, seed=5, settings={"duration": 0.2})


@pytest.fixture
def scheduler() -> Iterator[str]:
    """Without workers."""
    with LocalCluster(n_workers=0, processes=True, dashboard_address=None) as made:
        yield made.scheduler_address


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


def refused(sweep: nmm.Sweep, folder: Path, address: str) -> str:
    with pytest.raises(nmm.InputError) as caught:
        sweep.run(folder, scheduler=address)
    assert not folder.exists()
    return str(caught.value)


def test_a_scheduler_that_does_not_answer(
    sweep: nmm.Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cluster.PATIENCE == 10.0
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        there = f"tcp://127.0.0.1:{deaf.getsockname()[1]}"
        assert (
            refused(sweep, tmp_path / "out", there)
            == f"--scheduler {there}: no scheduler answers there within 1 s"
        )
    assert "no scheduler answers there within 1 s" in refused(sweep, tmp_path / "out", there)
    assert "expected an address such as tcp://" in refused(sweep, tmp_path / "out", "my-cluster")
    with pytest.raises(nmm.InputError, match="expected jobs or scheduler"):
        sweep.run(tmp_path / "out", jobs=2, scheduler=there)


def test_a_scheduler_without_workers(
    sweep: nmm.Sweep, tmp_path: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 2.0)
    assert "has no worker, and none came within 2 s" in refused(sweep, tmp_path / "out", scheduler)


@pytest.mark.parametrize(
    ("preload", "expected"),
    [
        ("import sys\nsys.modules['nmm'] = None\n", "no nmm on worker tcp://"),
        ("import nmm\nnmm.__version__ = '0.0.9'\n", "nmm 0.0.9 on tcp://"),
    ],
    ids=["no nmm", "another version"],
)
def test_a_worker_with_another_nmm_or_none(
    sweep: nmm.Sweep, tmp_path: Path, scheduler: str, preload: str, expected: str
) -> None:
    (tmp_path / "preload.py").write_text(preload, encoding="utf-8")
    options = ["--preload", "preload.py", "--no-nanny", "--no-dashboard", "--nthreads", "1"]
    command: list[Any] = [sys.executable, "-m", "distributed.cli.dask_worker", scheduler, *options]
    worker = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL)
    try:
        told = refused(sweep, tmp_path / "out", scheduler)
    finally:
        worker.kill()
        worker.wait()
    assert expected in told
    assert f"xpected nmm {nmm.__version__}" in told or f"expected {nmm.__version__} on each" in told
