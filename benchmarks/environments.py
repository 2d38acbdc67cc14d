"""An environment of its own for each library that `run.py` compares, by venv and pip from PyPI."""

from __future__ import annotations

import subprocess
import sys
import venv
from pathlib import Path
from typing import NamedTuple

import platformdirs


class Library(NamedTuple):
    """What it is called, what is installed, its worker, and the variants that are run."""

    name: str
    packages: tuple[str, ...]
    worker: str
    variants: tuple[str, ...]


#: A pip that finds no such version says so, and the table with it.
LIBRARIES = (
    Library("roboplan", ("roboplan==0.7.0", "numpy==2.4.6"), "of_roboplan.py", ("rolls", "slides")),
    Library("placo", ("placo==0.10.2",), "of_placo.py", ("rolls", "slides")),
    Library("Pink", ("pin-pink==4.4.0", "pin==4.1.0", "daqp==0.11.0"), "of_pink.py", ("rolls",)),
    Library("mink", ("mink==1.3.0", "mujoco==4.0.0", "daqp==0.11.0"), "of_mink.py", ("rolls",)),
)
#: Seconds that an installation may take.
PATIENCE = 900


def default_folder() -> Path:
    """Where the environments are kept between runs."""
    return Path(platformdirs.user_cache_dir("nmm")) / "benchmarks"


def python_of(library: Library, folder: Path) -> tuple[Path | None, str]:
    """The environment's Python, made if it is not there; None and why where it cannot be made."""
    place = folder / f"{library.name.lower()}-{'-'.join(library.packages).replace('=', '')}"
    python = place / "bin" / "python"
    finished = place / "installed.txt"
    if finished.exists():
        return python, ""
    print(f"making {place} with {', '.join(library.packages)}", file=sys.stderr, flush=True)
    try:
        venv.create(place, with_pip=True, clear=True)
        command = [str(python), "-m", "pip", "install", "--quiet", *library.packages]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    except (OSError, subprocess.SubprocessError) as error:
        return None, f"no environment: {type(error).__name__}: {error}"
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
        return None, f"pip: {said[0] if said else done.stderr.strip()[-200:]}"
    finished.write_text("\n".join(library.packages) + "\n")
    return python, ""
