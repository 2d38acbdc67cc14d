"""Which of a robot's lengths are arguments of its xacro file, found by reading the file with others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nmm.analysis.formulas.chain import Chain, chain_to
from nmm.errors import NmmError
from nmm.robots.robot import Robot


def argument_names(robot: Robot, frames: Iterable[str]) -> dict[str, str]:
    """The argument that each length is, by the length's label (`x_q2`); "-d" for one's negative.

    Two arguments may have the same value. So the file is read once more with every argument changed by
    another share, and a length is an argument when both values agree. Lengths that are computed from
    arguments, and those of a robot that was not read from one xacro file, keep their labels.
    """
    from nmm.robots.loading import load

    given = {}
    for name, text in robot.arguments.items():
        try:
            given[name] = float(text)
        except ValueError:
            continue
    if not any(given.values()):
        return {}
    changed = {name: value * (1.0 + 0.001 * (1 + i)) for i, (name, value) in enumerate(given.items())}
    arguments = {**robot.arguments, **{name: repr(value) for name, value in changed.items()}}
    try:
        other = load(
            robot.source, arguments=arguments, platform=robot.platform, wheels=[w.joint for w in robot.wheels]
        )
        pairs = [
            pair
            for frame in frames
            for pair in zip(_lengths(chain_to(robot, frame)), _lengths(chain_to(other, frame)), strict=True)
        ]
    except (NmmError, ValueError):  # mounted, of another file, or too narrow in what it takes
        return {}
    names = {}
    for (label, value), (same, after) in pairs:
        if label != same:
            return {}
        for name in given:
            for sign in (1, -1):
                before = sign * given[name]
                if value and abs(value - before) < 1e-9 and abs(after - sign * changed[name]) < 1e-9:
                    names[label] = name if sign > 0 else f"-{name}"
    return names


def _lengths(chain: Chain) -> Iterator[tuple[str, float]]:
    for label, translation in (
        *((joint.name, joint.translation) for joint in chain.joints),
        (chain.frame, chain.translation),
    ):
        for axis, value in zip("xyz", translation, strict=True):
            yield f"{axis}_{label}", float(value)
