"""Records in memory: what goes in comes out by its name, in Python and compiled, as views of two blocks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.cache import cache_folder, file_of
from nmm.base.kernels.compiled import compiled
from nmm.base.kernels.record_layout import (
    Cell,
    IntegerCell,
    IntegerMatrix,
    IntegerVector,
    Matrices,
    Matrix,
    Memory,
    Tensors,
    Vector,
    header_length,
    views,
)
from nmm.base.kernels.records import Rows
from nmm.control.functions.references import Circle


class Inner(NamedTuple):
    x: Vector
    residual: Cell


class Outer(NamedTuple):
    A: Matrix
    kernel: int
    inner: Inner
    table: IntegerMatrix
    status: IntegerCell
    empty: Tensors
    again: Inner
    B: Matrices
    places: IntegerVector


def example(rng: np.random.Generator, s: int) -> Outer:
    inner = [Inner(rng.normal(size=s + k), np.array(rng.normal())) for k in range(2)]
    table, places = rng.integers(-9, 9, size=(s, 3)), rng.integers(-9, 9, size=2)
    B = rng.normal(size=(2, s, 3))
    return Outer(
        rng.normal(size=(s, 4)),
        17 + s,
        inner[0],
        table,
        np.array(s),
        np.zeros((0, 6, s, s)),
        inner[1],
        B,
        places,
    )


def flat(record: tuple[Any, ...]) -> list[Any]:
    return [part for value in record for part in (flat(value) if isinstance(value, tuple) else [value])]


@compiled
def written(integers: Integers, floats: Array, place: int) -> int:
    """Every field read or written in compiled code, in a way that tells one from another."""
    outer = views(Outer, integers, floats, place)
    outer.A[outer.A.shape[0] - 1, 3] += outer.inner.residual[()] + outer.again.x[0]
    outer.again.residual[()] = outer.B[1, outer.B.shape[1] - 1, 2] + outer.empty.shape[3]
    outer.status[()] += outer.table[outer.table.shape[0] - 1, 2]
    outer.inner.x[1] = float(outer.places[1])
    return outer.kernel + outer.empty.shape[0]


@pytest.mark.parametrize("form", [written, getattr(written, "py_func", written)], ids=["compiled", "plain"])
def test_records_come_out_as_they_went_in(form: Any, rng: np.random.Generator) -> None:
    given = [example(rng, s) for s in (2, 5, 3)]
    memory = Memory()
    places = [memory.add(record) for record in given]
    assert places == [0, header_length(Outer), 2 * header_length(Outer)], "a place depends on no shape"
    blocks = memory.blocks()
    for record, place in zip(given, places, strict=True):
        for before, found in zip(flat(record), flat(views(Outer, *blocks, place)), strict=True):
            assert np.shape(found) == np.shape(before)
            np.testing.assert_array_equal(found, before)
    held = views(Outer, *blocks, places[1])
    before = Outer(*(np.copy(part) if isinstance(part, np.ndarray) else part for part in held))
    inner, again = (Inner(*map(np.copy, part)) for part in (held.inner, held.again))
    others = [
        flat(views(Outer, *(block.copy() for block in blocks), place)) for place in (places[0], places[2])
    ]
    assert form(*blocks, places[1]) == 22
    assert held.A[-1, 3] == before.A[-1, 3] + inner.residual + again.x[0]
    assert held.again.residual == before.B[1, -1, 2] + 5
    assert held.status == before.status + before.table[-1, 2]
    assert held.inner.x[1] == before.places[1]
    changed = sum(
        int(np.sum(a != b))
        for a, b in zip(flat(held), flat(before._replace(inner=inner, again=again)), strict=True)
    )
    assert changed == 4, "nothing else was written"
    for place, same in zip((places[0], places[2]), others, strict=True):
        for a, b in zip(flat(views(Outer, *blocks, place)), same, strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_blocks_hold_copies(rng: np.random.Generator) -> None:
    given = Inner(np.ones(3), np.array(2.0))
    memory = Memory()
    memory.add(given)
    views(Inner, *memory.blocks(), 0).x[:] = 0.0
    np.testing.assert_array_equal(given.x, 1.0)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(TypeError, match=r"Inner\.x: expected 1 extents, got \(2, 2\)"):
        Memory().add(Inner(np.zeros((2, 2)), np.array(0.0)))

    with pytest.raises(TypeError, match="bad: expected a kind of array, int or a record"):
        header_length(Unknown)
    with pytest.raises(TypeError, match="handed over, not laid out"):
        header_length(Handed)
    assert header_length(Rows) == 2 + 2 + 3


class Unknown(NamedTuple):
    bad: str


class Handed(NamedTuple):
    t: float


def test_the_folder_of_compiled_kernels_is_nmms_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """Other users of numba in the process keep theirs, whatever is set, and nmm keeps its own."""
    kernel = Circle([0, 0], 1, 1).stages(None)[0].kernel  # type: ignore[arg-type]
    # By its place in the package: where that is installed makes no difference.
    assert str(file_of(kernel.plain, None).parent) == f"{cache_folder()}/control/functions/references"
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    theirs, ours = numba.njit(cache=True)(flat), compiled(flat)
    assert str(tmp_path) == numba.config.CACHE_DIR
    assert theirs.stats.cache_path.startswith(str(tmp_path))
    assert file_of(ours.py_func, None).is_relative_to(cache_folder())
