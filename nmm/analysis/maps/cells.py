"""Cells of a plane, each with the best posture offered for it so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nmm.analysis.maps.best import find_best_cells, find_better
from nmm.arrays import Array, Flags, Integers


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells over a plane.

    Attributes
    ----------
    lower (2,), cell : the first cell's lower corner and a cell's side, m
    columns, rows : how many
    """

    lower: Array
    cell: float
    columns: int
    rows: int

    @property
    def axes(self) -> tuple[Array, Array]:
        """Centres of columns and rows, m."""
        first, second = (
            self.lower[k] + self.cell * (np.arange(n) + 0.5) for k, n in enumerate((self.columns, self.rows))
        )
        return first, second

    def shape(self, block: int) -> tuple[int, int]:
        """(columns, rows) of blocks of block x block cells."""
        return -(-self.columns // block), -(-self.rows // block)

    def cells(self, points: Array) -> Integers:
        """The flat index of each point's cell, points (N, 2); -1 outside."""
        place = np.floor((points - self.lower) / self.cell).astype(np.int64)
        inside = np.all((place >= 0) & (place < [self.columns, self.rows]), axis=1)
        return np.where(inside, place[:, 1] * self.columns + place[:, 0], -1)

    def centers(self, cells: Integers, block: int = 1) -> Array:
        """Centres (N, 2) of cells, or of blocks of block x block of them."""
        columns, _ = self.shape(block)
        place = np.column_stack([cells % columns, cells // columns])
        return np.asarray(self.lower + self.cell * block * (place + 0.5))

    def blocks(self, cells: Integers, block: int) -> Integers:
        """In which block of block x block cells each cell is."""
        columns, _ = self.shape(block)
        return (cells // self.columns) // block * columns + (cells % self.columns) // block


class Layer:
    """The largest value offered for each cell (the smallest, with `sign` -1), and the posture that has it.

    A posture in the middle of the cell is better than any that is not: values beside each other then differ
    by what the plane makes of them, and not by where in their cells they were found.
    """

    def __init__(self, cells: int, n: int, sign: float) -> None:
        self.sign = sign
        self.values = np.full(cells, -np.inf)
        self.q = np.full((cells, n), np.nan)
        self.central = np.zeros(cells, dtype=bool)

    @property
    def reached(self) -> Flags:
        """Whether each cell has a posture."""
        return np.asarray(np.isfinite(self.values))

    def offer(self, cells: Integers, central: Flags, values: Array, q: Array) -> None:
        """Keep those of the postures q (N, n) that are better than what their cells have."""
        signed = self.sign * values
        better, chosen = np.empty(len(cells), dtype=bool), np.full(len(self.values), -1, dtype=np.int64)
        find_better(cells, central, signed, self.values, self.central, chosen, better)
        self.values[cells[better]] = signed[better]
        self.q[cells[better]] = q[better]
        self.central[cells[better]] = central[better]

    def best_of_blocks(self, grid: Grid, block: int) -> tuple[Integers, Integers]:
        """(blocks, cells): of each block that was reached the cell with the best value."""
        columns, rows = grid.shape(block)
        chosen = np.empty(columns * rows, dtype=np.int64)
        find_best_cells(self.values, grid.columns, block, columns, chosen)
        blocks = np.flatnonzero(chosen >= 0)
        return blocks, chosen[blocks]
