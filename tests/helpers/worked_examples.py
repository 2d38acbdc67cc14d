"""The files that docs/architecture.md has to copy, and, as a plugin of pytest, all of them registered.

    PYTHONPATH=tests/helpers python -m pytest -p worked_examples tests/model/test_robot_grid.py

runs a grid with them: it must ask of a new kind no more than the kind declares.
"""

from __future__ import annotations

import atexit
import shutil
import sys
import tempfile
from pathlib import Path

from places import ROOT

FOLDER = ROOT / "docs" / "own_kinds"
FILES = ("slope", "damped", "used")


def write_examples(folder: Path) -> None:
    """Copies, where a reader has them: beside a script."""
    for name in FILES:
        shutil.copy(FOLDER / f"{name}.py", folder)


def pytest_configure() -> None:
    """One line each in `nmm.base.kinds`, and an example of the function."""
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    write_examples(Path(folder))
    sys.path.insert(0, folder)
    import function_grid
    from damped import DampedLeastSquares
    from slope import Slope
    from transposed import JacobianTranspose, LeastNorm

    from nmm.base.kinds import RESOLVERS, TASKS

    TASKS["slope"] = Slope
    entry = function_grid.Entry("slope", Slope("base_footprint", "ee"), function_grid.SPATIAL)
    function_grid.ENTRIES += (entry,)
    for kind in (DampedLeastSquares, JacobianTranspose, LeastNorm):
        RESOLVERS[kind.name] = kind
