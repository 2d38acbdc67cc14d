"""UMBmark: its paper's formulas, and square drives of robots whose wheels and track are exactly known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from drives import drive

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot

SIDE, TRACK, RADIUS = 4.0, 0.5, 0.1
LEFT, RIGHT = "left_wheel_joint", "right_wheel_joint"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return nmm.load("differential_base")


def ends(E_d: float, E_b: float, left: bool, side: float = SIDE) -> complex:
    """Where a robot truly ends that drives a square by an odometry of equal wheels and the track of its file:
    arcs of circles, in complex numbers."""
    c_left, c_right = 2.0 / (E_d + 1.0), 2.0 / (1.0 / E_d + 1.0)
    at, heading = 0j, 0.0
    quarter = (1.0 if left else -1.0) * 0.25 * math.pi * TRACK
    for _ in range(4):
        for ways in ((side, side), (-quarter, quarter)):
            go, turn = 0.5 * (c_left * ways[0] + c_right * ways[1]), c_right * ways[1] - c_left * ways[0]
            turn /= E_b * TRACK
            chord = go * np.sinc(0.5 * turn / math.pi)
            at += chord * complex(math.cos(heading + 0.5 * turn), math.sin(heading + 0.5 * turn))
            heading += turn
    return at


def marked(E_d: float, E_b: float, by: Any = "x") -> nmm.UMBmark:
    rows = [[[end.real, end.imag]] for end in (ends(E_d, E_b, False), ends(E_d, E_b, True))]
    return nmm.UMBmark(SIDE, rows[0], rows[1], TRACK, by)  # type: ignore[arg-type]  # made arrays


@pytest.mark.parametrize("by", ["x", "y", "both"])
@pytest.mark.parametrize(
    ("d", "b"), [(0.01, 0.0), (-0.01, 0.0), (0.0, 0.02), (0.0, -0.02), (0.006, 0.02), (-0.004, -0.03)]
)
def test_what_is_left_is_of_second_order(d: float, b: float, by: Any) -> None:
    """No more than three times the square of the angles, which are found to first order."""
    for share in (1.0, 0.25, 0.0625):
        E_d, E_b = 1.0 + share * d, 1.0 + share * b
        alpha = 0.5 * math.pi * (1.0 - 1.0 / E_b)
        beta = 2.0 * math.asin(SIDE / TRACK * (E_d - 1.0) / (E_d + 1.0))
        mark = marked(E_d, E_b, by)
        most = 3.0 * (abs(alpha) + abs(beta)) ** 2
        assert abs(mark.alpha - alpha) < most
        assert abs(mark.beta - beta) < most


@pytest.mark.parametrize(("by", "most"), [("x", 0.052), ("y", 0.072), ("both", 0.015)])
def test_how_far_off_the_formulas_are(by: Any, most: float) -> None:
    """Of 0.2 % of the wheels and 1 % of the track, about as of the paper's robots."""
    mark = marked(1.002, 1.01, by)
    assert abs(mark.E_d - 1.002) < most * 0.002 * 1.01
    assert abs(mark.E_b - 1.01) < most * 0.01 * 1.01
    assert mark.true_track == pytest.approx(mark.E_b * TRACK)


def test_the_papers_formulas() -> None:
    """In degrees, as they are printed."""
    cw, ccw = np.array([[-0.31, -0.22], [-0.29, -0.26]]), np.array([[0.06, 0.05], [0.02, 0.07]])
    mark = nmm.UMBmark(SIDE, cw, ccw, TRACK)
    x_cw, x_ccw = -0.30, 0.04
    alpha = (x_cw + x_ccw) / (-4 * SIDE) * 180 / math.pi
    beta = (x_cw - x_ccw) / (-4 * SIDE) * 180 / math.pi
    assert math.degrees(mark.alpha) == pytest.approx(alpha)
    assert math.degrees(mark.beta) == pytest.approx(beta)
    R = (SIDE / 2) / math.sin(math.radians(beta) / 2)
    E_d, E_b = (R + TRACK / 2) / (R - TRACK / 2), 90 / (90 - alpha)
    assert (mark.radius, mark.E_d, mark.E_b) == pytest.approx((R, E_d, E_b))
    assert mark.true_track == pytest.approx(E_b * TRACK)
    assert (mark.c_left, mark.c_right) == pytest.approx((2 / (E_d + 1), 2 / (1 / E_d + 1)))
    assert mark.c_right / mark.c_left == pytest.approx(E_d)
    assert mark.c_right + mark.c_left == pytest.approx(2.0)
    np.testing.assert_allclose(mark.center_clockwise, [-0.30, -0.24])
    np.testing.assert_allclose(mark.center_counterclockwise, [0.04, 0.06])
    assert mark.largest_error == pytest.approx(math.hypot(0.30, 0.24))
    by_y = nmm.UMBmark(SIDE, cw, ccw, TRACK, by="y")
    assert by_y.alpha == pytest.approx((-0.24 - 0.06) / (-4 * SIDE))
    assert by_y.beta == pytest.approx((-0.24 + 0.06) / (-4 * SIDE))
    both = nmm.UMBmark(SIDE, cw, ccw, TRACK, by="both")
    assert both.alpha == pytest.approx(0.5 * (mark.alpha + by_y.alpha))


def test_a_robot_that_ends_where_it_should_has_nothing_to_correct() -> None:
    mark = nmm.UMBmark(SIDE, np.zeros((5, 2)), np.zeros((5, 2)), TRACK)
    assert (mark.E_d, mark.E_b, mark.c_left, mark.c_right, mark.largest_error) == (1, 1, 1, 1, 0)
    assert mark.radius == math.inf


@pytest.mark.parametrize(
    ("others", "words"),
    [
        ({"clockwise": []}, "UMBmark: clockwise: expected errors of x and y"),
        ({"counterclockwise": [[0.0, 0.0, 0.0]]}, "counterclockwise: expected errors of x and y"),
        ({"clockwise": [[np.nan, 0.0]]}, "clockwise: expected finite numbers"),
        ({"clockwise": [[5.0, 0.0]]}, "clockwise: expected errors of less than the side, 4 m, got 5"),
        ({"side": 0.0}, "side: expected a number above 0"),
        ({"track": -1.0}, "track: expected a number above 0"),
        ({"by": "z"}, "unknown axis 'z'"),
    ],
)
def test_what_no_square_drive_gives_is_named(others: dict[str, Any], words: str) -> None:
    parts = {"side": SIDE, "clockwise": [[0.1, 0.1]], "counterclockwise": [[0.1, 0.1]], "track": TRACK}
    with pytest.raises(InputError, match=words):
        nmm.UMBmark(**(parts | others))


def square(
    left: bool,
    side: float = SIDE,
    turns: int = 4,
    first: bool = False,
    wheels: tuple[float, float] = (1.0, 1.0),
) -> tuple[Array, dict[str, Array]]:
    """t (N,) and the wheels' angles of an odometry that drives a square; `first` turns before the first side;
    `wheels`: the radii of the left and right wheel, over the file's."""
    quarter = (1.0 if left else -1.0) * 0.25 * math.pi * TRACK
    legs = [(-quarter, quarter)] * first
    for k in range(4):
        legs += [(side, side), *[(-quarter, quarter)] * (k < turns)]
    t, ways = [0.0], [np.zeros(2)]
    for leg in legs[: len(legs) - first]:
        for _ in range(40):
            t.append(t[-1] + 0.05)
            ways.append(ways[-1] + np.array(leg) / 40)
    turned = np.array(ways) / RADIUS / wheels
    return np.array(t), {LEFT: turned[:, 0], RIGHT: turned[:, 1]}


def true_end(end: complex, t: Array, name: str, readings: dict[str, Array]) -> nmm.DriveLog:
    """Seen from anywhere: the square begins at (2, 1) with heading 0.7."""
    turn = complex(math.cos(0.7), math.sin(0.7))
    rows = [[2.0, 1.0, 0.7], [(2.0 + 1.0j + turn * end).real, (2.0 + 1.0j + turn * end).imag, 0.9]]
    return nmm.DriveLog(name, t, readings, t[[0, -1]], np.array(rows), "ends")


def test_logs_of_squares_say_side_direction_and_errors(robot: Robot) -> None:
    logs = []
    for left in (True, False, False, True):
        t, readings = square(left)
        logs.append(true_end(ends(1.004, 1.01, left), t, f"drive {len(logs)}", readings))
    mark = nmm.UMBmark.from_logs(robot, logs)
    assert mark.side == pytest.approx(SIDE)
    assert mark.track == pytest.approx(TRACK)
    for rows, left in ((mark.clockwise, False), (mark.counterclockwise, True)):
        end = ends(1.004, 1.01, left)
        np.testing.assert_allclose(rows, [[end.real, end.imag]] * 2, atol=1e-9)
    assert mark.E_d == pytest.approx(marked(1.004, 1.01).E_d)
    np.testing.assert_allclose(nmm.UMBmark.from_logs(robot, logs, by="y").E_b, marked(1.004, 1.01, "y").E_b)


def test_poses_on_the_way_and_three_corners_do(robot: Robot) -> None:
    """The first and the last pose count, which come after the log began and before it ends."""
    logs = []
    for left in (True, False):
        t, readings = square(left, turns=3)
        waited = np.concatenate([[0.0, 1.0], t[1:] + 1.0, [t[-1] + 2.0]])
        still = {name: np.concatenate([turned[:1], turned, turned[-1:]]) for name, turned in readings.items()}
        end = ends(1.003, 0.99, left)
        seen = np.array([[0.0, 0.0, 0.0], [3.0, 2.0, 1.0], [end.real, end.imag, 0.0]])
        logs.append(nmm.DriveLog("drive", waited, still, waited[[1, 50, -2]], seen, "poses"))
    mark = nmm.UMBmark.from_logs(robot, logs)
    for rows, left in ((mark.clockwise, False), (mark.counterclockwise, True)):
        end = ends(1.003, 0.99, left)
        np.testing.assert_allclose(rows, [[end.real, end.imag]], atol=1e-9)


def test_closed_drives_say_what_a_robot_is(robot: Robot) -> None:
    """A robot of other wheels and track, pushed around a true square: what its counters say of it."""
    E_d, E_b = 1.003, 1.012
    c_left, c_right = 2 / (E_d + 1), 2 / (1 / E_d + 1)
    logs = []
    for left in (True, False):
        quarter = (1.0 if left else -1.0) * 0.25 * math.pi * TRACK * E_b
        t, ways = [0.0], [np.zeros(2)]
        for leg in [(SIDE, SIDE), (-quarter, quarter)] * 4:
            for _ in range(20):
                t.append(t[-1] + 0.1)
                ways.append(ways[-1] + np.array(leg) / 20)
        turned = np.array(ways) / RADIUS / [c_left, c_right]
        logs.append(nmm.DriveLog.closed("pushed", t, {LEFT: turned[:, 0], RIGHT: turned[:, 1]}))
    mark = nmm.UMBmark.from_logs(robot, logs, by="both")
    assert mark.E_d == pytest.approx(E_d, abs=0.1 * (E_d - 1))
    assert mark.E_b == pytest.approx(E_b, abs=0.1 * (E_b - 1))
    assert mark.c_left == pytest.approx(c_left, abs=2e-4)


def test_a_drive_that_turns_first_is_seen_along_its_first_side(robot: Robot) -> None:
    logs = []
    for left in (True, False):
        t, readings = square(left, first=True)
        start = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        logs.append(nmm.DriveLog("drive", t, readings, t[[0, -1]], start, "ends"))
    assert nmm.UMBmark.from_logs(robot, logs).largest_error == pytest.approx(0.0, abs=1e-9)
    along = {True: 0.1j, False: -0.1j}  # 0.1 m along the first side, to the left and to the right
    logs = [
        nmm.DriveLog("drive", log.t, log.readings, log.reference_t,
                     np.array([[0, 0, 0], [0.0, along[left].imag, 0]]), "ends")
        for left, log in zip((True, False), logs, strict=True)
    ]  # fmt: skip
    mark = nmm.UMBmark.from_logs(robot, logs)
    np.testing.assert_allclose(mark.clockwise, [[0.1, 0.0]], atol=1e-9)
    np.testing.assert_allclose(mark.counterclockwise, [[0.1, 0.0]], atol=1e-9)


def test_what_is_no_umbmark_is_named(robot: Robot) -> None:
    def closed(name: str, *parts: Any, **others: Any) -> nmm.DriveLog:
        return nmm.DriveLog.closed(name, *square(*parts, **others))

    def refused(*logs: nmm.DriveLog, of: Robot = robot) -> str:
        with pytest.raises(InputError) as caught:
            nmm.UMBmark.from_logs(of, logs)
        assert len(str(caught.value)) <= 300
        return str(caught.value)

    assert "expected a clockwise drive at least" in refused(closed("a", True))
    assert "expected a counterclockwise drive at least" in refused(closed("a", False))
    assert "expected a clockwise drive" in refused()
    text = refused(closed("a", True), closed("b", False, side=3.0))
    assert "sides differ: 3 m in b, 4 m in a" in text
    text = refused(closed("half", True, turns=1))
    assert "UMBmark: half: no square drive: it turns by 1.57 rad" in text
    circle = np.linspace(0.0, 2.0 * math.pi, 400)
    round_ = {LEFT: circle * (1.0 - 0.25) / RADIUS, RIGHT: circle * (1.0 + 0.25) / RADIUS}
    assert "round: no square drive" in refused(nmm.DriveLog.closed("round", circle, round_))
    t, readings = square(True)
    seen = nmm.DriveLog("seen", t, readings, t[[0, -1]], np.array([[0.0, 0.0], [0.1, 0.0]]), "ends")
    assert "seen: the reference says no heading at the start" in refused(seen)
    with pytest.raises(InputError, match="UMBmark: logs: expected logs of drives"):
        nmm.UMBmark.from_logs(robot, [t])  # type: ignore[list-item]
    for other in ("car_base", "omni_base"):
        text = refused(closed("a", True), of=nmm.load(other))
        assert f"UMBmark: {other}: expected a differential drive, which turns on the spot" in text


def test_the_arm_of_a_robot_and_its_trailers_do_not_matter() -> None:
    arm = nmm.load("unicycle_2r")
    t, readings = square(True)
    other = {name: turned * 0.4 / TRACK for name, turned in readings.items()}
    logs = [
        nmm.DriveLog.closed("a", t, other),
        nmm.DriveLog.closed("b", t, {LEFT: other[RIGHT], RIGHT: other[LEFT]}),
    ]
    mark = nmm.UMBmark.from_logs(arm, logs)
    assert (mark.track, mark.side) == pytest.approx((0.4, 0.4 / TRACK * SIDE))
    assert mark.largest_error == pytest.approx(0.0, abs=1e-9)


def test_the_corrected_robot_s_odometry_ends_where_the_robot_does(robot: Robot) -> None:
    """The square of the wrong robot, counted by one with the corrections: it ends where it truly did."""
    E_d, E_b = 1.004, 1.01
    mark = marked(E_d, E_b, "both")
    end = ends(mark.E_d, mark.E_b, True)
    true = ends(E_d, E_b, True)
    assert abs(end - true) < 0.1 * abs(true)
    driven = drive(robot, lambda t: (1.0, 2.0), duration=1.0)
    assert driven.q[-1, 2] == pytest.approx(0.1 / TRACK, abs=1e-3)
