"""`python -m tests.fuzz --minutes 30 [--only robots,folders]`: a long hunt; 1 when it found something."""

from __future__ import annotations

import argparse
import sys
import traceback

from . import HUNTS
from .hunting import many


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="of all hunts together (%(default)g)")
    parser.add_argument("--only", default=",".join(HUNTS), help="hunts, by name (%(default)s)")
    asked = parser.parse_args()
    names = asked.only.split(",")
    if unknown := [name for name in names if name not in HUNTS]:
        parser.error(f"unknown hunt {unknown[0]!r}; available: {', '.join(HUNTS)}")
    failed = False
    for name in names:
        found = many(HUNTS[name], 60.0 * asked.minutes / len(names))
        counts = ", ".join(f"{count} {word}" for word, count in found.counts.most_common())
        print(f"{name}: {sum(found.counts.values())} cases in {found.seconds:.0f} s: {counts}", flush=True)
        for case, error in found.failures:
            failed = True
            print(f"  FAILED {case!r}", flush=True)
            traceback.print_exception(error, limit=-4, file=sys.stdout)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
