"""The tables that a command prints, read again."""

from __future__ import annotations

import re

import numpy as np
import pytest
from command_line import Result

from nmm.analysis import SingularityReport


def table(result: Result, first: str) -> list[dict[str, str]]:
    """The rows of the table whose first column has that name; columns are parted by two spaces or more."""
    lines = result.out.splitlines()
    start = next(i for i, line in enumerate(lines) if re.split(r"\s{2,}", line.strip())[0] == first)
    names = re.split(r"\s{2,}", lines[start].strip())
    found = []
    for line in lines[start + 1 :]:
        cells = re.split(r"\s{2,}", line.strip())
        if len(cells) != len(names):
            break
        found.append(dict(zip(names, cells, strict=True)))
    return found


def printed(text: str) -> float:
    return float(text.removesuffix(" s"))


def expect_report(result: Result, report: SingularityReport) -> None:
    """Every number of the tables, to the four digits that are printed."""
    assert (result.status, result.err) == (0, "")
    J = table(result, "J")
    assert [row["J"] for row in J] == list(report.rows)
    assert tuple(J[0])[1:] == report.inputs
    found = [[printed(row[name]) for name in report.inputs] for row in J]
    np.testing.assert_allclose(found, report.J, rtol=1e-3, atol=1e-9)
    for row in table(result, "part"):
        part = report.parts[row["part"].split(" ")[0]]
        assert row["rank"] == f"{part.rank} of {len(report.rows)}"
        assert printed(row["σ_min"]) == pytest.approx(part.sigma_min, rel=1e-3, abs=1e-9)
        assert printed(row["condition"]) == pytest.approx(part.condition, rel=1e-3)
        assert (row["cannot move"] == "-") == part.does_task
