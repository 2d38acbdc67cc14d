"""Sorting into cells and distance fields, compiled, and without Python's lock: a cloud that is updated makes
its field beside a controller.

The field is by lower envelopes of parabolas, an axis after the other (Felzenszwalb and Huttenlocher 2012).
The package edt 3.1 has the same one, but keeps the lock meanwhile: 80 ms in a room of 7 × 8 × 2.4 m. Numbers
lie at addresses, see `pointers`.
"""

import math

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled_without_gil
from nmm.base.kernels.pointers import doubles_at, short_integers_at, singles_at


@compiled_without_gil
def sort_into_cells(addresses: Integers, counts: Integers, corner: Array, cell: Array) -> None:
    """Sort points by their cells, z fastest, in the order that they have within one.

    addresses (4,) : of points (N, 3) and room for them, float64; of int32: starts (cells + 2,), zeros, which
        becomes the first point of each cell, and order (N,)
    counts (4,) : nx, ny, nz, N; corner (3,), cell (3,), m
    """
    nx, ny, nz, N = counts[0], counts[1], counts[2], counts[3]
    points, out = doubles_at(addresses[0], 3 * N), doubles_at(addresses[1], 3 * N)
    starts, order = short_integers_at(addresses[2], nx * ny * nz + 2), short_integers_at(addresses[3], N)
    for turn in range(2):
        for e in range(N):
            flat = 0
            for k in range(3):
                index = math.floor((points[3 * e + k] - corner[k]) / cell[k])
                flat = flat * counts[k] + int(min(max(index, 0.0), counts[k] - 1.0))
            if turn == 0:
                starts[flat + 2] += 1
                continue
            place = starts[flat + 1]
            starts[flat + 1] = place + 1
            order[place] = e
            for k in range(3):
                out[3 * place + k] = points[3 * e + k]
        if turn == 0:
            for flat in range(nx * ny * nz):
                starts[flat + 2] += starts[flat + 1]


@compiled_without_gil
def take_finite(addresses: Integers, count: int, ends: Array) -> int:
    """Copy the points that are finite, and return their number.

    addresses (2,) : of points (count, 3) and room for them, float64; ends (6,) : their least and greatest
        coordinates, m
    """
    points, out = doubles_at(addresses[0], 3 * count), doubles_at(addresses[1], 3 * count)
    taken = 0
    for k in range(3):
        ends[k], ends[3 + k] = math.inf, -math.inf
    for e in range(count):
        x, y, z = points[3 * e], points[3 * e + 1], points[3 * e + 2]
        if not math.isfinite(x + y + z):
            continue
        for k in range(3):
            at = points[3 * e + k]
            out[3 * taken + k] = at
            ends[k], ends[3 + k] = min(ends[k], at), max(ends[3 + k], at)
        taken += 1
    return taken


@compiled_without_gil
def mark_full(addresses: Integers, total: int) -> None:
    """0 in a field (total,), float32, of cells with elements, infinity of others; addresses (2,) : of starts,
    int32, and the field."""
    starts, field = short_integers_at(addresses[0], total + 1), singles_at(addresses[1], total)
    for k in range(total):
        field[k] = 0.0 if starts[k + 1] > starts[k] else math.inf


@compiled_without_gil
def transform(address: int, counts: Integers, cell: Array, work: Array, share: float) -> None:
    """Make a field of 0 in full cells and infinity elsewhere that of lower bounds, in place: `share` of
    sqrt(sum (max(|i - j| - 1, 0) h)²), least over full cells.

    address : of the field (nx, ny, nz), float32; counts (3,); cell (3,), m; work (4, n + 1), n the most cells
        along an axis
    """
    total = counts[0] * counts[1] * counts[2]
    field = singles_at(address, total)
    g, w, ends, first = work[0], work[1], work[2], work[3]
    n, h = counts[2], cell[2] * cell[2]
    for base in range(0, total, n):  # along z by steps from the nearest full cell
        for turn in range(2):
            steps = math.inf
            for k in range(n):
                i = base + (k if turn == 0 else n - 1 - k)
                steps = 0.0 if field[i] == 0.0 else steps + 1.0
                w[i - base] = steps if turn == 0 else min(w[i - base], steps)
        for k in range(n):
            apart = max(w[k] - 1.0, 0.0)
            field[base + k] = h * apart * apart
    stride = n
    for axis in (1, 0):
        n, h = counts[axis], cell[axis] * cell[axis]
        for line in range(total // n):
            base = line // stride * (stride * n) + line % stride
            least, most = math.inf, 0.0
            for i in range(n):
                g[i] = field[base + i * stride]
                least, most = min(least, g[i]), max(most, g[i])
            if most == least:
                continue
            for i in range(n):  # the gap between cells is one less than that between their numbers
                w[i] = min(g[i], min(g[max(i - 1, 0)], g[min(i + 1, n - 1)]))
            last = -1
            for i in range(n):
                if math.isinf(w[i]):
                    continue
                at = -math.inf
                while last >= 0:
                    j = int(first[last])
                    at = ((w[i] - w[j]) / h + float(i * i - j * j)) / (2.0 * (i - j))
                    if at > ends[last]:
                        break
                    last -= 1
                last += 1
                first[last] = i
                ends[last] = at if last > 0 else -math.inf
            ends[last + 1] = math.inf
            k = 0
            for i in range(n):
                while ends[k + 1] < i:
                    k += 1
                apart = i - first[k]
                field[base + i * stride] = w[int(first[k])] + apart * apart * h
        stride *= n
    for i in range(total):
        field[i] = share * math.sqrt(field[i])
