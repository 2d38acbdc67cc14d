"""The keys of a scenario as text: what `nmm scenarios --keys` prints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, get_args

from pydantic_core import PydanticUndefined

from nmm.scenario.functions import REFERENCES
from nmm.scenario.keys import Part
from nmm.scenario.objectives import OBJECTIVES, TermPart
from nmm.scenario.resolvers import PARTS
from nmm.scenario.robot import ArmPart, MountedPart, RobotPart
from nmm.scenario.schema import ScenarioPart
from nmm.scenario.tasks import TASKS


class Section(NamedTuple):
    """A part of a scenario: where it stands, what it is, and its keys as (key, default, description)."""

    title: str
    summary: str
    keys: list[tuple[str, str, str]]


def sections() -> Iterator[Section]:
    """The parts of a scenario, from the top; a reference that is a task's function too is told once."""
    yield _section("the file", ScenarioPart)
    yield _section("robot", RobotPart)
    yield _section("robot, with arms mounted", MountedPart)
    yield _section("robot.arms", ArmPart)
    for task in TASKS:
        yield _section(f"task, kind: {_kind(task)}", task)
    for reference in REFERENCES:
        if not any(issubclass(task, reference) for task in TASKS):
            yield _section(f"reference, kind: {_kind(reference)}", reference)
    for objective in OBJECTIVES:
        yield _section(f"objective, kind: {_kind(objective)}", objective)
    yield _section("objective.terms", TermPart)
    for kind, resolver in PARTS.items():
        yield _section(f"resolver, kind: {kind}", resolver)


def _kind(part: type[Part]) -> str:
    return str(get_args(part.model_fields["kind"].annotation)[0])


def _section(title: str, part: type[Part]) -> Section:
    keys = []
    for name, field in part.model_fields.items():
        if name == "kind":
            continue
        default = field.get_default(call_default_factory=True)
        text = "required" if default is PydanticUndefined else _text(default)
        keys.append((name, text, field.description or ""))
    summary = " ".join((part.__doc__ or "").split())
    return Section(title, summary, keys)


def _text(value: object) -> str:
    """A default as the file would say it; nothing where there is none."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list) and value:
        if all(isinstance(item, str) for item in value):
            return "".join(value)
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value or "")
