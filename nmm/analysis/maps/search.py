"""The search for the best posture of each cell of a plane: drawn, spread from block to block, filled in. Each
cell keeps the best one offered for it so far."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from nmm.analysis.maps.measures import Evaluator
from nmm.analysis.maps.reach import ArmReach
from nmm.base.arrays import Array, Flags, Integers
from nmm.base.errors import InputError
from nmm.base.progress import Progress, between

#: Sides of the blocks, in cells, through which good postures spread. In each sweep, a block's best posture is
#: tried in the blocks beside it that are worse by more than this share; there are many small blocks.
BLOCKS, LARGE = (32, 16, 8, 4, 2, 1), 4
SWEEPS_LARGE, SWEEPS_SMALL = (0.01, 0.01), (0.2,)
#: Margin around what is reached, as a share of its size.
MARGIN = 0.03
#: How often the cells beside the reached ones are tried.
TRIES = 8
#: In the middle of its cell is what is nearer to it than this, in cells.
NEAR = 1e-7
#: A smooth branch's values bend by less than this share of their range from cell to cell; and how many
#: cells branches are carried.
BENT, SWEEPS = 3e-3, 40
BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells over a plane, numbered row by row from the first one's lower corner (2,), in m."""

    lower: Array
    cell: float
    columns: int
    rows: int

    @property
    def axes(self) -> tuple[Array, Array]:
        """Centres of columns and rows, m."""
        counts = np.arange(self.columns), np.arange(self.rows)
        x, y = (low + self.cell * (k + 0.5) for low, k in zip(self.lower, counts, strict=True))
        return x, y

    def shape(self, block: int) -> tuple[int, int]:
        """(columns, rows) of blocks of block x block cells."""
        return -(-self.columns // block), -(-self.rows // block)

    def cells(self, points: Array) -> Integers:
        """The number of each point's cell, points (N, 2); -1 outside."""
        place = np.floor((points - self.lower) / self.cell).astype(np.int64)
        inside = np.all((place >= 0) & (place < [self.columns, self.rows]), axis=1)
        return np.where(inside, place[:, 1] * self.columns + place[:, 0], -1)

    def centers(self, cells: Integers, block: int = 1) -> Array:
        """Centres (N, 2) of cells, or of blocks of block x block of them."""
        row, column = np.divmod(cells, self.shape(block)[0])
        return np.asarray(self.lower + self.cell * block * (np.column_stack([column, row]) + 0.5))

    def beside(self, cells: Integers, side: tuple[int, int], block: int = 1) -> tuple[Flags, Integers]:
        """Which cells, or blocks, have a neighbour (down, right) of them, and these neighbours."""
        columns, rows = self.shape(block)
        row, column = cells // columns + side[0], cells % columns + side[1]
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return inside, (row * columns + column)[inside]


class Layer:
    """The largest value offered for each cell (smallest with `sign` -1), with its posture.

    Postures in the middle of the cell take precedence, so that neighbours differ by the plane alone.
    """

    def __init__(self, grid: Grid, n: int, sign: float) -> None:
        cells = grid.columns * grid.rows
        self.grid, self.sign = grid, sign
        self.values = np.full(cells, -np.inf)
        self.q = np.full((cells, n), np.nan)
        self.central = np.zeros(cells, dtype=bool)

    @property
    def reached(self) -> Flags:
        return np.asarray(np.isfinite(self.values))

    def offer(self, cells: Integers, central: Flags, values: Array, q: Array) -> None:
        """Keep the postures q (N, n) that are better than those of their cells; of equals the last."""
        signed = self.sign * values
        offered = np.flatnonzero((cells >= 0) & np.isfinite(signed))
        offered = offered[np.lexsort((signed[offered], central[offered]))]
        last = np.full(len(self.values), -1)
        np.maximum.at(last, cells[offered], np.arange(len(offered)))
        best = offered[last[last >= 0]]
        own = cells[best]
        alike = central[best] == self.central[own]
        best = best[np.where(alike, signed[best] > self.values[own], central[best])]
        own = cells[best]
        self.values[own], self.q[own], self.central[own] = signed[best], q[best], central[best]

    def best_of_blocks(self, block: int) -> tuple[Integers, Integers]:
        """(blocks, cells): of each block that was reached the best cell, of equally good ones the last."""
        columns, rows = self.grid.shape(block)
        values = np.full((rows * block, columns * block), -np.inf)
        values[: self.grid.rows, : self.grid.columns] = self.values.reshape(self.grid.rows, -1)
        tiles = values.reshape(rows, block, columns, block).transpose(1, 3, 0, 2).reshape(block**2, -1)
        last = block**2 - 1 - tiles[::-1].argmax(axis=0)
        blocks = np.flatnonzero(np.isfinite(tiles.max(axis=0)))
        corner = blocks // columns * block * self.grid.columns + blocks % columns * block
        return blocks, corner + last[blocks] // block * self.grid.columns + last[blocks] % block

    def promising(self, side: tuple[int, int], margin: float, tried: Array) -> tuple[Integers, Integers]:
        """(cells, neighbours) on one side that are worse than extrapolated by more than `margin`.

        `tried`, which is updated, holds the cell's value when each neighbour was last tried from this side.
        """
        every = np.arange(len(self.values))
        inside, others = self.grid.beside(every, side)
        value, other = self.values[inside], self.values[others]
        # Where it wraps round into another row, the worst that comes of it is an idle try.
        earlier = every[inside] - side[0] * self.grid.columns - side[1]
        known = (earlier >= 0) & (earlier < len(every))
        before = np.where(known, self.values[earlier * known], -np.inf)
        with np.errstate(invalid="ignore"):  # infinite: not reached
            change = np.where(np.isfinite(before), value - before, 0.0)
            better = np.isfinite(value + other) & (value + change > other + margin) & (tried[others] != value)
        tried[others[better]] = value[better]
        return every[inside][better], others[better]


class PostureSearch:
    """Postures offered to the cells, for the best and the worst value of each measure.

    The cells, `longest` of them along the longer side, surround what `count` postures reach. `InputError`
    where no posture is within the slab, or the frame does not move in the plane.
    """

    def __init__(
        self, evaluator: Evaluator, reach: ArmReach, longest: int, count: int, progress: Progress | None
    ) -> None:
        self.evaluator, self.reach = evaluator, reach
        q = reach.postures(count)
        points = reach.positions(q, between(progress, 0.0, 0.2))
        seen = points[reach.held(points)][:, reach.in_plane]
        if not len(seen):
            slab = "{:g} to {:g} m".format(*(reach.slab or (0.0, 0.0)))
            lowest, highest = points[:, reach.third].min(), points[:, reach.third].max()
            what = f"no posture puts {reach.frame} at {slab}, they reach {lowest:.3g} to {highest:.3g} m"
            raise InputError(what, where="height")
        size = np.ptp(seen, axis=0)
        cell = float(size.max()) * (1.0 + 2.0 * MARGIN) / longest
        if cell < 1e-9:
            raise InputError(f"the arm does not move {reach.frame} in the plane", where="workspace map")
        counts = np.maximum(np.ceil(size * (1.0 + 2.0 * MARGIN) / cell - 1e-9), 2).astype(int)
        lower = 0.5 * (seen.min(axis=0) + seen.max(axis=0)) - 0.5 * cell * counts
        self.grid = Grid(lower, cell, int(counts[0]), int(counts[1]))
        self.layers = {
            (name, sign): Layer(self.grid, evaluator.robot.n, sign * measure.better)
            for name, measure in evaluator.measures.items()
            for sign in (1.0, -1.0)
        }
        self.rank = np.full(self.grid.columns * self.grid.rows, -1)
        self.offer(q, points, progress=between(progress, 0.2, 0.8))

    def offer(
        self,
        q: Array,
        points: Array | None = None,
        cells: Integers | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Postures (N, n), each brought to its cell's middle if in reach.

        The cell is the one given, or that of the frame, at `points` (N, 3) if known.
        """
        meant = cells is not None
        if cells is None:
            points = self.reach.positions(q) if points is None else points
            cells = np.where(self.reach.held(points), self.grid.cells(points[:, self.reach.in_plane]), -1)
            q, cells = q[cells >= 0], cells[cells >= 0]
        if not len(q):
            return
        near = NEAR * self.grid.cell
        found, places, left = self.reach.onto(q, self.grid.centers(cells), near, between(progress, 0.0, 0.5))
        central = left <= near
        inside = (self.grid.cells(places[:, self.reach.in_plane]) == cells) & np.isfinite(left)
        if meant:
            found, central, cells = found[inside], central[inside], cells[inside]
        else:
            # A step may be nearer to the middle and yet outside of the square.
            found[~inside] = q[~inside]
        if not len(found):
            return
        evaluated = self.evaluator(found, between(progress, 0.5, 0.5))
        for (name, _), layer in self.layers.items():
            layer.offer(cells, central, evaluated.values[name], found)
        known = np.isfinite(evaluated.own.sigma)
        np.maximum.at(self.rank, cells[known], evaluated.own.rank[known])

    def spread(self, progress: Progress | None) -> None:
        """From each block's best posture to the adjacent blocks, and to its four quarters.

        An arm with no more joints than the plane has axes gains only from its other branches: see `even`.
        """
        if len(self.reach.moving) <= 2:
            return
        stages = list(itertools.product(self.layers.values(), BLOCKS))
        for done, (layer, block) in enumerate(stages, start=1):
            margins = SWEEPS_LARGE if block >= LARGE else SWEEPS_SMALL
            tries = [self._neighbours(layer, block, margin) for margin in margins]
            if block != BLOCKS[0]:
                tries.insert(0, self._parents(layer, block))
            for seeds, blocks in itertools.chain(*tries):
                if block == 1:
                    self.offer(layer.q[seeds], cells=blocks)
                else:
                    self.offer(self.reach.towards(layer.q[seeds], self.grid.centers(blocks, block)))
            if progress is not None:
                progress(done / len(stages))

    def _parents(self, layer: Layer, block: int) -> Iterator[tuple[Integers, Integers]]:
        """(cells, blocks): the best cell of each block twice as large, and its four blocks in turn."""
        blocks, cells = layer.best_of_blocks(2 * block)
        wide, _ = self.grid.shape(2 * block)
        columns, rows = self.grid.shape(block)
        own = cells // self.grid.columns // block * columns + cells % self.grid.columns // block
        for down, right in np.ndindex(2, 2):
            row, column = blocks // wide * 2 + down, blocks % wide * 2 + right
            children = row * columns + column
            tried = (row < rows) & (column < columns) & (own != children)
            yield cells[tried], children[tried]

    def _neighbours(self, layer: Layer, block: int, margin: float) -> Iterator[tuple[Integers, Integers]]:
        """(cells, blocks): the best cell of each block, and a block beside it that is worse."""
        columns, rows = self.grid.shape(block)
        for side in BESIDE:
            blocks, cells = layer.best_of_blocks(block)
            own = np.full(columns * rows, -np.inf)
            own[blocks] = layer.values[cells]
            inside, neighbours = self.grid.beside(blocks, side, block)
            seeds = cells[inside]
            value = layer.values[seeds]
            # Of the worst value, which is kept with its sign changed, better is nearer to zero.
            better = value > own[neighbours] + margin * np.abs(value)
            yield seeds[better], neighbours[better]

    def fill(self, progress: Progress | None) -> None:
        """Reach the neighbours of reached cells, as long as some are found."""
        layer = next(iter(self.layers.values()))
        tried = np.zeros(len(layer.values), dtype=np.int64)
        before, rounds = -1, 0
        while before < (before := int(layer.reached.sum())):
            for side in BESIDE:
                reached = np.flatnonzero(layer.reached)
                inside, blank = self.grid.beside(reached, side)
                wanted = ~layer.reached[blank] & (tried[blank] < TRIES)
                tried[blank[wanted]] += 1
                self.offer(layer.q[reached[inside][wanted]], cells=blank[wanted])
            rounds += 1
            if progress is not None:
                progress(1.0 - 1.0 / (1.0 + rounds))

    def even(self, progress: Progress | None) -> None:
        """Continue branches of postures from cell to cell, into cells where they are better.

        A cell much worse than extrapolated from a branch's last two was not offered it, or the branch ends.
        """
        for k, layer in enumerate(self.layers.values()):
            own = between(progress, k / len(self.layers), 1.0 / len(self.layers))
            values = layer.values[layer.reached]
            margin = BENT * float(np.ptp(values)) if len(values) else 0.0
            tried = np.full((len(BESIDE), len(layer.values)), np.nan)
            for sweep in range(SWEEPS):
                before = layer.values.copy()
                for side, seen in zip(BESIDE, tried, strict=True):
                    seeds, cells = layer.promising(side, margin, seen)
                    self.offer(layer.q[seeds], cells=cells)
                if own is not None:
                    own((sweep + 1) / SWEEPS)
                if np.array_equal(before, layer.values):
                    break

    def found(self, sign: float) -> tuple[dict[str, Array], dict[str, Array]]:
        """By measure the best (1) or the worst (-1) values, (rows, columns), NaN where nothing is reached,
        and the configurations (rows, columns, n) with them."""
        values, postures = {}, {}
        for (name, own), layer in self.layers.items():
            if own == sign:
                signed = np.where(layer.reached, layer.sign * layer.values, np.nan)
                values[name] = signed.reshape(self.grid.rows, -1)
                postures[name] = layer.q.reshape(self.grid.rows, self.grid.columns, -1)
        return values, postures
