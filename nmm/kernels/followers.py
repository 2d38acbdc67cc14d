"""Coordinates that follow others, in compiled code: `who` (4 k,) holds a follower, its leader, its multiplier
and its offset, by turns (`nmm.robots.followers.Following.table`)."""

from __future__ import annotations

from nmm.arrays import Array
from nmm.kernels.compiled import compiled


@compiled
def add_to_leaders(rows: Array, row: int, who: Array) -> None:
    """A derivative by the coordinates, rows[row] (n,): what is by a follower is added to its leader's."""
    for i in range(0, who.shape[0], 4):
        rows[row, int(who[i + 1])] += who[i + 2] * rows[row, int(who[i])]


@compiled
def move_followers(q_dot: Array, who: Array) -> None:
    """Followers' rates in q_dot (n,), from their leaders'."""
    for i in range(0, who.shape[0], 4):
        q_dot[int(who[i])] = who[i + 2] * q_dot[int(who[i + 1])]


@compiled
def place_followers(q: Array, who: Array) -> None:
    """Followers in q (n,) where their leaders have them, to the digit."""
    for i in range(0, who.shape[0], 4):
        q[int(who[i])] = who[i + 2] * q[int(who[i + 1])] + who[i + 3]
