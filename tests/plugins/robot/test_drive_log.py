"""Logs of drives: what they hold, and what no log may be."""

from __future__ import annotations

import doctest
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration import log_findings
from nmm.plugins.robot.calibration.log_turns import counted_on, stated_for
from nmm.plugins.robot.calibration.log_units import unit_of
from nmm.plugins.robot.encoders import Turns

T = np.linspace(0.0, 4.0, 41)
TURNED = {"left_wheel_joint": 5.0 * T, "right_wheel_joint": 6.0 * T}
POSES = np.column_stack([0.55 * T, 0.0 * T, 0.2 * T])


def made(**others: Any) -> nmm.DriveLog:
    parts = {"name": "a", "t": T, "readings": TURNED, "reference_t": T, "reference": POSES, "kind": "poses"}
    return nmm.DriveLog(**(parts | others))


def test_a_log_holds_what_it_was_given_and_nobody_changes_it() -> None:
    given = T.copy()
    log = made(t=given, readings={"left_wheel_joint": 5.0 * given})
    given[0] = -9.0
    np.testing.assert_array_equal(log.t, T)
    assert (len(log), log.duration, log.name) == (41, 4.0, "a")
    assert log.moved == {"left_wheel_joint": pytest.approx(20.0)}
    for array in (log.t, log.readings["left_wheel_joint"], log.reference, log.reference_t):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_moved_is_the_way_to_and_fro() -> None:
    there = np.concatenate([np.linspace(0, 3, 21), np.linspace(3, 1, 21)[1:]])
    assert made(readings={"left_wheel_joint": there}).moved["left_wheel_joint"] == pytest.approx(5.0)


def test_headings_are_counted_on() -> None:
    turning = np.column_stack([T, T, 3.0 * T])
    wrapped = turning.copy()
    wrapped[:, 2] = (wrapped[:, 2] + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(made(reference=wrapped).reference, turning, atol=1e-12)


def test_a_part_has_what_lies_between_two_times() -> None:
    part = made(reference_t=T + 0.01).part(1.0, 2.0)
    np.testing.assert_allclose(part.t, np.linspace(1.0, 2.0, 11))
    np.testing.assert_allclose(part.readings["left_wheel_joint"], 5.0 * part.t)
    np.testing.assert_allclose(part.reference_t, np.linspace(1.01, 1.91, 10))
    np.testing.assert_allclose(part.reference[:, 0], 0.55 * (part.reference_t - 0.01))


@pytest.mark.parametrize(("first", "last"), [(9.0, 10.0), (2.0, 1.0), (1.0, 1.05)])
def test_a_part_of_nothing_is_refused(first: float, last: float) -> None:
    with pytest.raises(InputError, match="log a: part: expected two readings"):
        made().part(first, last)


def test_a_closed_drive_ends_where_it_began() -> None:
    log = nmm.DriveLog.closed("square", T, TURNED)
    assert log.kind == "ends"
    np.testing.assert_array_equal(log.reference, np.zeros((2, 3)))
    np.testing.assert_array_equal(log.reference_t, [0.0, 4.0])
    with pytest.raises(InputError, match="only where it begins and ends"):
        log.part(0.0, 1.0)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"kind": "pose"}, "log a: unknown kind 'pose'"),
    ({"t": T[:1], "readings": {"l": [0.0]}}, "log a: t: expected at least two readings"),
    ({"t": T[::-1]}, "log a: t: stamps go back by 0.1 s at row 1"),
    ({"t": np.where(T == 0.2, 0.1, T)}, "log a: t: the stamp of row 2 comes twice"),
    ({"t": T + np.nan}, "log a: t: expected finite numbers"),
    ({"readings": {}}, "log a: readings: expected counters by name"),
    ({"readings": {"l": T[1:]}}, "log a: readings of l: expected 41 numbers"),
    ({"readings": {"l": T + np.inf}}, "log a: readings of l: expected finite numbers"),
    ({"readings": {"l": 1e-4 * T}}, "log a: it stands still: of its counters l went farthest, 0.0004"),
    ({"kind": "positions"}, r"log a: reference: expected numbers of shape \(M, 2\)"),
    ({"kind": "ends"}, r"log a: reference: expected numbers of shape \(2, 3\) or \(2, 2\)"),
    ({"reference": POSES[:, :2]}, r"log a: reference: expected numbers of shape \(M, 3\)"),
    ({"reference": POSES[:1], "reference_t": T[:1]}, "log a: reference: expected at least two samples"),
    ({"reference_t": T[1:]}, "log a: reference_t: expected 41 stamps, got 40"),
    ({"reference_t": np.roll(T, 1)}, "log a: reference_t: stamps go back by 4 s at row 1"),
    ({"reference": np.ones((41, 3))}, "log a: the reference stands still in all samples, while right"),
    ({"reference_t": T + 3.2e8}, r"begin 3.2e\+08 s after the counters' and last 4 s"),
    ({"reference_t": T - 100.0}, "begin 100 s before the counters' and last 4 s"),
    ({"reference_t": 3.95 + T}, "expected two of them at least from 0 to 4 s"),
]


@pytest.mark.parametrize(("others", "words"), REFUSED)
def test_what_no_log_may_be_is_named(others: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        made(**others)
    assert len(str(caught.value)) <= 300


@pytest.mark.parametrize("method", ["closed", "from_csv", "from_bag"])
def test_the_examples_run(method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if method == "from_bag":
        pytest.importorskip("rosbags")
    monkeypatch.chdir(tmp_path)
    text = getattr(nmm.DriveLog, method).__doc__ or ""
    example = doctest.DocTestParser().get_doctest(text, {"nmm": nmm, "np": np}, method, None, None)
    assert example.examples
    told: list[str] = []
    doctest.DocTestRunner().run(example, out=told.append)
    assert not told, "".join(told)


RAD, TICKS, METRE = unit_of("rad", "angle", ""), unit_of("ticks:100", "angle", ""), unit_of("m", "length", "")


def row(k: int) -> str:
    return f"row {k}"


def within_a_turn(values: Any) -> Any:
    return (values + np.pi) % (2 * np.pi) - np.pi


def positive_turn(values: Any) -> Any:
    return values % (2 * np.pi)


@pytest.mark.parametrize("wrapped", [within_a_turn, positive_turn])
@pytest.mark.parametrize("stated", [None, True, 2 * math.pi])
def test_turns_are_counted_on_as_odometry_counts_them(wrapped: Callable[[Any], Any], stated: Any) -> None:
    """The same as `Turns`, reading by reading."""
    angles = np.cumsum(np.concatenate([np.linspace(0.0, 0.7, 100), np.linspace(0.7, -0.7, 200)]))
    read = wrapped(angles)
    found, span = counted_on(read, RAD, stated, "l", "log", row)
    assert span == pytest.approx(2 * math.pi)
    np.testing.assert_allclose(found - found[0], angles - angles[0], atol=1e-9)
    turns = Turns(["l"], ["l"], True, [float(read[0])], "log")
    for reading, counted in zip(read.tolist(), found.tolist(), strict=True):
        counts = turns.after([reading], [math.inf])
        turns.take([reading], counts)
        assert counts[0] == pytest.approx(counted, abs=1e-9)


@pytest.mark.parametrize("bits", [8, 15, 16, 32])
@pytest.mark.parametrize("signed", [False, True])
def test_ticks_of_a_counter_of_so_many_bits_are_counted_on(bits: int, signed: bool) -> None:
    step = 2**bits / 37
    ticks = np.round(np.cumsum(np.concatenate([np.full(90, step), np.full(120, -step)])))
    half = 2 ** (bits - 1) * signed
    read = (ticks + half) % 2**bits - half
    found, span = counted_on(read, unit_of("ticks:10000000000", "angle", ""), None, "l", "log", row)
    assert span == 2**bits
    np.testing.assert_array_equal(found - found[0], ticks - ticks[0])
    found, _ = counted_on(
        read, TICKS, {8: 256.0, 15: 32768.0, 16: 65536.0, 32: 2.0**32}[bits], "l", "log", row
    )
    np.testing.assert_array_equal(found - found[0], ticks - ticks[0])


@pytest.mark.parametrize(
    "values",
    [
        np.linspace(0.0, 90.0, 30),  # 3 rad from row to row, many turns
        np.linspace(0.0, 1.5, 30),
        np.array([0.0, 0.0, 0.0, 1.5, 3.0, 4.5]),
        np.array([0.0, 2.0]),
        np.sin(np.linspace(0.0, 30.0, 400)) * 3.1,  # nearly a turn, to and fro
    ],
)
def test_counters_that_count_turns_stay(values: Any) -> None:
    found, span = counted_on(values, RAD, None, "l", "log", row)
    assert span is None
    np.testing.assert_array_equal(found, values)


DOUBTFUL = [
    # A turn ends, or the wheel went 3.6 rad.
    (within_a_turn(np.arange(20) * 2.7), RAD, None, r"l leaps at row 2: .*wrapped=\{'l': True\}"),
    # It begins anew after 50, which is no power of two.
    (np.arange(200.0) % 50, unit_of("ticks:7", "angle", ""), None, "about 50 ticks"),
    # Set to zero on the way.
    (np.concatenate([np.arange(100) * 0.3, np.arange(50) * 0.3]), RAD, None, "l leaps at row 100"),
    (np.concatenate([np.arange(100) * 0.3, np.arange(50) * 0.3]), METRE, None, "l leaps at row 100"),
    (
        within_a_turn(np.arange(20) * 2.7),
        RAD,
        True,
        "l may have moved by more than half of what it counts to",
    ),
    (np.arange(20) * 0.5, RAD, True, "l: expected readings within 6.28"),
    (np.arange(20) * 0.5, METRE, True, "wrapped: l: expected after how many m it begins anew"),
]


@pytest.mark.parametrize(("values", "unit", "stated", "words"), DOUBTFUL)
def test_what_may_or_may_not_begin_anew_is_refused(values: Any, unit: Any, stated: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        counted_on(values, unit, stated, "l", "log", row)


def test_counters_that_were_said_to_count_on_stay() -> None:
    values = within_a_turn(np.arange(20) * 2.7)
    np.testing.assert_array_equal(counted_on(values, RAD, False, "l", "log", row)[0], values)


def test_what_wrapped_says_of_each_counter() -> None:
    both = ["l", "r"]
    assert stated_for(None, both, "") == {"l": None, "r": None}
    assert stated_for(True, both, "") == {"l": True, "r": True}
    assert stated_for("l", both, "") == stated_for(["l"], both, "") == {"l": True, "r": False}
    assert stated_for({"r": 256}, both, "") == {"l": None, "r": 256.0}
    for wrong, words in (
        ("m", "unknown counter 'm'"),
        ({"l": -1}, "a number above 0"),
        ({"l": "x"}, "numbers"),
    ):
        with pytest.raises(InputError, match=words):
            stated_for(wrong, both, "log")  # type: ignore[arg-type]


WORDS = [
    ("row_cut", {"file": "a.csv"}, {}, "the last line of a.csv lacks its end, and is left out"),
    (
        "rows_left_out",
        {"file": "a.csv", "count": 2, "of": 10, "names": ["l", "r"]},
        {},
        "2 rows of 10 of a.csv left out: no number in l and r",
    ),
    (
        "stamps_twice",
        {"file": "a.csv", "count": 1},
        {"line": 7},
        "1 row of a.csv left out: the next has the same stamp, first in line 7",
    ),
    (
        "turns_counted_on",
        {"names": ["l"]},
        {},
        "l begins anew: counted on (wrapped= says so, or that it counts on itself)",
    ),
    (
        "turns_counted_on",
        {"names": ["l", "r"]},
        {},
        "l and r begin anew: counted on (wrapped= says so, or that they count on themselves)",
    ),
    (
        "counter_leaps",
        {"name": "l", "count": 1, "by": 12.5},
        {"t": 2.5},
        "l goes faster than it can 1 time, first by 12.5 at t = 2.5 s",
    ),
]


@pytest.mark.parametrize(("code", "values", "where", "sentence"), WORDS)
def test_what_a_drive_s_findings_say(code: str, values: Any, where: Any, sentence: str) -> None:
    assert str(nmm.Finding(code, values, where)) == sentence
    assert {one for one, *_ in WORDS} == log_findings.WORDS.keys()
