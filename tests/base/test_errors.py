"""What errors carry, and the one line that is made of it."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from findings import refused
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import nmm
from nmm.base.arrays import counted, increasing, infinite, matrix, nonzero_vector, positive, scalar, vector
from nmm.base.errors import (
    MOST,
    NOTHING,
    InputError,
    NmmError,
    RobotError,
    RunError,
    ScenarioError,
    Setting,
    expect,
    expect_kind,
    expect_known,
    few,
    no_such,
    one_or_several,
    shown,
)
from nmm.scenario.keys import KeyedError

JOINTS = [f"joint_{i}" for i in range(300)]


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"what": "the file is missing"}, "the file is missing"),
        ({"where": "dt", "expected": "a number above 0", "got": 0.0}, "dt: expected a number above 0, got 0"),
        ({"expected": "a Task", "got": None}, "expected a Task, got None"),
        ({"expected": "at least one row"}, "expected at least one row"),
        (
            {"where": "task", "what": "it is a list", "expected": "an index", "got": "2"},
            "task: it is a list; expected an index, got '2'",
        ),
        ({"what": "unknown frame 'a'", "available": ["b", "c"]}, "unknown frame 'a'; available: b, c"),
        ({"where": "joints", "what": "there are", "available": []}, "joints: there are; available: none"),
    ],
)
def test_the_text_is_made_of_the_fields(fields: dict[str, Any], text: str) -> None:
    assert str(InputError(**fields)) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1 + 0.2, "0.3"),
        (np.float64(1e-300), "1e-300"),
        (np.int64(3), "3"),
        (np.bool_(True), "True"),
        (np.array(2.5), "2.5"),
        (np.array([1.0, np.nan]), "[1, nan]"),
        (np.eye(2), "shape (2, 2): 1, 0, 0, 1"),
        (np.zeros((40, 3)), "shape (40, 3): 0, 0, 0, 0, 0, 0, …"),
        (np.arange(100), "shape (100,): 0, 1, 2, 3, 4, 5, …"),
        (np.zeros((0, 3)), "shape (0, 3)"),
        ((np.array([0.0]), [1.0, 2]), "([0], [1, 2])"),
        ("two\nlines", r"'two\nlines'"),
        ("x" * 1000, "'" + "x" * 58 + "…"),
        (object, "<class 'object'>"),
    ],
)
def test_what_came_is_shown_short(value: object, text: str) -> None:
    assert shown(value) == text


def test_a_list_that_holds_itself_is_shown() -> None:
    itself: list[object] = []
    itself.append(itself)
    assert shown(itself) == "[[[[[...]]]]]"
    assert shown([[0.12345678]]) == "[[0.123457]]"


def test_a_stranger_s_repr_may_raise() -> None:
    class Rude:
        def __repr__(self) -> str:
            raise RuntimeError

    assert str(InputError(expected="a number", got=Rude())) == "expected a number, got Rude"


def test_scenarios_show_values_as_yaml_has_them() -> None:
    assert str(ScenarioError(expected="a number", got=None)).endswith("got nothing (null)")
    assert str(ScenarioError(expected="a number", got=True)).endswith("got true")


def test_ten_near_names_and_a_count() -> None:
    """A robot with 300 joints printed 30,000 characters."""
    error = no_such("joint", "joint_217x", JOINTS, "robot r")
    assert error.available == tuple(JOINTS)
    assert error.got == "joint_217x"
    head, _, listing = str(error).partition("; available: ")
    assert head == "robot r: unknown joint 'joint_217x' (did you mean 'joint_217'?)"
    assert listing.startswith("joint_217, ")
    assert listing.endswith(" and 290 more")
    assert listing.count(", ") == 9
    assert few(JOINTS[:10]) == ", ".join(JOINTS[:10])
    assert few([]) == "none"
    wrong = no_such("frame", "eee", ["ee", "link1"])
    assert str(wrong) == "unknown frame 'eee' (did you mean 'ee'?); available: ee, link1"


#: Names as a hostile file may hold them.
NAMES = st.text(max_size=3000) | st.builds(lambda one, n: one * n, st.text(max_size=3), st.integers(0, 2000))
ERRORS = st.sampled_from([InputError, RobotError, ScenarioError, RunError])


@settings(  # the same cases each time, as long as they take: for the gate
    max_examples=50,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
@given(ERRORS, NAMES, NAMES, NAMES, NAMES | st.floats() | st.none(), st.none() | st.lists(NAMES, max_size=40))
def test_messages_are_one_line_of_at_most_300_characters(
    kind: type[NmmError], what: str, where: str, expected: str, got: object, available: list[str] | None
) -> None:
    error = kind(what, where=where, expected=expected, got=got, available=available)
    for text in (str(error), str(error.at(where)), str(no_such(what, got, available or [], where))):
        assert len(text) <= MOST
        assert text.isprintable()
    assert (error.what, error.where, error.expected, error.got) == (
        what,
        where,
        expected,
        pytest.approx(got, nan_ok=True),
    )
    if available and len(available) > 20:
        assert "more" in str(error) or f"{len(available)} names" in str(error)


def test_the_beginning_and_the_count_stay() -> None:
    text = str(InputError("w" * 1000, where="file: key", available=["z" * 500] * 20))
    assert text.startswith("file: key: www")
    assert text.endswith("…; available: 20 names")


@pytest.mark.parametrize(
    "error",
    [
        InputError("a", where="b", expected="c", got=2.5, available=["d"]),
        InputError("nothing came"),
        RobotError("x" * 1000),
        nmm.SingularError("lost rank", where="at t = 2 s"),
        KeyedError(("task", 0), "unknown", got=3),
        InputError(expected="a key", got=3, mend=Setting(("resolver", "alpha"), "5"), unknown="key"),
    ],
)
@pytest.mark.parametrize("through", [lambda error: pickle.loads(pickle.dumps(error)), copy.deepcopy])
def test_errors_cross_processes(error: NmmError, through: Callable[[NmmError], NmmError]) -> None:
    other = through(error)
    assert type(other) is type(error)
    assert str(other) == str(error)
    assert vars(other) == vars(error)


def test_what_no_process_can_send_is_sent_as_text() -> None:
    error = InputError(where="law", expected="a resolver", got=lambda: 3)
    other = pickle.loads(pickle.dumps(error))
    assert str(other) == str(error)
    assert other.got == shown(error.got)
    assert pickle.loads(pickle.dumps(InputError("a"))).got is NOTHING


def test_an_error_further_out_keeps_its_fields() -> None:
    inner = no_such("frame", "hand", ["ee"], "task")
    outer = inner.at("file.yaml:3", ScenarioError)
    assert type(outer) is ScenarioError
    assert outer.where == "file.yaml:3: task"
    assert (outer.got, outer.available, outer.what) == (inner.got, inner.available, inner.what)
    assert outer.unknown == inner.unknown == "frame"
    asked = InputError(expected="a key", mend=Setting(("resolver", "alpha"), "5"))
    assert asked.at("a").mend == asked.mend
    other = asked.placed("a", mend="--resolvers pg:alpha=5")
    assert (other.where, other.mend, other.expected) == ("a", "--resolvers pg:alpha=5", asked.expected)
    assert KeyedError(("task",), "a").at("b").place == ("task",)
    assert InputError("a").at("b").where == "b"
    assert inner.placed("").where == ""


@pytest.mark.parametrize(
    ("check", "where", "got"),
    [
        (lambda: scalar("one", "a"), "a", "one"),
        (lambda: scalar(True, "a"), "a", True),
        (lambda: scalar([1.0], "a"), "a", [1.0]),
        (lambda: scalar(np.nan, "a"), "a", np.nan),
        (lambda: positive(0, "a"), "a", 0.0),
        (lambda: scalar(1.0, "a", above=0.0, below=1.0), "a", 1.0),
        (lambda: scalar(-1e-9, "a", least=0.0, most=1.0), "a", -1e-9),
        (lambda: counted(1.5, "a"), "a", 1.5),
        (lambda: counted(True, "a"), "a", True),
        (lambda: counted(-1, "a", least=0), "a", -1),
        (lambda: vector([1, 2], 3, "a"), "a", [1, 2]),
        (lambda: vector([[1]], None, "a"), "a", [[1]]),
        (lambda: vector([1], (2, 3), "a"), "a", [1]),
        (lambda: nonzero_vector([0, 0], None, "a"), "a", [0, 0]),
        (lambda: infinite([np.nan], "a", "numbers"), "a", [np.nan]),
        (lambda: infinite([[1]], "a", "numbers"), "a", [[1]]),
        (lambda: matrix([1, 2], (2, 2), "a"), "a", [1, 2]),
        (lambda: increasing(np.array([0.0, 0.0]), "a"), "a", [0, 0]),
        (lambda: expect(False, "a", "b", 3), "a", 3),
        (lambda: expect_kind(3, str, "a", "text"), "a", 3),
        (lambda: expect_known("name", 3, [1, 2], "a"), "a", 3),
        (lambda: one_or_several([1, "2"], int, "a", "numbers"), "a", [1, "2"]),
        (lambda: one_or_several(2.0, int, "a", "numbers"), "a", 2.0),
    ],
)
def test_checks_name_what_came(check: Callable[[], object], where: str, got: object) -> None:
    with refused(where, got=got) as caught:
        check()
    assert caught.value.where == where


@pytest.mark.parametrize(
    ("bounds", "expected"),
    [
        ({"above": 0.0}, "a number above 0"),
        ({"least": 0.0}, "a number from 0"),
        ({"above": 0.0, "below": 0.5}, "a number above 0 and below 0.5"),
        ({"least": 0.0, "most": 1.0}, "a number from 0 to 1"),
    ],
)
def test_bounds_in_words(bounds: dict[str, float], expected: str) -> None:
    with refused("a", expected=expected, got=-1.0):
        scalar(-1.0, "a", **bounds)


def test_what_fits_comes_back() -> None:
    assert scalar(0.5, "a", least=0.0, most=1.0) == 0.5
    assert scalar(np.int64(2), "a", above=1.0) == 2.0
    assert infinite(np.inf, "a", "").tolist() == [np.inf]
    assert one_or_several(1, int, "a", "") == (1,)
    assert one_or_several([1, 2], int, "a", "") == (1, 2)
