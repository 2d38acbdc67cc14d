"""map: what the options mean, and the table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.cli.output import show_table
from nmm.errors import InputError
from nmm.words import quoted

if TYPE_CHECKING:
    from nmm.analysis.maps.result import Map
    from nmm.analysis.maps.singular_set import SingularSet
    from nmm.robots.robot import Robot


def show_map(made: Map, folder: Path) -> None:
    """Print the table of a map that was saved in `folder`."""
    rows = [row for name in made.values for row in _measure_rows(made, name)]
    show_table(
        ["measure", "smallest", "at", "largest", "at ", "unit"],
        rows,
        title=f"{made.about.robot}: {', '.join(made.about.task)}",
        numeric=["smallest", "largest"],
    )
    show_table(["", ""], list(_other_rows(made, folder)))


def _measure_rows(made: Map, name: str) -> Iterator[list[str]]:
    """One row; of a workspace one of the best and one of the worst postures."""
    from nmm.analysis.maps.measures import MEASURES

    layers = {"": False} if made.kind == "coordinates" else {", best": False, ", worst": True}
    # Of the best postures no singular place is known: between the cells a value may be worse yet.
    low = "smallest" if MEASURES[name].better > 0.0 else "largest"
    for layer, worst in layers.items():
        between = " (of the cells only)" if made.kind == "workspace" and not worst else ""
        row = [name + layer]
        for end, (value, where, on) in made.extremes(name, worst=worst).items():
            place = ", ".join(f"{axis} = {x:.4g}" for axis, x in zip(made.names, where, strict=True))
            row += [f"{value:.4g}", on or place + (between if end == low else "")]
        yield [*row, made.about.units[name] or "-"]


def _other_rows(made: Map, folder: Path) -> Iterator[tuple[str, str]]:
    yield f"{made.about.part} singular", _found(made, made.singular)
    if made.arm_singular is not None:
        yield "arm alone singular", _found(made, made.arm_singular)
    if made.kind == "workspace":
        reached = (made.rank >= 0).mean()
        yield "reached", f"{reached:.0%} of {made.rank.size} cells"
    yield "files in", str(folder)


def _found(made: Map, those: SingularSet) -> str:
    """Lines, and how many points; in a workspace these are of some postures drawn, not of all."""
    sampled = made.kind == "workspace" and len(those.points) > 0
    return those.text() + (", of postures drawn" if sampled else "")


def two_first(robot: Robot) -> list[str]:
    """The arm's first two coordinates; the first two of a robot whose arm has fewer."""
    arm = robot.u_names[robot.platform.p :]
    return list((arm if len(arm) >= 2 else robot.q_names)[:2])


def counts_of(text: str) -> tuple[int, int]:
    """ "500" or "300x200"."""
    words = text.lower().split("x")
    if len(words) > 2 or not all(word.strip().isdecimal() for word in words):
        raise InputError(f"--samples: expected a whole number, or two as in 300x200, got {quoted(text)}")
    return int(words[0]), int(words[-1])


def ranges_of(given: Sequence[str] | None) -> dict[str, tuple[float, float]]:
    """The `--range` options: (lower, upper) by name."""
    found: dict[str, tuple[float, float]] = {}
    for text in given or ():
        name, equals, values = text.partition("=")
        name = name.strip()
        if not equals or not name:
            raise InputError(f"--range: expected NAME=LOWER:UPPER, as in q1=-pi:pi, got {quoted(text)}")
        if name in found:
            raise InputError(f"--range: {name} is given twice")
        found[name] = range_of(values, f"--range: {name}")
    return found


def range_of(text: str, option: str) -> tuple[float, float]:
    """LOWER:UPPER, each arithmetic with pi."""
    from nmm.scenario.numbers import evaluate

    words = text.split(":")
    if len(words) != 2:
        raise InputError(f"{option}: expected LOWER:UPPER, as in -pi:pi, got {quoted(text)}")
    try:
        lower, upper = (evaluate(word) for word in words)
    except ValueError as error:
        raise InputError(f"{option}: {error}") from None
    return lower, upper


def refuse(given: dict[str, object], needs: str) -> None:
    wrong = [option for option, value in given.items() if value is not None]
    if wrong:
        raise InputError(f"{', '.join(wrong)}: expected with {needs}")
