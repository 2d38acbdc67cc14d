"""What computed a result: the versions and the machine, as every summary tells them."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path


def made_with() -> dict[str, str | int]:
    """Versions of nmm, Python, numpy, pinocchio and numba, the system, the processor and its cores.

    Nothing that names a person, a machine or a place: no host, user or path.
    """
    return dict(_found())


@cache
def _found() -> tuple[tuple[str, str | int], ...]:
    import numba
    import numpy
    import pinocchio

    from nmm import __version__

    return (
        ("nmm", __version__),
        ("python", platform.python_version()),
        ("numpy", numpy.__version__),
        ("pinocchio", pinocchio.__version__),
        ("numba", numba.__version__),
        ("system", f"{platform.system()} {platform.machine()}"),
        ("processor", _processor()),
        ("cores", os.cpu_count() or 1),
    )


def _processor() -> str:
    """Its name; the architecture where the system does not tell one."""
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
