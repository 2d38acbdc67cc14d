"""Where numba's instructions do not come as nmm expects them, numba's own decorators compute the same."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numba
import numpy as np
import pytest
from places import ROOT

from nmm.base.kernels import compiled, instructions, trial
from nmm.cli.paper.cases import CASES
from nmm.motion.trajectory import Trajectory
from nmm.scenario import Scenario

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")

#: Lines that change numba before nmm is imported, and what nmm then says of it. Names are replaced where nmm
#: looks for them only: numba itself goes on with its own.
WITHOUT = "import numba.core.ccallback, numba.core.{0}; del numba.core.{0}.{1}"
ANOTHER = "import numba.core.ccallback, numba.core.{0} as place; known = place.{1}\n{2}\nplace.{1} = another"
OTHERS = {
    "a name is missing": (WITHOUT.format("codegen", "CodeLibrary"), "'CodeLibrary'"),
    "a function takes other arguments": (
        ANOTHER.format("codegen", "CodeLibrary", "class another(known):\n    def __init__(self): pass"),
        "TypeError",
    ),
    "a method is missing": (
        ANOTHER.format("codegen", "CodeLibrary", "class another(known): create_ir_module = None"),
        "TypeError",
    ),
    "an attribute is missing": (
        ANOTHER.format("registry", "cpu_target", "class another: pass"),
        "AttributeError: type object 'another' has no attribute",
    ),
}

PARTS = """
import json
import numpy as np
from numba import types
from nmm.base.kernels.compiled import caller, compiled, inlined, kernel, checked_by_caller, scratch

NUMBER = types.float64(types.float64)
through = caller(NUMBER)

@inlined
def halved(x):
    return 0.5 * x

@compiled
def root(x, times=1.0):
    if x < 0.0:
        raise ValueError("below zero")
    room = scratch(2)
    room[1] = halved(2.0 * times * x**0.5)
    return room[1]

@kernel(NUMBER)
def twice(x):
    return 2.0 * root(x)

@compiled
def first(x):
    return root(x)

@kernel(NUMBER)
def allocates(x):
    return np.full(3, x).sum()

@compiled
def fourfold(address, x):
    return through(address, x) + root(x, 2.0)

answers = [fourfold(twice.address, 4.0), twice(4.0), checked_by_caller(first, NUMBER)(4.0)]
answers += [fourfold(allocates.address, 4.0), allocates(4.0), halved(3.0)]
try:
    root(-1.0)
except (RuntimeError, ValueError):
    answers.append("an exception")
print(json.dumps(answers))
"""
ANSWERS = [8.0, 4.0, 2.0, 16.0, 12.0, 1.5, "an exception"]

#: The first second, s: 200 samples, among them the initial error's.
SHORT = {"duration": 1.0}
RUNS = f"""
from nmm.cli.paper.cases import CASES
from nmm.scenario import Scenario
for case in CASES:
    for resolver in ("rg", "pg"):
        run = Scenario.load(case.scenario, {SHORT}).with_resolver(resolver).run()
        run.save(f"{{case.number}}{{resolver}}.npz")
"""


def run(code: str, folder: Path, **environment: str) -> tuple[list[str], list[str]]:
    """The lines that a process printed and those on its standard error."""
    (folder / "script.py").write_text(code)
    command = [sys.executable, "script.py"]
    done = subprocess.run(
        command, cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr.splitlines()


def test_instructions_come_as_expected(tmp_path: Path) -> None:
    """Otherwise all other tests measure the wrong path."""
    assert compiled.problem() is None
    assert trial.fault() is None
    assert trial._tried() is None
    for _ in range(2):  # the second time from the disk
        printed, errors = run(PARTS, tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))
        assert json.loads(printed[0]) == ANSWERS
        assert not errors


def test_no_upper_bound_on_numba() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (requirement,) = [line for line in project["dependencies"] if line.startswith("numba")]
    assert "<" not in requirement


def test_one_file_uses_what_numba_does_not_document() -> None:
    package = Path(compiled.__file__).parent.parent
    undocumented = ("numba.core.compiler", "numba.core.codegen", "numba.core.registry", "numba._d")
    users = [
        path.name
        for path in package.rglob("*.py")
        if any(name in path.read_text("utf-8") for name in undocumented)
    ]
    assert users == [Path(instructions.__file__).name]


#: The others are caught as these are.
FEW = ("a name is missing", "a method is missing")


@pytest.mark.parametrize(
    "other",
    [pytest.param(other, marks=() if other in FEW else pytest.mark.thorough) for other in OTHERS],
)
def test_other_insides_are_noticed(other: str, tmp_path: Path) -> None:
    change, expected = OTHERS[other]
    for _ in range(2 if "name" in other else 1):  # the second time from the disk
        printed, (line,) = run(f"{change}\n{PARTS}", tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))
        assert json.loads(printed[0]) == ANSWERS
        assert expected in line
        assert line.startswith("numba 0.")
        assert "njit" in line


def test_a_command_says_it_in_one_line(tmp_path: Path) -> None:
    change, _ = OTHERS["a name is missing"]
    command = "import sys; from nmm.cli import main; sys.argv[1:] = ['info', 'unicycle_2r']; main()"
    printed, lines = run(f"{change}\n{command}", tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert any("unicycle_2r" in line for line in printed)
    (line,) = lines
    assert line.startswith(f"numba {numba.__version__}: ")


@pytest.mark.thorough
def test_the_paper_by_plain_numba(tmp_path: Path) -> None:
    """The eight runs, every number of every sample.

    LLVM optimises nothing, which takes half the time, and leaves numba unused names for which it keeps some
    functions in memory only: what another numba could change is how functions are typed and called.
    """
    change, _ = OTHERS["a name is missing"]
    own = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONWARNINGS": "ignore:Cannot cache"}
    _, lines = run(f"{change}\n{RUNS}", tmp_path, NUMBA_OPT="0", **own)
    assert len(lines) == 1
    for case in CASES:
        for resolver in ("rg", "pg"):
            expected = Scenario.load(case.scenario, SHORT).with_resolver(resolver).run()
            assert len(expected) == 201
            found = Trajectory.load(tmp_path / f"{case.number}{resolver}.npz")
            for name in ("q", "u", "r", "error", "objective", "sigma_min", "partition", "residual", "scale"):
                np.testing.assert_allclose(
                    getattr(found, name), getattr(expected, name), rtol=1e-12, atol=1e-12, err_msg=name
                )
