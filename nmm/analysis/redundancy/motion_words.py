"""Motions in words: "the platform drives back at 0.31 m/s while q2 opens at 1 rad/s"."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.analysis.redundancy.joint_words import Words, joint_words
from nmm.arrays import Array
from nmm.robots.robot import Robot
from nmm.words import listed

#: Who it is in the platform's phrases; of two in a row the second goes without.
WHO = "the platform "
DRIVES = Words(f"{WHO}drives forward", f"{WHO}drives back")
SLIDES = Words(f"{WHO}slides left", f"{WHO}slides right")
TURNS = Words(f"{WHO}turns left", f"{WHO}turns right")
#: The platforms' inputs by name.
INPUTS: Mapping[str, Words] = {
    "v": DRIVES,
    "omega": TURNS,
    "vx": DRIVES,
    "vy": SLIDES,
    "drive": DRIVES,
    "strafe": SLIDES,
    "turn": TURNS,
    "omega_left": Words("the left wheel rolls forward", "the left wheel rolls back"),
    "omega_right": Words("the right wheel rolls forward", "the right wheel rolls back"),
    "steering_rate": Words(f"{WHO}steers left", f"{WHO}steers right"),
}
#: Those of platforms that are described by their wheels, by the end of the name; {} is what stands before it.
ENDINGS: Mapping[str, Words] = {
    "_speed": Words("{} rolls forward", "{} rolls back"),
    "_spin": Words("{} turns forward", "{} turns back"),
    "_rate": Words("{} steers left", "{} steers right"),
}
#: The platforms' coordinates in their own axes, x ahead and y to the left.
COORDINATES: Mapping[str, Words] = {
    "x": Words(f"{WHO}slides forward", f"{WHO}slides back"),
    "y": SLIDES,
    "theta": TURNS,
}

#: A rate below this part of the largest is not worth a word.
WORTH = 1e-3


def input_words(robot: Robot, q: Array) -> dict[str, Words]:
    """Words for each input at q, by name: the platform's by their meaning, the joints' by their geometry."""
    return {name: _of_input(name) for name in robot.platform.inputs} | joint_words(robot, q)


def coordinate_words(robot: Robot, q: Array) -> dict[str, Words]:
    """Words for each coordinate at q, by name, x and y being those along the platform's own axes."""
    own = {name: Words(f"{name} turns", f"{name} turns") for name in robot.platform.coordinates}
    return own | {name: COORDINATES[name] for name in own if name in COORDINATES} | joint_words(robot, q)


def _of_input(name: str) -> Words:
    if name in INPUTS:
        return INPUTS[name]
    for ending, words in ENDINGS.items():
        if name.endswith(ending) and name != ending:
            stem = name.removesuffix(ending)
            return Words(words.positive.format(stem), words.negative.format(stem))
    return Words(f"{name} runs", f"{name} runs")


def motion_text(
    rates: Array, names: Sequence[str], units: Sequence[str], words: Mapping[str, Words], of_platform: int
) -> str:
    """A motion in a clause: what the platform does, while the joints do the rest, a thousandth left out.

    Parameters
    ----------
    rates (m,), names, units : of the inputs or coordinates, the platform's first
    words : by name
    of_platform : how many are the platform's
    """
    moved = [k for k in range(len(rates)) if abs(rates[k]) > WORTH * np.abs(rates).max(initial=0.0)]
    phrases = {k: words[names[k]].phrase(float(rates[k]), units[k]) for k in moved}
    platform = _without_repeating_who([phrase for k, phrase in phrases.items() if k < of_platform])
    arm = [phrase for k, phrase in phrases.items() if k >= of_platform]
    if not phrases:
        return "nothing moves"
    if not platform:
        platform, arm = arm[:1], arm[1:]
    if not arm:
        return listed(platform) + (" alone" if len(phrases) == 1 else "")
    return f"{listed(platform)} while {listed(arm)}"


def _without_repeating_who(phrases: Sequence[str]) -> list[str]:
    """ "the platform drives forward", "turns left"."""
    return [
        phrase.removeprefix(WHO) if k and phrases[k - 1].startswith(WHO) else phrase
        for k, phrase in enumerate(phrases)
    ]
