"""Which arguments and which literals of a xacro file give its robot other numbers, by finite differences."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.loading.xml_tree import trying
from nmm.model.robots.numbers import robot_numbers
from nmm.model.robots.robot import Robot

#: Arguments and literals change by this share, or by so much where they are 0.
STEP = 1e-3
#: What changes a number by less, for a whole share, does not change it.
FELT = 1e-6
#: How many times the steps towards the numbers are taken: most are linear in the arguments.
ROUNDS = 4
#: What a number that is to stay counts beside one that is to change.
STAYS = 1e-5
#: So many literals are tried at most for each number.
MOST = 12
_LITERAL = re.compile(rb"(?<![\w.$({+*/-])[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.)}*/+])")

#: Makes the robot with these arguments.
Load = Callable[[Mapping[str, str]], Robot]


class Literal(NamedTuple):
    """A number in a file: where it stands, its line, and what it says."""

    file: Path
    start: int
    end: int
    line: int
    text: str


def solved_arguments(
    load: Load, arguments: Mapping[str, str], before: Mapping[str, float], wanted: Mapping[str, float]
) -> tuple[dict[str, str], set[str]]:
    """The arguments that bring numbers (m, by name) as near as they can to those wanted; those that move
    numbers at all, by what they are called; and the numbers that some argument moves.

    before : what the robot has; wanted : of some numbers, the others are to stay"""
    names = [*before]
    columns: dict[str, Array] = {}
    for name, text in arguments.items():
        value = _value(text)
        column = None if value is None else _column(load, arguments, name, value, before)
        if column is not None and np.abs(column).max(initial=0.0) > FELT:
            columns[name] = column
    moved = {
        number for column in columns.values() for number, by in zip(names, column, strict=True)
        if abs(by) > FELT
    }  # fmt: skip
    weights = np.array([1.0 if number in wanted else STAYS for number in names])
    target = np.array([wanted.get(number, before[number]) for number in names])
    sizes = np.array([_size(before[number]) for number in names])
    used = _independent(columns, [number in wanted for number in names])
    if not used:
        return {}, moved
    J = np.column_stack([columns[name] for name in used])
    values = {name: float(arguments[name]) for name in used}
    reached = np.array([before[number] for number in names])
    for _ in range(ROUNDS):
        off = weights * (target - reached) / sizes
        by = np.linalg.lstsq(weights[:, np.newaxis] * J, off, rcond=None)[0]
        if np.abs(by).max() < 1e-12:
            break
        tried = {
            name: value + way * _size(value) for (name, value), way in zip(values.items(), by, strict=True)
        }
        try:
            reached = _numbers(load({**arguments, **_texts(tried)}), names)
        except InputError:
            break
        values = tried
    texts = _texts(values)
    return {name: text for name, text in texts.items() if float(text) != float(arguments[name])}, moved


def held_by(
    load: Callable[[], Robot], files: Sequence[Path], name: str, values: Mapping[str, float], change: float
) -> str | None:
    """Where the literal stands that a number comes from, with what it has to be for the number to change by
    so much, m; None where there is none. `values` are the robot's numbers."""
    tried = 0
    for literal in _literals(files, values[name]):
        if tried >= MOST:
            return None
        tried += 1
        value = float(literal.text)
        by = STEP * _size(value)
        content = literal.file.read_bytes()
        other = content[: literal.start] + repr(value + by).encode() + content[literal.end :]
        try:
            with trying({literal.file: other}):
                slope = (robot_numbers(load())[name].value - values[name]) / by
        except (InputError, KeyError):
            continue
        if abs(slope) > FELT:
            wanted = f"{value + change / slope:.7g}"
            return f"{literal.file.name}:{literal.line}: {literal.text} -> {wanted}"
    return None


def _column(
    load: Load, arguments: Mapping[str, str], name: str, value: float, before: Mapping[str, float]
) -> Array | None:
    """What the numbers change by, as shares of them, for a share of the argument; None where it may not be
    changed: the file says no."""
    names = [*before]
    sizes = np.array([_size(before[number]) for number in names])
    for sign in (1.0, -1.0):
        try:
            robot = load({**arguments, name: repr(value + sign * STEP * _size(value))})
            return np.asarray((_numbers(robot, names) - [*before.values()]) / (sign * STEP * sizes))
        except InputError:
            continue
    return None


def _numbers(robot: Robot, names: Sequence[str]) -> Array:
    """`InputError` for a robot that has other numbers now."""
    own = robot_numbers(robot)
    lost = [name for name in names if name not in own]
    if lost:
        raise InputError(f"{robot.name} has no {lost[0]}")
    return np.array([own[name].value for name in names])


def _independent(columns: Mapping[str, Array], wanted: Sequence[bool]) -> list[str]:
    """Arguments that move the wanted numbers, each otherwise than those before; those that move few first."""
    order = sorted(columns, key=lambda name: int(np.count_nonzero(np.abs(columns[name]) > FELT)))
    used: list[str] = []
    for name in order:
        own = columns[name][np.array(wanted)]
        if np.abs(own).max(initial=0.0) <= FELT:
            continue
        J = np.column_stack([columns[other][np.array(wanted)] for other in (*used, name)])
        if np.linalg.matrix_rank(J, tol=1e-4 * np.linalg.norm(J)) == len(used) + 1:
            used.append(name)
    return used


def _literals(files: Sequence[Path], value: float) -> Iterator[Literal]:
    """The numbers in files that may be a length: it, its half, or twice it, of either sign."""
    likely = (value, 0.5 * value, 2.0 * value)
    for file in files:
        content = file.read_bytes()
        for match in _LITERAL.finditer(content):
            size = abs(float(match.group()))
            if any(math.isclose(size, abs(one), rel_tol=1e-6) for one in likely if one):
                line = content.count(b"\n", 0, match.start()) + 1
                yield Literal(file, *match.span(), line, match.group().decode())


def _value(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _size(value: float) -> float:
    return abs(value) or 1.0


def _texts(values: Mapping[str, float]) -> dict[str, str]:
    return {name: f"{value:.9g}" for name, value in values.items()}
