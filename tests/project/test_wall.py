"""The wall: packages that use trajectories import of the core only what `nmm` or `nmm.extending` exports."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import nmm

PACKAGE = Path(nmm.__file__).parent
#: Below the wall: what makes a trajectory.
CORE = (
    "nmm.base.kernels", "nmm.model", "nmm.control", "nmm.motion", "nmm.plugins.planning", "nmm.plugins.robot",
)  # fmt: skip
#: What uses trajectories in a room that makes them.
USERS = (
    "nmm.motion.diagnosis", "nmm.plugins.planning.cli", "nmm.plugins.robot.cli", "nmm.plugins.robot.lerobot",
    "nmm.plugins.robot.ros",
)  # fmt: skip
#: What wings import besides, with the reason.
EXCEPTIONS = {
    ("nmm.control.step.equations", "call_step"): "the linearised step, compiled",
    ("nmm.control.resolvers.partitions", "HELD"): "the linearised step holds RG's partition",
    ("nmm.control.resolvers.partitions", "MODE"): "the linearised step holds RG's partition",
    (
        "nmm.control.functions.callbacks",
        "DIFFERENCE_STEP",
    ): "differences of the same step as those of users' functions",
    **{
        ("nmm.base.kernels.signatures", name): "types of compiled functions; packages outside use numba's"
        for name in ("boolean", "float64", "int64", "void")
    },
    ("nmm.base.kernels", "records"): "the kernels' records, as a module, traced with symbols",
    ("nmm.model.collisions.elements.cell_mesh", "cell_triangles"): "another process draws what was sensed",
    ("nmm.model.collisions.elements.boxes", "Elements"): "another process draws what was sensed",
    ("nmm.model.collisions.pairs", "measured_pairs"): "a scenario's draft leaves out pairs that touch",
    ("nmm.model.collisions.pairs", "random_configurations"): "a scenario's draft leaves out pairs that touch",
    ("nmm.model.collisions.pairs", "HULLS"): "a scenario's draft leaves out pairs that touch",
    ("nmm.model.collisions.pairs", "query_shapes"): "a scenario's draft leaves out pairs that touch",
}


def exports() -> dict[str, object]:
    """The names that `nmm` and `nmm.extending` export, with what they are."""
    stubs = [(nmm, "__init__.pyi"), (nmm.extending, "extending.pyi")]
    names = [
        (m, n)
        for m, stub in stubs
        for n in re.findall(r" as (\w+)$", (PACKAGE / stub).read_text("utf-8"), re.M)
    ]
    return {name: getattr(module, name) for module, name in names}


def below(module: str) -> bool:
    def inside(room: str) -> bool:
        return f"{module}.".startswith(f"{room}.")

    return any(map(inside, CORE)) and not any(map(inside, USERS))


def crossings() -> Iterator[tuple[str, str, str]]:
    """(file, module, name) of each import across the wall, by files above it."""
    for path in sorted(PACKAGE.rglob("*.py")):
        file = path.relative_to(PACKAGE).as_posix()
        if below("nmm." + file.removesuffix(".py").replace("/", ".")) or file.startswith("base/"):
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and below(node.module):
                yield from ((file, node.module, alias.name) for alias in node.names)
            elif isinstance(node, ast.Import):
                assert not any(below(alias.name) for alias in node.names), path


def test_wings_import_what_is_exported() -> None:
    exported, used = exports(), set()
    for file, module, name in crossings():
        if (module, name) in EXCEPTIONS:
            used.add((module, name))
            continue
        assert name in exported, f"{file}: {module}.{name} is no export of nmm or nmm.extending"
        assert getattr(import_module(module), name) is exported[name], f"{file}: another {name}"
    assert used == EXCEPTIONS.keys()
    assert len(EXCEPTIONS) < 20


def test_what_is_exported_is_on_the_page() -> None:
    page = (PACKAGE.parent / "docs" / "api" / "extending.md").read_text("utf-8")
    for name in nmm.extending.__all__:
        assert f"`{name}`" in page or f"nmm.extending.{name}" in page, name


@pytest.mark.parametrize(
    ("name", "said"),
    [("Kernel", "nmm has no Kernel, but nmm.extending has"), ("Kernels", "nmm has no Kernels")],
)
def test_a_name_of_extending_is_told_where_it_is(name: str, said: str) -> None:
    with pytest.raises(AttributeError) as caught:
        getattr(nmm, name)
    assert str(caught.value) == said
