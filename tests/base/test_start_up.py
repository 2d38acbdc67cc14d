"""What commands load: libraries that start slowly come only with what needs them."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from nmm.base.kernels.cache import cache_folder

LOADED = """
import json, sys
from nmm.cli.exit_status import status_of
status = status_of({arguments!r})
sys.stdout.flush()
print(json.dumps([status, sorted({{name.split(".")[0] for name in sys.modules}})]), file=sys.stderr)
"""


@pytest.mark.parametrize(
    "arguments", [["--help"], ["run", "--help"], ["map", "--help"], ["--version"], ["no_such_command"]]
)
def test_help_loads_none_of_the_libraries(arguments: list[str]) -> None:
    command = [sys.executable, "-c", LOADED.format(arguments=arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    status, loaded = json.loads(done.stderr.splitlines()[-1])
    assert status == (2 if arguments == ["no_such_command"] else 0)
    slow = {"numpy", "numba", "pinocchio", "scipy", "matplotlib", "yaml", "rich"}
    assert slow & {*loaded} == set()


RUN = """
import sys
import nmm
robot = nmm.load("unicycle_2r")
task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 1.0])
run = nmm.simulate(nmm.Controller(robot, task, nmm.ProjectedGradient()), np.zeros(5), 0.1, dt=0.01)
assert run.complete and run.summary()["made_with"]["numba"]
print(sorted({name.split(".")[0] for name in sys.modules}))
"""


def test_a_run_of_what_is_compiled_loads_no_compiler(tmp_path: Path) -> None:
    """Nor what only plugins need."""
    code = f"import numpy as np\n{RUN}"
    command, environment = [sys.executable, "-c", code], os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    if cache_folder().is_dir():  # a copy, which nobody else tidies up
        # But for what other processes are writing there, which goes when it is written.
        unfinished = shutil.ignore_patterns(".*", "*.tmp.*")
        shutil.copytree(cache_folder(), tmp_path / "nmm" / cache_folder().name, ignore=unfinished)
    for _ in range(2):  # the first may compile
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    loaded = {*ast.literal_eval(done.stdout)}
    assert {"numpy", "pinocchio", "llvmlite"} <= loaded
    assert not loaded & {"numba", "sympy", "flint", "pyarrow", "tornado", "matplotlib", "scipy"}


def test_kept_kernels_do_not_load_what_compiles() -> None:
    """What is compiled after them finds all that it needs."""
    code = """
import sys
import numpy as np
import nmm
from nmm.model.robots.zero_order_hold import RollingPreview
q, _ = RollingPreview(nmm.load("unicycle_2r"))(np.zeros(5), 0.5)
assert abs(q[0] - 0.5) < 1e-12
print("numba.np.linalg" in sys.modules)
def length(values):
    return np.sqrt(np.sum(values * values))
import numba
assert numba.njit(length)(np.array([2.0, 1.0, 2.0])) == 3.0
"""
    _, second = (
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
        for _ in range(2)
    )
    assert second == "False\n"
