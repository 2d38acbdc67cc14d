"""What people call parts and postures of a robot, as an SRDF says it; and which links it lets touch."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from nmm.base.errors import no_such
from nmm.base.findings import Finding

#: Coordinates by name, m and rad, and under the key `posture` one or several postures.
Named = Mapping[str, float | str | Sequence[str]]
#: Stands among the names of coordinates for those of a posture.
POSTURE = "posture"


class NamedPostures(dict[str, Mapping[str, float]]):
    """Named postures: coordinates by name, m and rad; `InputError` lists the names for one that is none.

    Examples
    --------
    >>> postures = nmm.extending.NamedPostures({"home": {"q1": 0.5, "q2": 1.0}})
    >>> postures.within({"posture": "home", "q2": 0.3})
    {'q1': 0.5, 'q2': 0.3}
    """

    def __missing__(self, name: object) -> Mapping[str, float]:
        available = self or {"none, for no SRDF was found beside the robot's file that holds one": None}
        raise no_such(POSTURE, name, available)

    def within(self, values: Named) -> dict[str, float]:
        """Coordinates by name; the key `posture` stands for those of one or several postures. Later postures
        override earlier ones, and the coordinates beside them override all."""
        coordinates = dict(values)
        named = coordinates.pop(POSTURE)
        merged: dict[str, float] = {}
        for name in (named,) if isinstance(named, str) or not isinstance(named, Sequence) else named:
            merged |= self[name] if isinstance(name, str) else self.__missing__(name)
        return {**merged, **coordinates}  # type: ignore[dict-item]  # the caller asks whether they are numbers


@dataclass(frozen=True)
class Semantics:
    """What the SRDF beside a robot's file, or an MJCF file itself, says of it, in the robot's own names.

    Attributes
    ----------
    postures : the coordinates that each state sets, m and rad; a follower is set by the joint that it follows
    groups : the inputs that move each group
    disabled : pairs of links that are not to be kept apart
    files : where it was read
    notes : what of it does not fit the robot
    start : where its file has it stand at first, m and rad; what is not there is at zero

    Examples
    --------
    >>> postures = nmm.extending.NamedPostures({"home": {"q1": 0.5}})
    >>> semantics = nmm.extending.Semantics(postures, groups={"arm": ("q1", "q2")})
    >>> semantics.postures["home"]["q1"], semantics.groups["arm"], nmm.load("unicycle_2r").semantics.files
    (0.5, ('q1', 'q2'), ())
    """

    postures: NamedPostures = field(default_factory=NamedPostures)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    disabled: tuple[tuple[str, str], ...] = ()
    files: tuple[Path, ...] = ()
    notes: tuple[Finding, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)

    def with_arm(self, arm: Semantics, prefix: str, arms_own: Collection[str]) -> Semantics:
        """A platform's with an arm's own joints (not its base's), prefixed; a shared posture sets both."""
        postures = NamedPostures(self.postures)
        for name, values in arm.postures.items():
            own = {prefix + joint: value for joint, value in values.items() if prefix + joint in arms_own}
            if own:
                postures[prefix + name] = {**postures.get(prefix + name, {}), **own}
        groups = dict(self.groups)
        for name, inputs in arm.groups.items():
            members = tuple(prefix + joint for joint in inputs if prefix + joint in arms_own)
            if members:
                groups.setdefault(prefix + name, members)
        disabled = tuple((prefix + first, prefix + second) for first, second in arm.disabled)
        start = {prefix + name: value for name, value in arm.start.items() if prefix + name in arms_own}
        whole = (
            self.disabled + disabled,
            self.files + arm.files,
            self.notes + arm.notes,
            {**self.start, **start},
        )
        return Semantics(postures, groups, *whole)
