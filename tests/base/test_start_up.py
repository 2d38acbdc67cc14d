"""What commands load: libraries that start slowly come only with what needs them."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

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


def test_kernels_do_not_load_scipy_s_linear_algebra() -> None:
    """numba would, to see whether it is there; matrices are multiplied in compiled code all the same."""
    code = """
import sys
import numpy as np
from nmm.base.kernels.compiled import allocating, compiled
def product(A, B):
    return A @ B
def total(values):
    return values.sum()
assert compiled(total)(np.ones(3)) == 3.0
assert "scipy.linalg" not in sys.modules
A = np.arange(9.0).reshape(3, 3)
assert np.array_equal(allocating(product)(A, A), A @ A)
assert "scipy.linalg" in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_kept_kernels_do_not_load_what_compiles() -> None:
    """Nor do those that make arrays; what is compiled after them finds all that it needs."""
    code = """
import sys
import numpy as np
import nmm
from nmm.base.kernels.compiled import allocating
from nmm.model.robots.zero_order_hold import RollingPreview
q, _ = RollingPreview(nmm.load("unicycle_2r"))(np.zeros(5), 0.5)
assert abs(q[0] - 0.5) < 1e-12
print("numba.np.linalg" in sys.modules)
def length(values):
    return np.linalg.norm(values)
assert allocating(length)(np.array([2.0, 1.0, 2.0])) == 3.0
"""
    _, second = (
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
        for _ in range(2)
    )
    assert second == "False\n"
