"""Rows of elements that were nearest at earlier samples, compiled.

A robot's shape beside a cloud has a nearest element, and a little turn makes it another one. With a row of
that one alone a robot that is blocked trembles between them. Each element is to be kept off, so rows of
those that were nearest before hold as well; beside them the robot comes to rest. A row knows its element by
where that is in the axes of the obstacle, and the edition of these: one that is updated has other elements.
"""

import math

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled, scratch
from nmm.model.collisions.broad_phase import PairArrays, to_world
from nmm.model.collisions.elements.element_distance import box_distance, point_distance
from nmm.model.collisions.elements.nearest import FINE
from nmm.model.collisions.elements.shapes_record import HULL
from nmm.model.collisions.rows import DistanceRows, write_row

#: At most so many further rows of a pair; elements nearer to one that has a row than this, m, have none.
MORE, APART = 8, 2e-3
#: In turn, the least of d less this share of the distance from the elements that have rows is chosen: what
#: is nearly as near, and what is far from the others, for turns to the other side.
NEARER, WIDER = 0.02, 0.3


@compiled
def remember(scene: PairArrays, places: Array, rows: DistanceRows, slot: int) -> None:
    """Write where a row's element is in the axes of its obstacle; edition 0 for one without."""
    j = scene.pairs[rows.pair[slot], 1]
    row, x = scene.sensed.row[j], rows.points[slot]
    rows.edition[slot] = 0
    if row < 0 or not x[6] * x[6] + x[7] * x[7] + x[8] * x[8] > 0.5:
        return
    rows.edition[slot] = scene.sensed.edition[row]
    radius = scene.sensed.lattice[row, 6]
    for k in range(3):
        along = 0.0
        for i in range(3):
            along += places[j, 3 * k + i] * (x[3 + i] + radius * x[6 + i] - places[j, 9 + i])
        rows.element[slot, k] = along


@compiled
def earlier_rows(scene: PairArrays, rows: DistanceRows, pairs: Integers, elements: Array) -> int:
    """Copy the elements of rows, (K, 3), and their pairs (K,), and return their count."""
    count = 0
    for slot in range(rows.used[()] if scene.sensed.grids.shape[0] else 0):
        row = scene.sensed.row[scene.pairs[rows.pair[slot], 1]]
        if row < 0 or rows.edition[slot] != scene.sensed.edition[row]:
            continue
        pairs[count] = rows.pair[slot]
        for k in range(3):
            elements[count, k] = rows.element[slot, k]
        count += 1
    return count


@compiled
def measure_element(scene: PairArrays, places: Array, pair: int, element: Array, x: Array) -> float:
    """The distance of a pair's shape to an element (3,) of its obstacle; x (9,) as a row's points."""
    i, j = scene.pairs[pair, 0], scene.pairs[pair, 1]
    shapes = scene.sensed
    at, out, half, middle = scratch(3), scratch(6), scratch(3), scratch((1, 3))
    to_world(places, j, element[0], element[1], element[2], middle, 0)
    for k in range(3):
        at[k] = half[k] = 0.0
        for a in range(3):
            at[k] += places[i, 3 * k + a] * (middle[0, a] - places[i, 9 + a])
    for k in range(6):
        out[k] = 0.0
    if shapes.kind[i] == HULL:
        d = box_distance(shapes, i, places[i], at, half, math.inf, FINE, out)
    else:
        d = point_distance(shapes, i, at, out)
    radius = shapes.lattice[shapes.row[j], 6]
    for k in range(3):
        n = places[i, k] * out[0] + places[i, 3 + k] * out[1] + places[i, 6 + k] * out[2]
        x[k], x[3 + k], x[6 + k] = middle[0, k] - d * n, middle[0, k] - radius * n, n
    return d - radius


@compiled
def spread(rows: DistanceRows, slot: int, first: int, used: int, x: Array) -> float:
    """How far an element's nearest point, x (9,), is from those of rows, a slot and those from first on."""
    least = math.inf
    for other in range(first - 1, used):
        y = rows.points[slot if other < first else other]
        square = 0.0
        for k in range(3, 6):
            square += (x[k] - y[k]) ** 2
        least = min(least, square)
    return math.sqrt(least)


@compiled
def add_seen(
    scene: PairArrays,
    places: Array,
    J: Array,
    rows: DistanceRows,
    slot: int,
    used: int,
    count: int,
    pairs: Integers,
    elements: Array,
) -> int:
    """Add rows of a pair's elements among `count` earlier ones, (K,) and (K, 3); returns the number of rows
    then."""
    pair, first = rows.pair[slot], used
    tried, d = scratch((count + 1, 9)), scratch(count + 1)
    for k in range(count):
        d[k] = math.inf
        if pairs[k] == pair:
            d[k] = measure_element(scene, places, pair, elements[k], tried[k])
            if d[k] >= scene.faces[()]:
                d[k] = math.inf
    for turn in range(MORE):
        best, least = -1, math.inf
        for k in range(count):
            if math.isinf(d[k]):
                continue
            apart = spread(rows, slot, first, used, tried[k])
            score = d[k] - (NEARER if turn % 2 == 0 else WIDER) * apart
            if apart < APART:
                d[k] = math.inf
            elif score < least:
                best, least = k, score
        if best < 0 or used == rows.most[()]:
            break
        rows.pair[used] = pair
        for k in range(9):
            rows.points[used, k] = tried[best, k]
        write_row(scene, J, places, rows, used)
        remember(scene, places, rows, used)
        d[best] = math.inf
        used += 1
    return used
