"""How an answer is called, compared and spoken of: what the exercises' checks (check.py) are made of."""

from __future__ import annotations

import functools
import traceback
from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np

Matrix = np.ndarray
_MARKS = {"right": "✓", "not right": "✗", "not yet": "…"}
_told: dict[str, str] = {}
#: Answers by their id, with the exercise and its verdict.
_judged: dict[int, tuple[object, str, str]] = {}


class NotYet(Exception):
    """There is no answer yet."""


class Wrong(Exception):
    """An answer that is not right; the words say in what."""


def exercise(judge: Callable[..., str]) -> Callable[..., None]:
    """A check that prints its verdict: `judge` returns words for a right answer, or raises the others."""

    @functools.wraps(judge)
    def check(*answers: object) -> None:
        try:
            verdict, words = "right", judge(*answers)
        except NotYet as told:
            verdict, words = "not yet", str(told)
        except Wrong as told:
            verdict, words = "not right", str(told)
        except Exception as error:  # a student's slip that no check foresaw is no traceback either
            verdict, words = "not right", f"the check stops with {type(error).__name__}: {error}"
        if verdict == "not right" and (earlier := _earlier(answers[0], judge.__name__)):
            verdict, words = "not yet", earlier
        _told[judge.__name__] = verdict
        _judged.update({id(answer): (answer, judge.__name__, verdict) for answer in answers[:1]})
        print(f"{_MARKS[verdict]} {verdict}: {words}")

    return check


def _earlier(function: object, judged: str) -> str:
    """Which answer of an earlier exercise, not right itself, a function uses, in words; "" for none."""
    codes = [getattr(function, "__code__", None)]
    for code in codes:
        for name in code.co_names if code is not None else ():
            found = _judged.get(id(getattr(function, "__globals__", {}).get(name)))
            if found is not None and found[1] != judged and found[2] != "right":
                return f"{named(function)} uses your {name}, which is not right yet (check.{found[1]})"
        codes += [inner for inner in getattr(code, "co_consts", ()) if hasattr(inner, "co_names")]
    return ""


def in_degrees(angle: float) -> str:
    """How an angle that is given in degrees is written, in words."""
    share = Fraction(angle / 180).limit_denominator(360)
    pi = {1: "pi", -1: "-pi"}.get(share.numerator, f"{share.numerator} * pi")
    over = "" if share.denominator == 1 else f" / {share.denominator}"
    return f"{angle:g} is in degrees: write {pi}{over}"


def ready(*exercises: str) -> bool:
    """Whether these exercises are right; if not, it says which the cell waits for."""
    waiting = [name for name in exercises if _told.get(name) != "right"]
    if waiting:
        print(f"… not yet: this cell waits for {', '.join(waiting)}")
    return not waiting


def score() -> None:
    """The exercises of this notebook that were checked, and how each stands."""
    right = sum(verdict == "right" for verdict in _told.values())
    print(f"{right} of {len(_told)} right")
    for name, verdict in _told.items():
        print(f"  {_MARKS[verdict]} {name:20} {verdict}")


def numbers(given: object, name: str) -> Matrix:
    """What a student gave, as an array of finite numbers."""
    if given is None:
        raise NotYet(f"{name} gives nothing (if it is written: does it end with return?)")
    if any(entry is ... for entry in np.ravel(np.asarray(given, dtype=object))):
        raise NotYet(f"{name} has dots to fill in")
    try:
        found = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise Wrong(f"{name}: expected numbers in rows of one length, got {given!r}") from None
    if not np.all(np.isfinite(found)):
        raise Wrong(f"{name}: a number is not finite")
    return found


def named(function: object) -> str:
    """What its author calls it."""
    return str(getattr(function, "__name__", "the function"))


def called(function: object, *arguments: object) -> Matrix:
    """What a student's function gives; whatever stops it is told in a sentence."""
    if function is None or function is ...:
        raise NotYet("there is no function yet")
    if not callable(function):
        raise Wrong(f"expected the function itself, without (q), got {type(function).__name__}")
    name = named(function)
    own = [given.copy() if isinstance(given, np.ndarray) else given for given in arguments]
    try:
        return numbers(function(*own), name)
    except NotImplementedError:
        raise NotYet(f"{name} is not written yet") from None
    except (NotYet, Wrong):
        raise
    except Exception as error:
        if "ellipsis" in str(error).lower():
            raise NotYet(f"{name} has dots to fill in") from None
        code = getattr(function, "__code__", None)
        frames = traceback.extract_tb(error.__traceback__)
        at = [frame.line for frame in frames if code is not None and frame.filename == code.co_filename]
        line = f", at: {at[-1]}" if at and at[-1] else ""
        raise Wrong(f"{name} stops with {type(error).__name__}: {error}{line}") from None


def one_number(function: object, *arguments: object) -> float:
    """What a student's function gives, which is to be one number."""
    given = called(function, *arguments)
    if given.size != 1:
        raise Wrong(f"{named(function)}: expected one number, got {given.size}")
    return float(given.ravel()[0])


def shaped(
    name: str, given: Matrix, rows: Sequence[str], columns: Sequence[str] = (), hint: str = ""
) -> None:
    """`Wrong`, if an array has not these rows (and columns); the hint is for another number of columns."""
    wanted = (len(rows), len(columns)) if columns else (len(rows),)
    if given.shape == wanted:
        return
    words = f"{len(rows)} numbers ({', '.join(rows)})"
    if columns:
        words = f"{len(rows)} rows ({', '.join(rows)}) and {len(columns)} columns ({', '.join(columns)})"
    if columns and given.shape == wanted[::-1]:
        hint = "it is transposed"
    elif given.size == np.prod(wanted):
        hint = "as many numbers as there should be, in another shape"
    got = " x ".join(map(str, given.shape)) or "one number"
    raise Wrong(f"{name}: expected {words}, got {got}" + (f": {hint}" if hint else ""))


def compared(
    function: Callable[[Matrix], object],
    right: Callable[[Matrix], Matrix],
    samples: Matrix,
    coordinates: Sequence[str],
    rows: Sequence[str],
    columns: Sequence[str] = (),
    hint: str = "",
) -> None:
    """`Wrong`, if a function of q differs from the right one; what kind of slip it is, where one can tell."""
    name = named(function)

    def table(of: Callable[[Matrix], object], at: Matrix) -> Matrix:
        return np.array([np.reshape(of(q), (len(rows), -1)) for q in at])

    for q in samples:
        shaped(name, called(function, q), rows, columns, hint)
    given, wanted = table(lambda q: called(function, q), samples), table(right, samples)
    off = np.any(abs(given - wanted) > 1e-9, axis=0)
    if not off.any():
        return
    angles = np.array([coordinate not in ("x", "y") for coordinate in coordinates])
    for factor in (np.pi / 180, 180 / np.pi):
        if np.allclose(given, table(right, np.where(angles, factor * samples, samples)), atol=1e-9):
            raise Wrong(f"{name}: degrees are mixed in: all angles here are radians")
    for j, column in enumerate(columns):
        same = [k for k in range(len(columns)) if np.allclose(given[:, :, j], wanted[:, :, k], atol=1e-9)]
        if same and j not in same and off[:, j].any():
            raise Wrong(f"{name}: column {column} is what belongs in column {columns[same[0]]}")
    factor = float(np.sum(given[:, off] * wanted[:, off]) / np.sum(wanted[:, off] ** 2 + 1e-300))
    if np.allclose(given[:, off], factor * wanted[:, off], atol=1e-9):
        what = {-1.0: "has the wrong sign", 0.0: "is 0"}.get(
            round(factor, 9), f"is {factor:.3g} times what it should be"
        )
        raise Wrong(f"{name}: {_places(off, rows, columns)} {what}, the rest is right")
    for i in np.flatnonzero(angles):
        at = samples.copy()
        at[:, i] = 0.0
        if np.allclose(table(lambda q: called(function, q), at), table(right, at), atol=1e-9):
            where = f"right where {coordinates[i]} = 0, and only there"
            raise Wrong(f"{name}: {_places(off, rows, columns)}: {where}. How does {coordinates[i]} enter?")
    worst = samples[np.argmax(abs(given - wanted).max(axis=(1, 2)))]
    raise Wrong(f"{name}: {_places(off, rows, columns)} not right, for example at q = {worst.round(2)}")


def _places(off: Matrix, rows: Sequence[str], columns: Sequence[str]) -> str:
    """The entries that are off, in words: whole columns, or rows of columns."""
    if not columns:
        return ", ".join(np.array(rows)[off[:, 0]])
    parts = []
    for j in np.flatnonzero(off.any(axis=0)):
        some = "" if off[:, j].all() else f" (row {', '.join(np.array(rows)[off[:, j]])})"
        parts.append(f"column {columns[j]}{some}")
    return ", ".join(parts)
