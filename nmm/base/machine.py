"""What computed a result: the versions and the machine, as every summary tells them; and how much memory
there is, asked before it is filled."""

import os
import platform
import re
import subprocess
import sys
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from nmm.base.errors import InputError
from nmm.base.version import __version__


def made_with() -> dict[str, str | int]:
    """Versions of nmm, Python, numpy, pinocchio and numba, system and processor; no host, user or path."""
    return dict(_found())


def versions() -> str:
    """Two lines for a report of a fault: nmm; Python and libraries, which are not imported for it."""
    from importlib import metadata

    told = [f"Python {platform.python_version()}"]
    for package in ("pin", "numpy", "numba"):
        try:
            told.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:  # built from source, or of another package manager
            told.append(f"{package} not known to pip")
    return f"nmm {__version__}\n{', '.join(told)}"


@cache
def numba_version() -> str:
    """numba's version, read from its file: to import numba takes half a second and 24 MB."""
    spec = find_spec("numba")
    with suppress(OSError):
        text = Path(spec.origin).with_name("_version.py").read_text("utf-8") if spec and spec.origin else ""
        if stated := re.search(r'"version": "([^"]+)"', text):
            return stated[1]
    import numba

    return str(numba.__version__)


@cache
def _found() -> tuple[tuple[str, str | int], ...]:
    import numpy
    import pinocchio

    return (
        ("nmm", __version__),
        ("python", platform.python_version()),
        ("numpy", numpy.__version__),
        ("pinocchio", pinocchio.__version__),
        ("numba", numba_version()),
        ("system", f"{platform.system()} {platform.machine()}"),
        ("processor", _processor()),
        ("cores", os.cpu_count() or 1),
    )


def _processor() -> str:
    with suppress(OSError):
        if sys.platform == "darwin":
            asked = ["sysctl", "-n", "machdep.cpu.brand_string"]
            told = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
            return told or platform.machine()
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


#: How much of the memory that is free may be filled.
SHARE = 0.7


def free_memory() -> float:
    """Bytes that are free, or only a cache of files; as good as no bound where the system does not say."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            for line in file:
                name, _, rest = line.partition(":")
                if name == "MemAvailable":
                    return 1024.0 * float(rest.split()[0])
        return float(os.sysconf("SC_AVPHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return float("inf")


def expect_memory(needed: float, what: str, instead: str) -> None:
    """`InputError` for what needs more bytes than may be filled, with what may be done instead."""
    free = free_memory()
    if needed > SHARE * free:
        raise InputError(f"{what} {needed / 1e9:.3g} GB, and {free / 1e9:.3g} GB are free; {instead}")
