"""What is recorded of each sample: one function writes it, for compiled loops and for `Step`s in Python."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import call_platform, checked_by_caller, clear, compiled, scratch, view
from nmm.base.kernels.linear_algebra import dot
from nmm.base.kernels.record_layout import Blocks, Kind, record_type, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.control.functions.program import BESIDE, LaidOut
from nmm.control.resolvers.answer import FALLBACK, added_residual
from nmm.control.resolvers.partitions import COLUMNS
from nmm.control.step.equations import ControlStep, drive
from nmm.control.step.limit_rows import note_held_values, note_values
from nmm.control.step.quantities import QUANTITIES

#: The quantities that only a step knows: `note_sample` writes each.
NOTED = tuple(quantity for quantity in QUANTITIES.values() if quantity.noted)

if TYPE_CHECKING:
    Recorded: TypeAlias = Any
else:
    #: The noted quantities of N samples, a field each, as records of kernels are.
    Recorded = NamedTuple(
        "Recorded",
        [
            (
                quantity.name,
                Annotated[Array, Kind(np.int64 if quantity.whole else np.float64, len(quantity.shape))],
            )
            for quantity in NOTED
        ],
    )


def room(count: int, n: int, m: int, s: int, levels: int, limited: int) -> Recorded:
    sizes = {"N": count, "n": n, "m": m, "s": s, "l": levels, "w": limited}
    return Recorded._make(quantity.room(sizes) for quantity in NOTED)


NOTE_SAMPLE = void(
    *(int64[::1], float64[::1], float64[::1]),
    *(int64, float64, int64, record_type(Recorded)),
)


@compiled
def note_sample(
    integers: Integers, floats: Array, q: Array, partitioned: int, share: float, k: int, record: Recorded
) -> None:
    """Write the sample just made at q, for which `share` of α was taken, as the k-th of a record."""
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    n, m, s = q.shape[0], e.answer.u.shape[0], e.task.r.shape[0]
    for i in range(n):
        record.q[k, i] = q[i]
        record.q_dot[k, i] = e.q_dot[i]
    second = e.second.u_dot.shape[0] > 0
    for j in range(m):
        record.u[k, j] = e.problem.before[j] if second else e.answer.u[j]
        record.u_dot[k, j] = e.second.u_dot[j] if second else math.nan
    for i in range(s):
        record.r[k, i] = e.task.r[i]
        record.r_d[k, i] = e.task.r_d[i]
        record.error[k, i] = e.task.error[i]
        record.rate[k, i] = e.task.full[i] - e.second.lead[i] if second else e.task.full[i]
        record.partition[k, i] = e.state[COLUMNS + i] if partitioned == 1 else -1
        for j in range(m):
            record.J[k, i, j] = e.problem.J[i, j]
    record.objective[k] = e.H[()]
    record.residual[k] = e.answer.residual[()]
    record.excess[k] = e.answer.excess[()]
    record.step_size[k] = share
    record.side[k] = int(e.answer.side[()])
    record.added_residual[k] = added_residual(e.problem, e.answer.u)
    for level in range(record.scale.shape[1]):
        record.scale[k, level] = e.scale[level]
    record.unanswered[k] = int(e.answer.status[()] == FALLBACK)
    w = e.limits.spin.shape[0] if record.limited.shape[1] > 0 else 0
    for i in range(w):
        record.limited[k, i] = 0.0
        for j in range(m):
            record.limited[k, i] += e.problem.limit_rows[i, j] * record.u[k, j]
    wide = record.limited.shape[1]
    for i in range(w, min(wide, w + e.limits.rows.shape[0])):
        record.limited[k, i] = b.value[e.limits.rows[i - w]]
    if wide > 0 and e.own_limits.shape[0] > 0:
        u, u_dot = view(record.u, k * m, (m,)), view(record.u_dot, k * m, (m,))
        note_values(q, u, u_dot, integers, floats, view(record.limited, k * wide, (wide,)))


NOTE_HELD = void(
    *(int64[::1], float64[::1], float64[::1], float64[::1]),
    *(int64, record_type(Recorded)),
)


@compiled
def note_held(integers: Integers, floats: Array, q: Array, u: Array, k: int, record: Recorded) -> None:
    """Replace the inputs of the k-th sample, at q, by those u (m,) that are held after it."""
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0)
    G, G_q = scratch(b.buffers.G.shape), scratch((*b.buffers.G.shape, b.buffers.G.shape[0]))
    clear(G)
    clear(G_q)
    call_platform(b.platform_kernel, q, b.platform_numbers, G, G_q)
    drive(u, G, e.arm, view(record.q_dot, k * q.shape[0], (q.shape[0],)))
    for j in range(u.shape[0]):
        record.u[k, j] = u[j]
    for i in range(e.limits.spin.shape[0] if record.limited.shape[1] > 0 else 0):
        record.limited[k, i] = dot(e.problem.limit_rows[i], u)
    wide = record.limited.shape[1]
    if wide > 0 and e.own_limits.shape[0] > 0:
        held = view(record.u, k * u.shape[0], u.shape)
        note_held_values(q, held, integers, floats, view(record.limited, k * wide, (wide,)))


#: What no sample holds, as a float and as an integer.
_BLANK = -(2**62)


class OneSample:
    """The last sample of a controller with these blocks, as `note_sample` writes it."""

    def __init__(self, blocks: Blocks, *sizes: int) -> None:
        self._blocks, self._found = blocks, room(1, *sizes)
        self._note = checked_by_caller(note_sample, NOTE_SAMPLE)
        by_name = self._found._asdict()
        self._arrays = {name: values[0] for name, values in by_name.items() if values.ndim > 1}
        self._numbers = {name: values for name, values in by_name.items() if values.ndim == 1}
        for values in self._found:
            values.fill(_BLANK)
        self.noted(np.zeros(sizes[0]), 1.0)
        for name, values in by_name.items():
            if np.any(values == _BLANK):
                raise TypeError(f"{name} is noted of each sample, but note_sample does not write it")

    def noted(self, q: Array, share: float) -> dict[str, Any]:
        """Copies of what the sample just made at q (n,) has, by name; without a partition."""
        own = self._arrays["q"]
        own[:] = q
        self._note(*self._blocks, own, 0, share, 0, self._found)
        noted = {name: values.copy() for name, values in self._arrays.items()}
        return noted | {name: values.item() for name, values in self._numbers.items()}
