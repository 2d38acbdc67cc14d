"""What is installed: files of versions agree with pyproject.toml; a loop imports what a robot has."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

#: What a loop does from beginning to end, in a process of its own; prints the packages that it imported.
LOOP = """
import sys
import nmm
robot = nmm.load("unicycle_2r")
task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
limits = nmm.Limits(acceleration=2.0)
apart = nmm.Collisions(0.03, obstacles=[nmm.Obstacle(nmm.Box([0.2, 0.2, 1.0]), [9.0, 9.0, 0.5])])
resolver = nmm.DampedLeastSquares()
loop = nmm.Loop(nmm.Controller(robot, task, resolver, limits=limits, collisions=apart), 0.01)
q = robot.q({"q2": 0.5})
for k in range(30):
    q = q + 0.01 * robot.S(q) @ loop.step(0.01 * k, None if k > 10 else q)
loop.trajectory().save("run", figures=False)
print(*{name.partition(".")[0] for name in sys.modules})
"""


def pins(path: Path) -> dict[str, str]:
    lines = [one for one in path.read_text("utf-8").splitlines() if one and not one.startswith("#")]
    return {canonicalize_name(name): version for name, _, version in (one.partition("==") for one in lines)}


def test_constraints_are_within_what_pyproject_allows(pytestconfig: pytest.Config) -> None:
    project = tomllib.loads((pytestconfig.rootpath / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    known = pins(pytestconfig.rootpath / "constraints.txt")
    for one in map(Requirement, (*project["dependencies"], *(one for many in extras for one in many))):
        if one.name != "nmm":
            assert known[canonicalize_name(one.name)] in one.specifier, one


def test_a_loop_imports_what_a_robot_has(pytestconfig: pytest.Config, tmp_path: Path) -> None:
    robot = pins(pytestconfig.rootpath / "requirements-robot.txt")
    assert robot.items() <= pins(pytestconfig.rootpath / "constraints.txt").items()
    given = {"capture_output": True, "text": True, "check": True, "cwd": tmp_path}
    told = subprocess.run([sys.executable, "-c", LOOP], **given).stdout.split()  # type: ignore[call-overload]
    owners = packages_distributions()
    used = {canonicalize_name(one) for name in told for one in owners.get(name, ())} - {"nmm"}
    assert {"numpy", "llvmlite", "xacro"} < used
    used.add("numba")  # imported where something is compiled, as at the first start
    # Where they are installed numba imports SciPy, which imports all of NumPy, whose f2py imports
    # charset_normalizer; and Python imports setuptools at its start.
    assert used <= robot.keys() | {"scipy", "charset-normalizer", "setuptools"}
