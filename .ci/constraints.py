"""Writes constraints.txt: what pyproject.toml needs, with all extras, in the versions of the environment.

.venv/bin/pip install -e '.[dev,docs,streams]' && .venv/bin/python .ci/constraints.py
"""

import tomllib
from importlib.metadata import requires, version
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
extras = project["optional-dependencies"].values()
asked = [*project["dependencies"], *(one for many in extras for one in many)]
waiting = [one for one in map(Requirement, asked) if one.name != "nmm"]
found: dict[tuple[str, tuple[str, ...]], str] = {}
while waiting:
    one = waiting.pop()
    name, wanted = canonicalize_name(one.name), tuple(sorted(one.extras))
    if (name, wanted) in found:
        continue
    found[name, wanted] = version(name)
    for more in map(Requirement, requires(name) or ()):
        if more.marker is None or any(more.marker.evaluate({"extra": extra}) for extra in (*wanted, "")):
            waiting.append(more)
lines = sorted({f"{name}=={kept}" for (name, _), kept in found.items()})
Path("constraints.txt").write_text(
    "# What the gate installs, made by .ci/constraints.py. pyproject.toml says what nmm works with.\n"
    + "\n".join(lines)
    + "\n",
    encoding="utf-8",
)
