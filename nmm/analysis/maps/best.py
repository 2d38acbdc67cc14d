"""The best of what is offered, compiled: of each cell, and of each block of cells."""

from __future__ import annotations

import math

from nmm.arrays import Array, Flags, Integers
from nmm.kernels.compiled import compiled


@compiled
def find_better(
    cells: Integers,
    central: Flags,
    signed: Array,
    values: Array,
    centrals: Flags,
    chosen: Integers,
    better: Flags,
) -> None:
    """better (N,): which postures are the best offered for their cells, and better than what these have.

    cells, central, signed (N,) : where each posture is, -1 nowhere, whether in the middle, and its value
    values, centrals : what each cell has
    chosen : -1 for each cell; becomes the best offered
    """
    for i in range(cells.shape[0]):
        better[i] = False
        cell = cells[i]
        if cell < 0 or not math.isfinite(signed[i]):
            continue
        other = chosen[cell]
        if other < 0:
            chosen[cell] = i
        elif central[i] == central[other]:
            if signed[i] >= signed[other]:
                chosen[cell] = i
        elif central[i]:
            chosen[cell] = i
    for i in range(cells.shape[0]):
        cell = cells[i]
        if cell < 0 or chosen[cell] != i:
            continue
        better[i] = signed[i] > values[cell] if central[i] == centrals[cell] else central[i]


@compiled
def find_best_cells(values: Array, columns: int, block: int, wide: int, chosen: Integers) -> None:
    """chosen: of each block of block x block cells the one with the best value, -1 where none is finite.

    values : of the cells, `columns` to a row; wide : blocks to a row
    """
    for k in range(chosen.shape[0]):
        chosen[k] = -1
    for cell in range(values.shape[0]):
        if math.isfinite(values[cell]):
            k = (cell // columns) // block * wide + (cell % columns) // block
            if chosen[k] < 0 or values[cell] >= values[chosen[k]]:
                chosen[k] = cell


@compiled
def find_promising(
    values: Array,
    columns: int,
    down: int,
    right: int,
    margin: float,
    seen: Array,
    seeds: Integers,
    promised: Integers,
) -> int:
    """seeds, promised: cells, and those on one side of them that have less than they and the ones before them
    foretell, by more than `margin`. How many there are is returned.

    seen : with which value of its seed each cell was tried before, from this side; is kept up
    """
    count, rows = 0, values.shape[0] // columns
    for cell in range(values.shape[0]):
        value = values[cell]
        row, column = cell // columns + down, cell % columns + right
        if not math.isfinite(value) or row < 0 or row >= rows or column < 0 or column >= columns:
            continue
        other, earlier = row * columns + column, cell - down * columns - right
        if not math.isfinite(values[other]):
            continue
        # Wrapped into another row, it foretells something else: an idle try at worst.
        known = 0 <= earlier < values.shape[0] and math.isfinite(values[earlier])
        change = value - values[earlier] if known else 0.0
        # Not the same one twice.
        if value + change > values[other] + margin and seen[other] != value:
            seeds[count], promised[count] = cell, other
            seen[other] = value
            count += 1
    return count
