"""Tables of `run.py`, as text and as Markdown."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from contest import Followed

#: At most this share of roboplan's step, limits on in both, is asked of the two paths.
AIMS = {"pinocchio": 0.8, "compiled": 0.45}
CALLED = {
    ("nmm", "pinocchio"): "nmm, Pinocchio's kinematics",
    ("nmm", "compiled"): "nmm, compiled kinematics",
    ("floor", "floor"): "floor: by hand, no limits",
}
HEADS = (
    *("", "µs, median", "least", "of nmm's", "of the floor"),
    *("off the path, mm (mrad)", "sideways, m/s"),
)
Key = tuple[str, str, str]


class Section(NamedTuple):
    """A part of the output: its name, lines before the table, heads, rows, lines after it."""

    name: str
    before: list[str]
    heads: list[str]
    rows: list[list[str]]
    after: list[str]


def called(name: str, variant: str) -> str:
    """What a row is called."""
    return CALLED.get((name, variant), f"{name}, its base {variant}")


def comparison(
    times: dict[Key, list[float]],
    followed: dict[Key, Followed],
    absent: list[str],
    versions: dict[str, dict[str, str]],
    machine: list[str],
    count: int,
    steps: dict[str, int],
) -> list[Section]:
    """A section on what was run, one for each workload with limits off and on, and one with the aims."""
    ran = [[name, ", ".join(f"{a} {b}" for a, b in found.items())] for name, found in versions.items()]
    sections = [Section("versions", machine, ["", "versions"], ran, [f"not run: {one}" for one in absent])]
    for job, length in steps.items():
        rows = [_row(job, key, times, found) for key, found in followed.items() if key[0] == job]
        floor = ("planar, limits off", "floor", "floor")
        if job == "planar, limits on" and floor in times:
            rows.append([called(*floor[1:]), *_timed(job, times[floor], times), "", ""])
        said = f"{count} rounds of {length} steps"
        table = [[*HEADS], *rows]
        if not job.startswith("planar"):  # the floor is a floor of that alone
            table = [row[:4] + row[5:] for row in table]
        sections.append(Section(job, [said], table[0], table[1:], []))
    return [*sections, _aims(times)]


def _row(job: str, key: Key, times: dict[Key, list[float]], found: Followed) -> list[str]:
    turned = f" ({1e3 * found.orientation:.3f})" if job.startswith("TIAGo") else ""
    motion = [f"{1e3 * found.position:.3f}{turned}", f"{found.sideways:.2f}"]
    if key not in times:
        return [called(*key[1:]), found.reason or "not timed", "", "", "", *motion]
    return [called(*key[1:]), *_timed(job, times[key], times), *motion]


def _timed(job: str, own: list[float], times: dict[Key, list[float]]) -> list[str]:
    """Median and least, and the medians over the rounds of two ratios."""
    to = [
        times.get((job, "nmm", "pinocchio")),
        times.get(("planar, limits off", "floor", "floor")) if job.startswith("planar") else None,
    ]
    ratios = ["" if other is None else f"{np.median(np.divide(own, other)):.2f}" for other in to]
    return [f"{np.median(own):.2f}", f"{np.min(own):.2f}", *ratios]


def _aims(times: dict[Key, list[float]]) -> Section:
    """nmm's two paths as shares of roboplan's step, limits on: median and middle half of rounds' ratios."""
    rows = []
    for job, name, base in times:
        if name != "roboplan" or not job.endswith("on"):
            continue
        for path, aim in AIMS.items():
            own = times.get((job, "nmm", path))
            if own is None:
                continue
            low, middle, high = np.percentile(np.divide(own, times[job, name, base]), (25, 50, 75))
            met = "yes" if middle <= aim else "no"
            rows.append([job, base, path, f"{middle:.2f} ({low:.2f} to {high:.2f})", f"at most {aim}", met])
    heads = ["", "roboplan's base", "nmm's kinematics", "nmm / roboplan (middle half)", "aim", "met"]
    return Section("aims", [], heads, rows, [])


def text(section: Section) -> str:
    """A section for a terminal."""
    lines = [f"\n{section.name}", *section.before]
    table = [section.heads, *section.rows]
    if section.rows:
        widths = [max(len(row[k]) for row in table) for k in range(len(section.heads))]
        for row in table:
            cells = [
                c.ljust(w) if k == 0 else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths, strict=True))
            ]
            lines.append("  ".join(cells).rstrip())
    return "\n".join(lines + section.after)


def markdown(section: Section) -> str:
    """A section for a page."""
    lines = [line + "  " for line in section.before]
    if section.rows:
        aligned = ["---", *["---:"] * (len(section.heads) - 1)]
        for row in [section.heads, aligned, *section.rows]:
            lines.append("| " + " | ".join(row) + " |")
        lines.insert(len(section.before), "")
    return "\n".join([*lines, *(["", *section.after] if section.after else [])])


def into(page: Path, sections: list[Section]) -> None:
    """Put the sections between their marks, `<!-- NAME -->` and `<!-- end -->`, in a page that has them."""
    words = page.read_text(encoding="utf-8")
    for section in sections:
        mark, end = f"<!-- {section.name} -->\n", "<!-- end -->"
        if mark not in words:
            raise SystemExit(f"{page}: expected a line {mark.strip()}")
        head, tail = words.split(mark, 1)
        words = f"{head}{mark}{markdown(section)}\n{end}{tail.split(end, 1)[1]}"
    page.write_text(words, encoding="utf-8")
