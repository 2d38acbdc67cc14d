"""Words that the reports on singularities share: who, with which task, where; numbers, directions, minors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import isfinite
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from nmm.analysis.singular.reached import stacked
from nmm.arrays import Array
from nmm.cli.output import console, show_text
from nmm.control.directions import SMALL, direction_text
from nmm.words import measured

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied

#: Parts of a direction below it are not written: what two decimals can tell, and what matters most.
VISIBLE, LARGE = 0.005, 0.1
#: A number this small beside the largest of its kind is a zero that was rounded.
ZERO = 1e-10
#: More names than these are counted, not listed.
MOST_NAMES = 4


def header(given: Studied) -> Iterator[str]:
    """Who, with which inputs and which task."""
    robot, tasks = given.robot, stacked(given.task)
    name = robot.name if given.name == robot.name else f"{given.name}: {robot.name}"
    yield f"{name}, {robot.platform.name} platform"
    yield f"inputs: {_with_units(list(zip(robot.u_names, robot.u_units, strict=True)))}"
    yield f"task: {_with_units([(row.name, row.unit) for row in tasks.rows(robot)])}"
    turned = [task.function for task in tasks if task.function.comparison is not None]
    if turned:
        names = [row.name for function in turned for row in function.rows(robot)]
        rows = "the rows" if len(names) == len(tasks.rows(robot)) else ", ".join(names)
        yield f"{rows} are in the frame's own axes"


def _with_units(named: Sequence[tuple[str, str]]) -> str:
    """ "v (m/s); omega, q1, q2 (rad/s)"."""
    runs = groupby(named, key=lambda pair: pair[1])
    return "; ".join(f"{', '.join(name for name, _ in run)} ({unit})" for unit, run in runs)


def configuration(given: Studied) -> str:
    """Coordinates that are not 0, angles in degrees too."""
    robot = given.robot
    parts = []
    for name, value, unit in zip(robot.q_names, given.q, robot.q_units, strict=True):
        if value:
            parts.append(f"{name} = {measured(value, unit)}")
    if len(parts) < robot.n:
        parts.append("the rest 0" if parts else "every coordinate 0")
    time = f"at t = {given.t:g} s, " if given.t else ""
    return f"{time}where " + ", ".join(parts)


def sizes_note(units: Sequence[str], length: float | None) -> str | None:
    """What singular values compare, where rows or inputs have different units; None where they do not."""
    if length is not None:
        return f"singular values count lengths in L = {length:g} m"
    if len({unit.split("/")[0] for unit in units}) == 1:
        return None
    return "singular values count 1 m as much as 1 rad; --length L counts lengths in L"


def number(value: float, largest: float = 0.0) -> str:
    """Four digits; 0 for what is rounding beside `largest`."""
    if np.isnan(value):
        return "-"
    if not isfinite(value):
        return "inf"
    return "0" if abs(value) <= ZERO * largest else f"{value:.4g}"


def direction(vector: Array, names: Sequence[str], visible: float = VISIBLE) -> str:
    """A unit vector in names, "0.71 ee.x - 0.71 ee.y"; "≈" before one whose small parts are not written."""
    large = np.abs(vector) >= visible
    left_out = np.any(~large & (np.abs(vector) > SMALL))
    return ("≈ " if left_out else "") + direction_text(np.where(large, np.round(vector, 2), 0.0), names)


def directions(vectors: Array, names: Sequence[str]) -> str:
    """Directions with semicolons between them; a number of them where they are many."""
    if len(vectors) > MOST_NAMES:
        return f"{len(vectors)} directions"
    return "; ".join(direction(vector, names) for vector in vectors)


def named_or_counted(names: Sequence[str], kind: str) -> str:
    """Names with commas between them; how many where they are many."""
    return f"{len(names)} {kind}" if len(names) > MOST_NAMES else ", ".join(names) or "none"


def block(columns: Sequence[str]) -> str:
    """Columns of a partition, "[v, q1]"."""
    return f"[{', '.join(columns)}]"


def without_twins(groups: Sequence[tuple[str, tuple[str, ...]]]) -> list[tuple[str, str]]:
    """Keys and labels of the parts to show: one that has no inputs, or those of another, goes without.

    A robot's only arm has a name: "arm (ur5)". With a fixed base it is the whole robot.
    """
    shown: dict[tuple[str, ...], tuple[str, str]] = {}
    for name, inputs in groups:
        if not inputs:
            continue
        if inputs in shown:
            key, label = shown[inputs]
            if name != "robot":
                shown[inputs] = (key, f"{label} ({name})")
        else:
            shown[inputs] = (name, name)
    return list(shown.values())


def say(text: str = "") -> None:
    """Print a line; one that is too long for a terminal goes on below itself, two columns in."""
    out = console()
    if out.is_terminal and len(text) > out.width:
        indent = " " * (len(text) - len(text.lstrip()) + 2)
        text = fill(text, out.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    show_text(text)
