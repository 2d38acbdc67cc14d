"""The fewest angles in which a trigonometric polynomial can be written."""

from __future__ import annotations

from collections.abc import Sequence

Integers = tuple[int, ...]


def basis_of(waves: Sequence[Integers], n: int) -> tuple[list[Integers], list[Integers]]:
    """Angles φ = B q, B integer, and the waves k = m B in them.

    B's rows can be completed to a unimodular matrix, so that q1 is among the angles of cos(2 q1), too.

    Parameters
    ----------
    waves : k of each term, n integers
    n : how many angles there are

    Returns
    -------
    basis : the rows of B
    seen : m of each wave
    """
    columns = [list(column) for column in zip(*waves, strict=True)] if waves and n else []
    inverse = [[int(i == j) for j in range(n)] for i in range(n)]  # rows: the new angles
    rank = 0
    # Short waves first: they make the angles that a person would choose, and low degrees.
    for row in sorted(range(len(waves)), key=lambda i: sum(map(abs, waves[i]))):
        while True:
            busy = [j for j in range(rank, n) if columns[j][row]]
            if not busy:
                break
            pivot = min(busy, key=lambda j: abs(columns[j][row]))
            if len(busy) == 1:
                columns[rank], columns[pivot] = columns[pivot], columns[rank]
                inverse[rank], inverse[pivot] = inverse[pivot], inverse[rank]
                rank += 1
                break
            for j in busy:
                if j != pivot:
                    times = columns[j][row] // columns[pivot][row]
                    columns[j] = [a - times * b for a, b in zip(columns[j], columns[pivot], strict=True)]
                    inverse[pivot] = [a + times * b for a, b in zip(inverse[pivot], inverse[j], strict=True)]
    basis = [tuple(row) for row in inverse[:rank]]
    return basis, [tuple(columns[j][i] for j in range(rank)) for i in range(len(waves))]
