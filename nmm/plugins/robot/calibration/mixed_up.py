"""Whether counters or a reference of a log are taken for others: wheels swapped, signs, a mirrored frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.drives import RobotDrive, first_delay, used_looks
from nmm.plugins.robot.calibration.fit import FIRST, Fit, solve
from nmm.plugins.robot.calibration.held import CLOCKS, held_delay, held_numbers
from nmm.plugins.robot.calibration.innovations import BEGINS, TAKEN
from nmm.plugins.robot.calibration.judged import SIDE, off_by, window_ends, windows_of
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.parameters import MOUNT
from nmm.plugins.robot.calibration.planar import along_body
from nmm.plugins.robot.calibration.screening import screened
from nmm.plugins.robot.calibration.stretches import Stretches, at_times
from nmm.plugins.robot.odometry import Counters

#: Of a log so many looks are compared at most.
LOOKS = 200
#: Steps of such a short fit; so many other readings of a log are tried by one, the likeliest.
STEPS, TRIED = 6, 6
#: What is taken for noise while signs and names are judged.
ROUGH = FIRST._replace(place=0.02, counters=0.05, across=0.05, turns=0.05, agreement=0.05, jitter=0.01)
#: Dead reckoning that is off by a smaller share of its way, and wheels that agree but for a smaller share of
#: what they count, are not doubted.
RIGHT, AGREE = 0.15, 0.02
#: Nor are hitches that turn as they follow but for a smaller share of their turns.
FOLLOW = 0.5
#: Another reading of a log fits where less than this share of what is off is left.
FITS = 0.3
#: Readings of a log that fit as well are named, too, but so many at most.
ALIKE, NAMED = 1.5, 2


@dataclass(frozen=True)
class Rest:
    """What a short fit of a drive leaves: of dead reckoning, as a share of its way, of what counters say
    twice, as a share of it, and of the hitch that follows worst, as a share of its turns; how far the
    reference would be turned on the robot, rad."""

    way: float
    twice: float
    astray: float
    yaw: float

    @property
    def doubtful(self) -> str:
        """What is left too much of, "" where nothing is."""
        limits = {"way": RIGHT, "twice": AGREE, "astray": FOLLOW}
        return next((name for name, limit in limits.items() if getattr(self, name) > limit), "")

    def fits(self, before: Rest) -> bool:
        """Whether it is what a right log leaves, beside what was left `before`."""
        doubted = before.doubtful
        if getattr(self, doubted) >= FITS * getattr(before, doubted) or self.way >= RIGHT:
            return False
        near = doubted == "way" or self.way < max(ALIKE * before.way, 0.3 * RIGHT)
        return near and self.twice < max(before.twice, AGREE) and self.astray < max(before.astray, FOLLOW)


#: Who disagrees, and of what it is a share.
WHO = {
    "way": ("wheels and reference disagree", "the way"),
    "twice": ("the wheels disagree among themselves", "the way"),
    "astray": ("wheels and hitches disagree", "a hitch's turns"),
}


def check_mixed_up(
    robot: Robot, counters: Counters, drive: RobotDrive, held: Mapping[str, float | None]
) -> None:
    """`InputError` where a drive with looks is followed far better with wheels swapped, with another sign of
    a counter or a joint, or by a mirrored reference: which. Nothing is said of drives that do not show it."""
    if drive.ends:
        return
    before = _rest(robot, counters, thinned(drive), held)
    if before is None or not before.doubtful:
        return
    others = [(words, thinned(other)) for words, other in _others(robot, counters, drive)]
    at_once = [_rest(robot, counters, other, held, steps=0) for _, other in others]
    size = [math.inf if rest is None else rest.way + rest.twice + rest.astray for rest in at_once]
    likely = sorted(range(len(others)), key=lambda i: size[i])[:TRIED]
    found: list[tuple[Rest, str]] = []
    for i in sorted(likely):
        rest = _rest(robot, counters, others[i][1], held)
        if rest is not None and rest.fits(before):
            found.append((rest, others[i][0]))
    if not found:
        return
    doubted = before.doubtful
    size = [getattr(rest, doubted) for rest, _ in found]
    near = [one for one, left in zip(found, size, strict=True) if left < ALIKE * min(size)]
    least = min(abs(rest.yaw) for rest, _ in near)
    near = [one for one in near if abs(one[0].yaw) < least + 0.5 * math.pi]
    fitting = " or ".join(words for _, words in near[:NAMED])
    off, left = (
        f"{100.0 * getattr(rest, doubted):.{digits}g} %" for rest, digits in ((before, 3), (near[0][0], 2))
    )
    who, share = WHO[doubted]
    what = f"{who} by {off} of {share}; by {left} with {fitting}"
    expected = "the file's joints and signs; y to the left, headings counter-clockwise"
    raise InputError(what, where=f"{counters.where}: {drive.name}", expected=expected)


def thinned(drive: RobotDrive) -> RobotDrive:
    """The drive with fewer looks."""
    some = np.unique(np.linspace(0, len(drive.at) - 1, LOOKS).round().astype(int))
    taken = np.full(len(some), TAKEN, dtype=np.int64)
    taken[0] = BEGINS
    return replace(drive, at=drive.at[some], z=drive.z[some], taken=taken)


def _rest(
    robot: Robot, counters: Counters, drive: RobotDrive, held: Mapping[str, float | None], steps: int = STEPS
) -> Rest | None:
    """What a short fit leaves; None where the drive is too short to tell."""
    delay = held_delay(held, drive)
    if delay is None:
        delay = 0.0
        with suppress(InputError):  # a wrong reading of the log shows any delay
            delay = first_delay(counters, drive)
    try:
        drive = used_looks(drive, delay)
        model = Model(robot, counters, [drive])
        known = {kind for number in model.learned for kind in (number.name, number.kind)}
        kept = held_numbers(model, {name: held[name] for name in held if name in known}, counters.where)
        values = _begin(model, kept)
        free = [i for i, one in enumerate(model.learned) if i not in kept and one.kind not in CLOCKS]
        values = solve(model, values, free, ROUGH, prior=1.0, steps=steps)
        rest = _left(model, values)
        if steps and rest is not None and rest.doubtful and screened(model, values, ROUGH):
            values = solve(model, values, free, ROUGH, prior=1.0, steps=steps)
            again = _left(model, values)  # none where all of it is left out
            rest = rest if again is None or again.way > rest.way else again
    except InputError:
        return None
    return rest


def _begin(model: Model, held: Mapping[int, float]) -> Array:
    """Numbers to begin from: the reference turned on the robot as its steps beside the wheels' have it."""
    values, drive = model.first.copy(), model.drives[0]
    values[[*held]] = [*held.values()]
    yaw = model.index(MOUNT[2])
    if yaw >= 0 and yaw not in held:
        made = model.stretched(values, [])[0][0].motions
        seen = along_body(drive.z[:-1, 2] + 0.5 * np.diff(drive.z[:, 2]), np.diff(drive.z, axis=0))
        went = along_body(0.5 * made[:, 2], made)
        went, seen = went[:, 0] + 1j * went[:, 1], seen[:, 0] + 1j * seen[:, 1]
        values[yaw] = -float(np.angle(np.sum(seen * np.conj(went))))
    return values


def _left(model: Model, values: Array) -> Rest | None:
    made = model.stretched(values, [])
    fitted = Fit(values, [], np.zeros((0, 0)), ROUGH, [])
    windows, length = windows_of(model, fitted)
    errors = window_ends(model, fitted, windows)
    if len(errors) < SIDE:
        return None
    counted = sum(float(one.counted.sum()) for one, _ in made)
    twice = sum(float(np.abs(one.spare).sum()) for one, _ in made)
    way = float(np.median(off_by(errors))) / length
    return Rest(way, twice / counted, _astray(model.drives[0], made[0][0]), float(model.mount(values)[2]))


def _astray(drive: RobotDrive, made: Stretches) -> float:
    """Of the hitch that follows worst, how far it turned otherwise, as a share of its turns; 0 without."""
    turned = np.diff(at_times(drive.at - drive.delay, drive.t, drive.own[:, drive.hitches]), axis=0)
    off = np.abs(made.astray[:, drive.hitches]).sum(axis=0) / np.maximum(np.abs(turned).sum(axis=0), 1e-9)
    return float(off.max(initial=0.0))


def _others(robot: Robot, counters: Counters, drive: RobotDrive) -> Iterator[tuple[str, RobotDrive]]:
    """Other readings of a log, each in words: "with ..."."""
    names, many = counters.names, len(counters.names)
    pairs = [*combinations(range(many), 2)]
    for i, j in pairs:
        swapped = [*range(many)]
        swapped[i], swapped[j] = j, i
        yield f"{names[i]} and {names[j]} swapped", replace(drive, counts=_columns(drive.counts, swapped))
    sides = [
        names.index(_other_side(name)) if _other_side(name) in names else i for i, name in enumerate(names)
    ]
    if many > 2 and sorted(sides) == [*range(many)] != sides:
        yield "left and right wheels swapped", replace(drive, counts=_columns(drive.counts, sides))
    if drive.rows == 2:
        yield "the reference's y the other way round", replace(drive, z=_negated(drive.z, 1))
    else:
        yield "the reference's y and heading the other way round", replace(drive, z=_negated(drive.z, 1, 2))
        yield "the reference's heading the other way round", replace(drive, z=_negated(drive.z, 2))
        yield "the reference's y the other way round", replace(drive, z=_negated(drive.z, 1))
    for i, name in enumerate(names):
        yield f"the other sign of {name}", replace(drive, counts=_negated(drive.counts, i))
    if many > 1:
        yield "the other sign of all wheels", replace(drive, counts=-drive.counts)
    measured = [i for i in range(drive.own.shape[1]) if np.ptp(drive.own[:, i]) > 0.0]
    for i in measured:
        joint = robot.q_names[3 + i]
        yield f"the other sign of {joint}", replace(drive, own=_negated(drive.own, i))
    if len(measured) > 1:
        yield "the other sign of all joints", replace(drive, own=-drive.own)
    for i, j in combinations(measured, 2):
        swapped = [*range(drive.own.shape[1])]
        swapped[i], swapped[j] = j, i
        joints = robot.q_names[3 + i], robot.q_names[3 + j]
        yield f"{joints[0]} and {joints[1]} swapped", replace(drive, own=_columns(drive.own, swapped))


def _negated(table: Array, *columns: int) -> Array:
    made = table.copy()
    made[:, [*columns]] *= -1.0
    return made


def _columns(table: Array, order: list[int]) -> Array:
    return np.ascontiguousarray(table[:, order])


def _other_side(name: str) -> str:
    """A wheel's name with left for right."""
    return "_".join({"left": "right", "right": "left"}.get(word, word) for word in name.split("_"))
