"""Joints and links of a file whose names the platform's coordinates or inputs have: they get others."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pinocchio as pin

from nmm.base.findings import Finding
from nmm.model.robots.loading.chain import CHAIN
from nmm.model.robots.loading.check import RESERVED
from nmm.model.robots.loading.locking import Locked
from nmm.model.robots.loading.source import Source

#: New names by those of the file.
Names = Mapping[str, str]


def apart(source: Source) -> tuple[Source, dict[str, str]]:
    """The source without the names of a platform's coordinates, and what it has for them."""
    if source.on_chain:
        return source, {}
    model = source.model
    links, fixed = (
        [frame.name for frame in list(model.frames)[1:] if frame.type == kind and frame.name in RESERVED]
        for kind in (pin.FrameType.BODY, pin.FrameType.FIXED_JOINT)
    )
    names = _new(model, links, "link") | _new(model, fixed, "joint") | joints_among(model, RESERVED)
    if names:
        model = model.copy()
        _rename(model, names)
        mimic_joints = tuple(one.with_names(names) for one in source.mimic_joints)
        source = replace(source, model=model, mimic_joints=mimic_joints)
    return source, names


def joints_among(model: pin.Model, taken: Container[str]) -> dict[str, str]:
    """New names for the joints of a model that have one of those taken."""
    return _new(model, [str(name) for name in list(model.names)[1:] if name in taken], "joint")


def _new(model: pin.Model, names: Sequence[str], kind: str) -> dict[str, str]:
    known = {*map(str, model.names), *(frame.name for frame in model.frames)}
    found: dict[str, str] = {}
    for name in dict.fromkeys(names):
        count, new = 1, f"{name}_{kind}"
        while new in known:
            count += 1
            new = f"{name}_{kind}_{count}"
        known.add(new)
        found[name] = new
    return found


def _rename(model: pin.Model, names: Names) -> None:
    for joint in range(1, model.njoints):
        model.names[joint] = names.get(str(model.names[joint]), str(model.names[joint]))
    for frame in list(model.frames)[1:]:
        frame.name = names.get(frame.name, frame.name)


def renamed(made: Locked, names: Names) -> Locked:
    """The same with other names, also in its notes; its model is changed."""
    if not names:
        return made
    _rename(made.rebuilt.model, names)
    return replace(
        made,
        rebuilt=replace(made.rebuilt, notes=notes_with(made.rebuilt.notes, names)),
        values=with_names(made.values, names),
        mimicked=with_names(made.mimicked, names),
        mimic_joints=tuple(one.with_names(names) for one in made.mimic_joints),
    )


def with_names(value: Any, names: Names) -> Any:
    """A name, or all that are in lists and mappings, with the new for the old; other values as they are."""
    if isinstance(value, str):
        return names.get(value, value)
    if isinstance(value, Mapping):
        return {with_names(key, names): with_names(item, names) for key, item in value.items()}
    return [with_names(item, names) for item in value] if isinstance(value, list | tuple) else value


def notes_with(notes: Iterable[Finding], names: Names) -> tuple[Finding, ...]:
    """The notes with other names in their values."""
    return tuple(replace(one, values=with_names(one.values, names)) for one in notes)


def of_file(names: Names) -> dict[str, str]:
    """The file's names by the new ones; Pinocchio's name stays taken."""
    return {new: old for old, new in names.items() if old in CHAIN}


def name_notes(names: Names, base: Container[str]) -> list[Finding]:
    """What is called otherwise than in the file, but for the joints of a virtual base: it is replaced."""
    found = {old: new for old, new in names.items() if new not in base}
    return [Finding("names_taken", {"names": found})] if found else []
