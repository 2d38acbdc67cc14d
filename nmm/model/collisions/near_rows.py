"""The rows of all near pairs, compiled."""

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, integer_scratch, scratch
from nmm.base.kernels.record_layout import Blocks, views
from nmm.model.collisions.broad_phase import PairArrays
from nmm.model.collisions.face_rows import add_faces
from nmm.model.collisions.rows import DistanceRows, set_points, write_row
from nmm.model.collisions.seen_rows import add_seen, earlier_rows, remember


@compiled
def write_rows(
    blocks: Blocks, results: Array, places: Array, J: Array, row_blocks: Blocks, place: int
) -> float:
    """Write the rows of near pairs; returns their least distance, or infinity."""
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    rows = views(DistanceRows, row_blocks.integers, row_blocks.floats, place)
    most = rows.most[()]
    room = rows.pair.shape[0]
    pairs, elements = integer_scratch(room), scratch((room, 3))
    earlier = earlier_rows(scene, rows, pairs, elements)
    used = 0
    least = math.inf
    for pair in range(scene.active.shape[0]):
        d = results[pair, 0]
        if scene.active[pair] == 0:
            continue
        if not d < scene.band[()]:
            scene.bounds[pair] = max(d, scene.bounds[pair])
            continue
        scene.bounds[pair] = d
        least = min(least, d)
        slot = used
        if used == most:  # replaces the farthest
            slot = 0
            for k in range(most):
                if results[rows.pair[k], 0] > results[rows.pair[slot], 0]:
                    slot = k
            if not d < results[rows.pair[slot], 0]:
                continue
        else:
            used += 1
        rows.pair[slot] = pair
    own = used
    for slot in range(own):
        set_points(scene, results, places, rows.pair[slot], rows.points[slot])
        write_row(scene, J, places, rows, slot)
        rows.d[slot] = results[rows.pair[slot], 0]
        n = results[rows.pair[slot], 1:4]
        remember(scene, places, rows, slot)
        if not n[0] ** 2 + n[1] ** 2 + n[2] ** 2 > 0.5:  # no element: see `set_points`
            rows.edition[slot] = 0
    for slot in range(own):
        if not results[rows.pair[slot], 0] < scene.faces[()] or used == most:
            continue
        if scene.sensed.row[scene.pairs[rows.pair[slot], 1]] < 0:
            used = add_faces(scene, places, J, rows, slot, used)
        elif rows.edition[slot] > 0:
            used = add_seen(scene, places, J, rows, slot, used, earlier, pairs, elements)
    rows.used[()] = used
    return least
