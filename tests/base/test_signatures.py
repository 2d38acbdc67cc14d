"""Types of compiled code without numba: each is one object, and numba's by another name."""

from __future__ import annotations

import copy
import pickle
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba import types

from nmm.base.kernels.compiled import _type_of
from nmm.base.kernels.numba_types import from_numba, to_numba, type_of
from nmm.base.kernels.signatures import Array, Tuple, boolean, float64, int64, signature_of, void


class Pair(NamedTuple):
    x: Any
    y: Any


PAIRS = [
    (float64, types.float64),
    (boolean, types.boolean),
    (void, types.void),
    (float64[::1], types.float64[::1]),
    (int64[:, :], types.int64[:, :]),
    (float64[:, :, ::1], types.float64[:, :, ::1]),
    (Array(float64, 2, "F"), types.float64[::1, :]),
    (Array(float64, 1, "C", False), types.Array(types.float64, 1, "C", readonly=True)),
    (Tuple(()), types.Tuple(())),
    (Tuple((int64, int64)), types.UniTuple(types.int64, 2)),
    (Tuple((int64, float64[::1])), types.Tuple((types.int64, types.float64[::1]))),
    (Tuple((int64, float64[::1]), Pair), types.NamedTuple((types.int64, types.float64[::1]), Pair)),
    (Tuple((float64, float64), Pair), types.NamedUniTuple(types.float64, 2, Pair)),
]


@pytest.mark.parametrize(("own", "numbas"), PAIRS, ids=str)
def test_each_is_numbas_by_another_name(own: Any, numbas: Any) -> None:
    assert to_numba(own) == numbas
    assert from_numba(numbas) is own
    assert str(own) == str(numbas)
    for copied in (pickle.loads(pickle.dumps(own)), copy.deepcopy(own)):
        assert copied is own


def test_signatures_of_numba_are_taken_too() -> None:
    own, numbas = void(float64[::1], int64), types.void(types.float64[::1], types.int64)
    assert signature_of(numbas) == own == signature_of(own)
    assert to_numba(own) == numbas


VALUES = [
    *(1.5, 3, True, None, np.float64(1.0), np.int64(2), np.bool_(True)),
    *(np.zeros(3), np.zeros((2, 3)).T, np.zeros((4, 4))[::2, ::2], np.zeros(3, bool), np.zeros((2, 0))),
    *(
        (1, 2.0),
        (),
        Pair(1, np.zeros(2)),
        np.broadcast_to(1.0, (2, 2)),
        np.zeros(2, np.float32),
        np.float32(1),
    ),
    *(np.zeros(2, np.float32), np.float32(1), 2j),
]


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_types_of_values_are_numbas(value: Any) -> None:
    assert _type_of(value) is type_of(value)
    assert to_numba(_type_of(value)) == numba.typeof(value)
