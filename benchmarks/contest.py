"""Interleaved rounds of programs that stay alive: each library takes its turn on the same samples."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from workloads import WORKLOADS, Workload

WORKERS = Path(__file__).resolve().parent / "workers"
#: A library has a time only if its end-effector is this near to its path, m and rad, in the second half,
#: and if it keeps the limits that are on, m/s, rad/s, m, rad, within a thousandth.
NEAR, KEPT = 5e-3, 1e-3
#: Turns that a path is driven in.
TURNS = 10


class Followed(NamedTuple):
    """What a library's motion is like: largest errors in the second half (m, rad), how fast its base goes
    sideways (m/s), by how much limits are broken at most; why it has no time, or nothing."""

    position: float
    orientation: float
    sideways: float
    beyond: float
    reason: str


class Contestant:
    """A worker in a process of its own."""

    def __init__(self, name: str, python: Path | str, worker: str, variant: str, workloads: Path) -> None:
        self.name, self.variant = name, variant
        self._log = workloads.parent / f"{name}-{variant}.log"
        # One thread each, as a control loop runs; and nothing of this process's paths in theirs.
        environment = {k: v for k, v in os.environ.items() if worker == "of_nmm.py" or k != "PYTHONPATH"}
        environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
        with self._log.open("w") as log:
            self._process = subprocess.Popen(
                [str(python), str(WORKERS / worker), str(workloads), variant],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                env=environment,
            )
        hello = self._answer()
        self.failed: dict[str, str] = hello.get("failed", {})
        self.versions: dict[str, str] = hello.get("versions", {})
        self.jobs: list[str] = hello.get("jobs", [])
        self.reason: str = hello.get("error", "")

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            said = self._log.read_text().strip().splitlines()
            return {"error": f"ended: {said[-1] if said else 'without a word'}"}
        answer: dict[str, Any] = json.loads(line)
        return answer

    def ask(self, job: str, do: str, **others: Any) -> dict[str, Any]:
        """One turn; {"error": why} where it did not come to an end."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"job": job, "do": do, **others}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return {"error": "ended before its turn"}
        return self._answer()

    def close(self) -> None:
        """End the process."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()


def judge(workload: Workload, q: np.ndarray, limits: bool) -> Followed:
    """What a motion q (N + 1, n) is like, by Pinocchio."""
    model, data = workload.robot.model, workload.robot.model.createData()
    frame = workload.robot.frame_id(workload.frame)
    half = len(q) // 2
    position = orientation = 0.0
    for k in range(half, len(q)):
        pin.framesForwardKinematics(model, data, q[k])
        found = data.oMf[frame]
        off = (found.translation - workload.p[k])[: min(workload.rows, 3)]
        position = max(position, float(np.linalg.norm(off)))
        if workload.rows == 6:
            turn = np.linalg.norm(pin.log3(workload.R.T @ found.rotation))
            orientation = max(orientation, float(turn))
    q_dot = np.diff(q, axis=0) / workload.dt
    c, s = np.cos(q[:-1, 2]), np.sin(q[:-1, 2])
    forward = c * q_dot[:, 0] + s * q_dot[:, 1]
    sideways = float(np.abs(c * q_dot[:, 1] - s * q_dot[:, 0]).max())
    beyond = 0.0
    if limits:
        lower, upper = np.array([workload.inputs[n] for n in workload.robot.u_names]).T
        moved = np.column_stack([forward, q_dot[:, 2:]])
        if sideways > 1e-6:  # an omnidirectional base's axes are the world's
            moved[:, 0] = np.abs(q_dot[:, :2]).max(axis=1)
        low, up = np.array([workload.coordinates[n] for n in workload.robot.q_names]).T
        beyond = max(
            float(part.max()) for part in (lower - moved, moved - upper, low - q, q - up, np.zeros(1))
        )
    reason = ""
    if not np.isfinite(q).all() or not position <= NEAR or not orientation <= NEAR:
        reason = f"does not track: {1e3 * position:.1f} mm, {1e3 * orientation:.1f} mrad off"
    elif beyond > KEPT:
        reason = f"breaks a limit by {beyond:.1e}"
    return Followed(position, orientation, sideways, beyond, reason)


def follow(contestant: Contestant, job: str, workloads: dict[str, Workload]) -> Followed:
    """Drive a whole path, and judge it."""
    answer = contestant.ask(job, "follow")
    if "error" in answer:
        return Followed(np.nan, np.nan, np.nan, np.nan, answer["error"])
    name, limits = job.split(", ")
    return judge(workloads[name], np.array(answer["q"]), limits == "limits on")


def rounds(
    contestants: list[Contestant], jobs: dict[str, list[Contestant]], count: int, steps: dict[str, int]
) -> dict[tuple[str, str, str], list[float]]:
    """µs a step by (job, name, variant), a number a round; each round begins with another library."""
    times: dict[tuple[str, str, str], list[float]] = {}
    for k in range(count):
        for job, those in jobs.items():
            first = k % max(len(those), 1)
            for one in those[first:] + those[:first]:
                answer = one.ask(job, "time", steps=steps[job])
                times.setdefault((job, one.name, one.variant), []).append(
                    answer.get("microseconds", float("nan"))
                )
    return times


def all_jobs() -> list[str]:
    """The workloads with limits off and on."""
    return [f"{name}, limits {what}" for name in WORKLOADS for what in ("off", "on")]
