"""Where numba's insides are not as nmm knows them, plain `njit` computes the same, and one line says so."""

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

from nmm.base.kernels import compiled, numba_internals
from nmm.cli.paper.cases import CASES
from nmm.motion.trajectory import Trajectory
from nmm.scenario import Scenario

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")

#: Lines that make numba another one before nmm is imported, and what nmm then says of it. The names are taken
#: from where nmm looks for them only: numba itself goes on with its own.
NEXT_VERSION = "import numba; numba.__version__ = '0.69.1'"
WITHOUT = "import numba.core.compiler, numba.core.{0}; del numba.core.{0}.{1}"
ANOTHER = "import numba.core.ccallback, numba.core.{0} as place; known = place.{1}\n{2}\nplace.{1} = another"
OTHERS = {
    "a version not tested": (NEXT_VERSION, "none of the versions tested (0.68)"),
    "a name is missing": (WITHOUT.format("codegen", "JITCodeLibrary"), "'JITCodeLibrary'"),
    "a pass is missing": (
        WITHOUT.format("untyped_passes", "WithLifting"),
        "cannot import name 'WithLifting'",
    ),
    "a function takes other arguments": (
        ANOTHER.format("environment", "lookup_environment", "def another(): return known()"),
        "TypeError",
    ),
    "a method is missing": (
        ANOTHER.format("codegen", "JITCodeLibrary", "class another(known): _get_module_for_linking = None"),
        "TypeError",
    ),
    "an attribute is missing": (
        ANOTHER.format("runtime", "rtsys", "class another: pass"),
        "AttributeError: type object 'another' has no attribute 'initialize'",
    ),
    "a key is made otherwise": (
        ANOTHER.format("caching", "FunctionCache", "class another(known): _index_key = None"),
        "TypeError",
    ),
    "what was written is not found": (
        ANOTHER.format("compiler", "CompileResult", "class another(known): _rebuild = None"),
        "what is on disk is not read",
    ),
    "parts are not linked in": (
        ANOTHER.format(
            "registry", "CPUDispatcher", "class another(known):\n    def compile(self, sig): pass"
        ),
        "KeyError",
    ),
}

PARTS = """
import json
from numba import types
from nmm.base.kernels.compiled import call_platform, caller, compiled, kernel, checked_by_caller, scratch

NUMBER = types.float64(types.float64)
through = caller(NUMBER)

@compiled
def root(x):
    if x < 0.0:
        raise ValueError("below zero")
    room = scratch(2)
    room[1] = x**0.5
    return room[1]

@kernel(NUMBER)
def twice(x):
    return 2.0 * root(x)

@compiled
def fourfold(address, x):
    return through(address, x) + 2.0 * root(x)

answers = [fourfold(twice.address, 4.0), twice(4.0), checked_by_caller(root, NUMBER)(4.0)]
try:
    root(-1.0)
except ValueError as error:
    answers.append(error.args)
print(json.dumps(answers))
"""

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


def test_the_insides_are_those_that_nmm_knows() -> None:
    """Otherwise all other tests measure the wrong one."""
    assert compiled.problem() is None
    assert numba_internals.tried(compiled._whole_with_parts, compiled.caller) is None


def test_the_versions_tested_are_those_that_are_installed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (requirement,) = [one for one in project["dependencies"] if one.startswith("numba")]
    (tested,) = numba_internals.TESTED
    major, minor = map(int, tested.split("."))
    assert requirement == f"numba>={tested},<{major}.{minor + 1}"


@pytest.mark.parametrize("other", OTHERS)
def test_other_insides_are_noticed(other: str, tmp_path: Path) -> None:
    change, expected = OTHERS[other]
    for _ in range(2 if "version" in other else 1):  # the second time from the disk
        printed, (line,) = run(f"{change}\n{PARTS}", tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))
        assert json.loads(printed[0]) == [8.0, 4.0, 2.0, ["below zero"]]
        assert expected in line
        assert line.startswith("numba 0.6")
        assert "njit" in line


def test_a_command_says_it_in_one_line(tmp_path: Path) -> None:
    command = "import sys; from nmm.cli import main; sys.argv[1:] = ['info', 'unicycle_2r']; main()"
    printed, lines = run(f"{NEXT_VERSION}\n{command}", tmp_path)
    assert any("unicycle_2r" in line for line in printed)
    (line,) = lines
    assert line.startswith("numba 0.69.1: ")


def test_the_paper_by_plain_numba(tmp_path: Path) -> None:
    """The eight runs, every number of every sample.

    LLVM optimises nothing, which takes half the time, and leaves numba unused names for which it keeps some
    functions in memory only: what another numba could change is how functions are typed and called.
    """
    own = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONWARNINGS": "ignore:Cannot cache"}
    _, lines = run(f"{NEXT_VERSION}\n{RUNS}", tmp_path, NUMBA_OPT="0", **own)
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
