"""The search for the best posture of each cell of a plane: drawn, spread from block to block, filled in."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nmm.analysis.maps.best import find_promising
from nmm.analysis.maps.cells import Grid, Layer
from nmm.analysis.maps.evaluation import Evaluator
from nmm.analysis.maps.reach import Reach
from nmm.arrays import Array, Flags, Integers
from nmm.errors import InputError
from nmm.progress import Progress, between

#: Sides of the blocks, in cells, through which good postures spread. Of large ones also to the blocks beside
#: them, where the value is better by a hundredth, twice; of small ones, which are many, where it is by a
#: fifth.
BLOCKS, LARGE = (32, 16, 8, 4, 2, 1), 4
SWEEPS_LARGE, SWEEPS_SMALL = (0.01, 0.01), (0.2,)
#: Room around what is reached, of its size.
MARGIN = 0.03
#: How often the cells beside the reached ones are tried.
TRIES = 8
#: So near, in cells, is in the middle.
NEAR = 1e-7
#: What a smooth branch's values bend from cell to cell, of their range, is less; and how far branches are
#: carried, in cells.
BENT, SWEEPS = 3e-3, 40
BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0))


class Search:
    """Postures offered to the cells, for the best and for the worst value of each measure.

    Parameters
    ----------
    longest : cells along the longer side
    """

    def __init__(self, evaluator: Evaluator, reach: Reach, longest: int) -> None:
        self.evaluator, self.reach, self.longest = evaluator, reach, longest

    def draw(self, count: int, progress: Progress | None) -> None:
        """Lay out the cells around what `count` postures reach, and offer these.

        Raises
        ------
        InputError : no posture is within the slab; the frame does not move in the plane
        """
        q = self.reach.postures(count)
        points = self.reach.positions(q, between(progress, 0.0, 0.2))
        seen = points[self.reach.held(points)][:, self.reach.in_plane]
        if not len(seen):
            slab = "{:g} to {:g} m".format(*(self.reach.slab or (0.0, 0.0)))
            lowest, highest = points[:, self.reach.third].min(), points[:, self.reach.third].max()
            raise InputError(
                f"height: no posture puts {self.reach.frame} at {slab}, they reach {lowest:.3g} to "
                f"{highest:.3g} m"
            )
        size = np.ptp(seen, axis=0)
        cell = float(size.max()) * (1.0 + 2.0 * MARGIN) / self.longest
        if cell < 1e-9:
            raise InputError(f"workspace map: the arm does not move {self.reach.frame} in the plane")
        counts = np.maximum(np.ceil(size * (1.0 + 2.0 * MARGIN) / cell - 1e-9), 2).astype(int)
        lower = 0.5 * (seen.min(axis=0) + seen.max(axis=0)) - 0.5 * cell * counts
        self.grid = Grid(lower, cell, int(counts[0]), int(counts[1]))
        cells, n = self.grid.columns * self.grid.rows, self.evaluator.robot.n
        self.layers = {
            (name, sign): Layer(cells, n, sign * measure.better)
            for name, measure in self.evaluator.measures.items()
            for sign in (1.0, -1.0)
        }
        self.rank = np.full(cells, -1, dtype=np.int64)
        self.offer(q, points, progress=between(progress, 0.2, 0.8))

    def offer(
        self,
        q: Array,
        points: Array | None = None,
        cells: Integers | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Postures (N, n), each brought to the middle of its cell, where that is in reach.

        Parameters
        ----------
        points : where they put the frame (N, 3), if that is known
        cells : for which cells they are meant; without, for those in which they put the frame
        """
        if cells is None:
            points = self.reach.positions(q) if points is None else points
            cells = np.where(self.reach.held(points), self.grid.cells(points[:, self.reach.in_plane]), -1)
            usable = np.flatnonzero(cells >= 0)
            q, points, cells = q[usable], points[usable], cells[usable]
        if not len(q):
            return
        near = NEAR * self.grid.cell
        found, places, left = self.reach.onto(q, self.grid.centers(cells), near, between(progress, 0.0, 0.5))
        central = left <= near
        outside = np.flatnonzero(
            (self.grid.cells(places[:, self.reach.in_plane]) != cells) | ~np.isfinite(left)
        )
        if points is not None:
            # A step may be nearer to the middle and yet outside of the square.
            found[outside] = q[outside]
        else:
            inside = np.setdiff1d(np.arange(len(q)), outside, assume_unique=True)
            found, central, cells = found[inside], central[inside], cells[inside]
        if not len(found):
            return
        evaluated = self.evaluator(found, between(progress, 0.5, 0.5))
        for (name, _), layer in self.layers.items():
            layer.offer(cells, central, evaluated.values[name], found)
        known = np.isfinite(evaluated.own.sigma)
        np.maximum.at(self.rank, cells[known], evaluated.own.rank[known])

    def spread(self, progress: Progress | None) -> None:
        """From the best posture of each block to the blocks beside it, and to the four that it consists of.

        An arm with no more joints than the plane has axes has nothing to gain but its other branches: `even`.
        """
        if len(self.reach.moving) <= 2:
            return
        total = len(self.layers) * len(BLOCKS)
        for k, layer in enumerate(self.layers.values()):
            for b, block in enumerate(BLOCKS):
                if b:
                    for seeds, blocks in self._parents(layer, block):
                        self._try(layer, seeds, blocks, block)
                for margin in SWEEPS_LARGE if block >= LARGE else SWEEPS_SMALL:
                    for seeds, blocks in self._neighbours(layer, block, margin):
                        self._try(layer, seeds, blocks, block)
                if progress is not None:
                    progress((k * len(BLOCKS) + b + 1) / total)

    def _try(self, layer: Layer, seeds: Integers, blocks: Integers, block: int) -> None:
        """Bring the postures of some cells into the middle of some blocks."""
        if block == 1:
            self.offer(layer.q[seeds], cells=blocks)
        else:
            self.offer(self.reach.towards(layer.q[seeds], self.grid.centers(blocks, block)))

    def _parents(self, layer: Layer, block: int) -> Iterator[tuple[Integers, Integers]]:
        """(cells, blocks): the best cell of each block twice as large, and its four blocks in turn."""
        blocks, cells = layer.best_of_blocks(self.grid, 2 * block)
        wide, _ = self.grid.shape(2 * block)
        columns, rows = self.grid.shape(block)
        for down, right in np.ndindex(2, 2):
            row, column = blocks // wide * 2 + down, blocks % wide * 2 + right
            children = row * columns + column
            # The best one's own block has it already.
            tried = (row < rows) & (column < columns) & (self.grid.blocks(cells, block) != children)
            yield cells[tried], children[tried]

    def _neighbours(self, layer: Layer, block: int, margin: float) -> Iterator[tuple[Integers, Integers]]:
        """(cells, blocks): the best cell of each block, and a block beside it that is worse."""
        for down, right in BESIDE:
            columns, rows = self.grid.shape(block)
            blocks, cells = layer.best_of_blocks(self.grid, block)
            own = np.full(columns * rows, -np.inf)
            own[blocks] = layer.values[cells]
            row, column = blocks // columns + down, blocks % columns + right
            inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            neighbours = (row * columns + column)[inside]
            value = layer.values[cells[inside]]
            # Of the worst value, which is kept with its sign changed, better is nearer to zero.
            better = value > own[neighbours] + margin * np.abs(value)
            yield cells[inside][better], neighbours[better]

    def fill(self, progress: Progress | None) -> None:
        """Reach the cells beside those that are reached, as long as some are found."""
        layer = next(iter(self.layers.values()))
        tried = np.zeros(len(layer.values), dtype=np.int64)
        before, rounds = -1, 0
        while before < (before := int(layer.reached.sum())):
            for side in BESIDE:
                seeds, blank = self._beside(layer.reached, side)
                wanted = ~layer.reached[blank] & (tried[blank] < TRIES)
                tried[blank[wanted]] += 1
                self.offer(layer.q[seeds[wanted]], cells=blank[wanted])
            rounds += 1
            if progress is not None:
                progress(1.0 - 1.0 / (1.0 + rounds))

    def even(self, progress: Progress | None) -> None:
        """Carry on branches of postures, from cell to cell, into cells where these are better.

        What a branch has in a cell is foretold from its two last ones. Where that is more than the cell has,
        by more than the bending of a smooth branch, the cell was not offered the branch yet, or it ends.
        """
        for k, layer in enumerate(self.layers.values()):
            own = between(progress, k / len(self.layers), 1.0 / len(self.layers))
            values = layer.values[layer.reached]
            margin = BENT * float(np.ptp(values)) if len(values) else 0.0
            tried = np.full((len(BESIDE), len(layer.values)), np.nan)
            seeds, cells = np.empty((2, len(layer.values)), dtype=np.int64)
            for sweep in range(SWEEPS):
                before = layer.values.copy()
                for side, seen in zip(BESIDE, tried, strict=True):
                    count = find_promising(layer.values, self.grid.columns, *side, margin, seen, seeds, cells)
                    self.offer(layer.q[seeds[:count]], cells=cells[:count].copy())
                if own is not None:
                    own((sweep + 1) / SWEEPS)
                if np.array_equal(before, layer.values):
                    break

    def _beside(self, chosen: Flags, side: tuple[int, int]) -> tuple[Integers, Integers]:
        """(cells, others): chosen cells and those beside them, on one side."""
        cells = np.flatnonzero(chosen)
        row, column = cells // self.grid.columns + side[0], cells % self.grid.columns + side[1]
        inside = (row >= 0) & (row < self.grid.rows) & (column >= 0) & (column < self.grid.columns)
        return cells[inside], (row * self.grid.columns + column)[inside]

    def values(self, sign: float) -> dict[str, Array]:
        """The best (1) or the worst (-1) value of each measure, (rows, columns); NaN: nothing is reached."""
        columns, rows = self.grid.shape(1)
        return {
            name: np.where(layer.reached, layer.sign * layer.values, np.nan).reshape(rows, columns)
            for (name, own), layer in self.layers.items()
            if own == sign
        }

    def postures(self, sign: float) -> dict[str, Array]:
        """The configurations (rows, columns, n) with these values."""
        columns, rows = self.grid.shape(1)
        return {
            name: layer.q.reshape(rows, columns, -1)
            for (name, own), layer in self.layers.items()
            if own == sign
        }
