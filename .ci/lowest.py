"""Prints the lowest version of each requirement in pyproject.toml, a line each, for `pip install -c`."""

import tomllib
from pathlib import Path

project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
extras = project["optional-dependencies"]
for requirement in [
    *project["dependencies"],
    *extras["sweep"],
    *extras["video"],
    *extras["mujoco"],
    *extras["vision"],
    *extras["ros"],
    *extras["test"],
]:
    name, above, rest = requirement.partition(">=")
    if above:
        print(f"{name.partition('[')[0]}=={rest.partition(',')[0]}")
