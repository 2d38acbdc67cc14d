"""What a benchmark ran on."""

from __future__ import annotations

import os
import platform
from datetime import date
from pathlib import Path


def _first(path: str, key: str = "") -> str | None:
    """The first line of a file, or what stands after the key's colon; None where there is no such thing."""
    try:
        lines = Path(path).read_text().splitlines()
    except OSError:
        return None
    found = [line for line in lines if line.startswith(key)]
    if not found:
        return None
    return found[0].split(":", 1)[1].strip() if key else found[0].strip()


def described() -> list[str]:
    """Lines: the date, processor, cores, governor and load."""
    processor = _first("/proc/cpuinfo", "model name") or platform.processor() or platform.machine()
    family = _first("/proc/cpuinfo", "model\t")
    named = processor if family is None else f"{processor}, model {family}"
    governor = _first("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor") or "cannot be read"
    load = ", ".join(f"{one:.1f}" for one in os.getloadavg()) if hasattr(os, "getloadavg") else "unknown"
    return [
        f"{date.today().isoformat()}; {platform.system()} {platform.release()}; {named}",
        f"{os.cpu_count()} cores; frequency governor: {governor}; load over 1, 5, 15 minutes: {load}",
    ]
