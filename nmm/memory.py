"""How much memory there is, asked before it is filled."""

from __future__ import annotations

import os

from nmm.errors import InputError

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
