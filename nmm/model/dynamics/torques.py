"""What a recorded motion asks of the motors, and how near it is to tipping."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.base.arrays import Array, Flags
from nmm.base.findings import Finding
from nmm.base.lazy_call import lazy_call
from nmm.model.dynamics.dynamics import Dynamics, Payload
from nmm.model.dynamics.support import Support
from nmm.model.robots.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Inputs that change by so many times what they change by before and after have jumped,
JUMP = 10.0
#: if by more than this share of the run's largest input.
SMALL = 1e-3
#: A change of inputs within so many samples to either side is a jump, if they are steady nearby, so many.
BRIEF, NEARBY = 3, 30
#: So many samples are computed at once: some megabytes.
AT_ONCE = 4096


@dataclass(frozen=True, eq=False)
class Torques:
    """Motor torques, the ground's force and the margin against tipping, at the N samples of a motion.

    The accelerations are those recorded at order 2, or differences of the recorded inputs. Where these jump
    (RG changes its partition, a task begins) they have none: `jumps` says where, and torques are those on
    either side.

    Attributes
    ----------
    dynamics : the robot's, with its load
    t (N,) : s
    torques, rates (N, A) : of the actuators, N m and rad/s, or N and m/s
    inputs (N, n_u) : those of the motion
    jumps (N,) : whether inputs jump between the sample and the next
    zero_moment (N, 2) : where the ground's force acts, m in the world
    margins (N,) : how far this is inside the wheels' polygon, m; infinite without one
    edges (N,) : the wheels at the ends of the nearest edge

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_3r_sequence").run()
    >>> found = run.torques(payload={"ee": 0.5})
    >>> found.names[:2], found.peaks.shape
    (('left_wheel_joint', 'right_wheel_joint'), (5,))
    """

    dynamics: Dynamics
    t: Array
    torques: Array
    rates: Array
    inputs: Array
    jumps: Flags
    zero_moment: Array
    margins: Array
    edges: tuple[tuple[str, str], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The actuators' names, (A,)."""
        return self.dynamics.actuators.names

    @property
    def efforts(self) -> Array:
        """Their limits in the robot's file, (A,), infinite where it has none."""
        return self.dynamics.actuators.efforts

    @cached_property
    def peaks(self) -> Array:
        """The largest torque of each, (A,), N m or N."""
        return np.abs(self.torques).max(axis=0)

    @property
    def rms(self) -> Array:
        """The root mean square of each, (A,)."""
        span = max(self.t[-1] - self.t[0], 1e-12)
        square = (
            np.trapezoid(self.torques**2, self.t, axis=0) / span if len(self.t) > 1 else self.torques[0] ** 2
        )
        return np.asarray(np.sqrt(square))

    @property
    def power(self) -> Array:
        """What all of them do together, (N,) W; below 0 where the motion drives them."""
        return np.asarray(np.sum(self.torques * self.rates, axis=1))

    @property
    def energy(self) -> float:
        """What they take, J: the sum of each one's positive work, as none of it comes back."""
        return float(np.trapezoid(np.maximum(self.torques * self.rates, 0.0).sum(axis=1), self.t))

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Motors over their effort, and a robot that tips."""
        findings = []
        for j in np.flatnonzero(self.peaks > self.efforts):
            k = int(np.abs(self.torques[:, j]).argmax())
            values = {
                "actuator": self.names[j],
                "peak": float(self.peaks[j]),
                "effort": float(self.efforts[j]),
                "unit": self.dynamics.actuators.units[j],
            }
            findings.append(Finding("effort_exceeded", values, {"t": float(self.t[k])}))
        k = int(self.margins.argmin())
        if self.margins[k] < 0.0:
            margin = float(self.margins[k])
            values = {"margin": margin if np.isfinite(margin) else None, "edge": list(self.edges[k])}
            values["jumps"] = self._jumps_at(k)
            findings.append(Finding("tips", values, {"t": float(self.t[k])}))
        return tuple(findings)

    def _jumps_at(self, k: int) -> dict[str, float]:
        """By input, what it changes by around sample k, where that takes a few samples alone, and is more
        than elsewhere nearby."""
        size, names = np.abs(np.diff(self.inputs, axis=0)), self.dynamics.robot.u_names
        first, last = max(k - BRIEF, 0), min(k + BRIEF, len(size))
        beside = np.concatenate([size[max(k - NEARBY, 0) : first], size[last : k + NEARBY]])
        if not len(beside):
            return {}
        changes = self.inputs[last] - self.inputs[first]
        jump = (size[first:last].max(axis=0) > JUMP * beside.max(axis=0)) & (np.abs(changes) > SMALL)
        return {names[j]: float(changes[j]) for j in np.flatnonzero(jump)}

    def summary(self) -> dict[str, Any]:
        """In numbers, ready for JSON."""
        when = np.abs(self.torques).argmax(axis=0)
        units, limits = self.dynamics.actuators.units, self.efforts
        least = int(self.margins.argmin())
        tips = {"margin": float(self.margins[least]), "t": float(self.t[least]), "edge": [*self.edges[least]]}
        return {
            "robot": self.dynamics.robot.name,
            "actuators": {
                name: {
                    "unit": units[j],
                    "peak": float(self.peaks[j]),
                    "t": float(self.t[when[j]]),
                    "rms": float(self.rms[j]),
                    "effort": float(limits[j]) if np.isfinite(limits[j]) else None,
                    "share": float(self.peaks[j] / limits[j]) if np.isfinite(limits[j]) else None,
                }
                for j, name in enumerate(self.names)
            },
            "power_peak": float(self.power.max()),
            "energy": self.energy,
            "tipping": None if np.isposinf(self.margins[least]) else tips,
            "jumps": self.t[:-1][self.jumps[:-1]].tolist(),
            "left_out": list(self.dynamics.left_out),
            "findings": [finding.as_json() for finding in self.findings],
        }

    def columns(self) -> dict[str, Array]:
        """By a name with its unit, (N,) each: time, torques, power, the zero-moment point and its margin."""
        units = self.dynamics.actuators.units
        torques = {
            f"{name} [{unit}]": column
            for name, unit, column in zip(self.names, units, self.torques.T, strict=True)
        }
        x, y = self.zero_moment.T
        acts = {"zmp x [m]": x, "zmp y [m]": y, "margin [m]": self.margins}
        return {"t [s]": self.t, **torques, "power [W]": self.power, **acts}

    def save(self, folder: str | Path) -> Path:
        """Write torques.csv, summary.json and torques.png to a folder, replacing one of torques."""
        return lazy_call("nmm.views.folders.torques:save")(self, folder)

    def plot(self) -> Figure:
        """Torques over their limits, and the margin against tipping."""
        return lazy_call("nmm.views.figures.torques:torques")(self)


def torques_along(
    robot: Robot,
    t: Array,
    q: Array,
    u: Array,
    payload: Payload | None = None,
    *,
    u_dot: Array | None = None,
) -> Torques:
    """Of a motion q (N, n), u (N, n_u) at times (N,), s; `payload` as of `Dynamics`. Accelerations that were
    recorded, u_dot (N, n_u), take the place of differences of u."""
    dynamics, support = Dynamics(robot, payload), Support(robot)
    if u_dot is None:
        u_dot, jumps = accelerations(t, u)
    else:
        jumps = np.zeros(len(t), dtype=bool)
    parts = []
    for first in range(0, len(t), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        f, from_ground = dynamics.forces(q[some], u[some], u_dot[some])
        motors = dynamics.actuators
        parts.append((motors.torques(q[some], f), motors.rates(q[some], u[some]), from_ground))
    torques, rates, ground = (np.concatenate(chunks) for chunks in zip(*parts, strict=True))
    acts = support.zero_moment(ground) if robot.platform.n_p else np.zeros((len(t), 2))
    margins, edges = support.margins(q, acts)
    return Torques(dynamics, t, torques, rates, u, jumps, acts, margins, tuple(edges))


def accelerations(t: Array, u: Array) -> tuple[Array, Flags]:
    """u_dot (N, n_u) from differences of u at t (N,), one-sided beside jumps, and whether u jumps from each
    sample to the next, (N,)."""
    jumps = np.zeros(len(t), dtype=bool)
    if len(t) < 2:
        return np.zeros_like(u), jumps
    steps = np.diff(u, axis=0)
    size = np.abs(steps)
    beside = np.zeros_like(size)
    beside[1:] = size[:-1]
    beside[:-1] = np.maximum(beside[:-1], size[1:])
    if len(t) > 2:
        jumps[:-1] = np.any((size > JUMP * beside) & (size > SMALL * np.abs(u).max()), axis=1)
    rates = steps / np.diff(t)[:, np.newaxis]
    smooth = ~jumps[:-1, np.newaxis]
    before, after = np.zeros_like(u), np.zeros_like(u)
    before[1:], after[:-1] = np.where(smooth, rates, 0.0), np.where(smooth, rates, 0.0)
    count = np.zeros((len(t), 1))
    count[1:] += smooth
    count[:-1] += smooth
    return (before + after) / np.maximum(count, 1.0), jumps
