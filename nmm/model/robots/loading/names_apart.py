"""Joints and links of a file whose names the platform's coordinates or inputs have: they get others."""

from collections.abc import Container, Iterable, Mapping
from dataclasses import replace
from typing import Any

import pinocchio as pin

from nmm.base.findings import Finding

#: New names by those of the file.
Names = Mapping[str, str]


def frames_among(model: pin.Model, kind: pin.FrameType, taken: Container[str], called: str) -> dict[str, str]:
    """New names, which say what they are `called`, for the frames of a kind that have one of those taken."""
    return _new(model, [f.name for f in list(model.frames)[1:] if f.type == kind and f.name in taken], called)


def joints_among(model: pin.Model, taken: Container[str]) -> dict[str, str]:
    """New names for the joints of a model that have one of those taken."""
    return _new(model, [str(name) for name in list(model.names)[1:] if name in taken], "joint")


def _new(model: pin.Model, names: Iterable[str], kind: str) -> dict[str, str]:
    known = {*map(str, model.names), *(frame.name for frame in model.frames)}
    renamed: dict[str, str] = {}
    for name in dict.fromkeys(names):
        count, new = 1, f"{name}_{kind}"
        while new in known:
            count += 1
            new = f"{name}_{kind}_{count}"
        known.add(new)
        renamed[name] = new
    return renamed


def rename_model(model: pin.Model, names: Names) -> None:
    for joint in range(1, model.njoints):
        model.names[joint] = names.get(str(model.names[joint]), str(model.names[joint]))
    for frame in list(model.frames)[1:]:
        frame.name = names.get(frame.name, frame.name)


def with_names(value: Any, names: Names) -> Any:
    """A name, or all in lists, tuples and mappings, with the new for the old; other values as they are."""
    if isinstance(value, str):
        return names.get(value, value)
    if isinstance(value, Mapping):
        return {with_names(key, names): with_names(item, names) for key, item in value.items()}
    return (
        type(value)(with_names(item, names) for item in value) if isinstance(value, list | tuple) else value
    )


def renamed_findings(findings: Iterable[Finding], names: Names) -> list[Finding]:
    """The findings with other names in their values."""
    return [replace(finding, values=with_names(finding.values, names)) for finding in findings]
