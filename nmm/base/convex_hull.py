"""The convex hull of points in a plane."""

from nmm.base.arrays import Array


def convex_corners(points: Array, least: float = 0.0) -> list[int]:
    """Which of points (K, 2) are the corners of their convex hull, counterclockwise (A. M. Andrew, 1979);
    all of them where there are fewer than three different ones. A corner makes a triangle of more than half
    of `least` with its neighbours."""
    places = list(map(tuple, points.tolist()))
    first = dict(zip(reversed(places), reversed(range(len(places))), strict=True))  # of each place
    order = [first[place] for place in sorted(first)]
    if len(order) < 3:
        return list(range(len(places)))
    corners: list[int] = []
    for way in (order, order[::-1]):
        chain: list[int] = []
        for k in way:
            x, y = places[k]
            while len(chain) > 1:
                (ax, ay), (bx, by) = places[chain[-2]], places[chain[-1]]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > least:
                    break
                chain.pop()
            chain.append(k)
        corners += chain[:-1]
    return corners
