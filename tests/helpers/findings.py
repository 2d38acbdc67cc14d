"""What tests ask of findings and errors: codes, values, fields (words: test_findings.py, test_errors.py)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import nmm
from nmm import Finding
from nmm.base.errors import InputError, NmmError, RobotError

#: A code, with some of the values and of where.
Expected = tuple[str, Mapping[str, Any]]


def holds(finding: Finding, code: str, **given: Any) -> bool:
    """Whether it has that code, and those values or places."""
    has = {**finding.where, **finding.values}
    return finding.code == code and all(key in has and has[key] == value for key, value in given.items())


def of_code(findings: Iterable[Finding], code: str) -> list[Finding]:
    """Those of one code."""
    return [finding for finding in findings if finding.code == code]


def assert_found(findings: Iterable[Finding], *expected: Expected) -> None:
    """That just these were found, in this order."""
    found = list(findings)
    assert [one.code for one in found] == [code for code, _ in expected]
    for one, (code, given) in zip(found, expected, strict=True):
        assert holds(one, code, **given), (one, given)


@contextmanager
def refused_for(*expected: Expected) -> Iterator[None]:
    """The block raises a `RobotError` about a file in which just these were found."""
    with pytest.raises(RobotError) as caught:
        yield
    assert_found(caught.value.findings, *expected)


def codes(run: nmm.Trajectory) -> set[str]:
    """The codes of all that a run found."""
    return {one.code for one in run.findings}


def every(run: nmm.Trajectory, code: str) -> list[nmm.Finding]:
    """A run's findings of a code, those of the message first."""
    return of_code(run.findings, code)


def the(run: nmm.Trajectory, code: str) -> nmm.Finding:
    """A run's one finding of a code."""
    (one,) = every(run, code)
    return one


def why(run: nmm.Trajectory) -> list[str]:
    """The codes of a run's message."""
    return [one.code for one in run.verdict.reasons]


@contextmanager
def refused(
    where: str | None = None, *, kind: type[NmmError] = InputError, **fields: Any
) -> Iterator[pytest.ExceptionInfo[NmmError]]:
    """The block raises an error of the kind, with the fields that `carries` looks for."""
    with pytest.raises(kind) as caught:
        yield caught
    carries(caught.value, where, **fields)


def carries(error: BaseException, where: str | None = None, **fields: Any) -> None:
    """The error is about `where`, or about that part of it; `got` equals its own, `available` is among it."""
    assert isinstance(error, NmmError)
    if where is not None:
        assert f": {error.where}".endswith((f": {where}", f"/{where}")), repr(error.where)
    for name, value in fields.items():
        came = getattr(error, name)
        if name == "available":
            assert {*value} <= {*came}
        elif isinstance(value, list):  # of one length or several
            np.testing.assert_equal(came, value)
        else:
            np.testing.assert_array_equal(came, value)
    assert "\n" not in str(error)
