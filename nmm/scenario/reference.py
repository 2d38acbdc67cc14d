"""The keys of a scenario as text: what `nmm scenarios --keys` prints."""

import re
from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from pydantic_core import PydanticUndefined

from nmm.base.kinds import REFERENCES, RESOLVERS, TASKS
from nmm.scenario.collisions import OBSTACLE_PARTS, CollisionsPart, ObstaclePart
from nmm.scenario.disturbances import DisturbancesPart, LocalisationPart
from nmm.scenario.functions import FUNCTION_PARTS, REFERENCE_PARTS, CameraFaultsPart
from nmm.scenario.keys import KeyedPart
from nmm.scenario.limits import (
    LIMIT_PARTS,
    BoundPart,
    GoalPart,
    LimitsPart,
    RetreatPart,
    SteeringPart,
)
from nmm.scenario.objectives import OBJECTIVE_PARTS, TermPart
from nmm.scenario.resolvers import RESOLVER_PARTS
from nmm.scenario.robot import ArmPart, MountedPart, RobotPart
from nmm.scenario.scene import CarriedPart, ScenePart, SceneryPart
from nmm.scenario.schema import ScenarioPart, schema
from nmm.scenario.sections import section_class, section_names
from nmm.scenario.tasks import CONDITION_PARTS, TASK_PARTS

YAML = {"None": "null", "True": "true", "False": "false"}


class ReferenceSection(NamedTuple):
    """A part of a scenario: where it stands, what it is, and its keys as (key, default, description)."""

    title: str
    summary: str
    keys: list[tuple[str, str, str]]


def sections() -> Iterator[ReferenceSection]:
    """The parts of a scenario, from the top; a reference that is a task's function too is listed once."""
    yield _section("the file", schema())
    yield _section("robot", RobotPart)
    yield _section("robot, with arms mounted", MountedPart)
    yield _section("robot.arms", ArmPart)
    yield from _kinds("task", TASK_PARTS)
    yield from _kinds("task.when", CONDITION_PARTS)
    own = {kind: part for kind, part in REFERENCE_PARTS.items() if part is not FUNCTION_PARTS.get(kind)}
    yield from _kinds("reference", own)
    yield _section("reference.faults", CameraFaultsPart)
    yield from _kinds("objective", OBJECTIVE_PARTS)
    yield _section("objective.terms", TermPart)
    yield from _kinds("resolver", RESOLVER_PARTS, {kind: RESOLVERS.words(kind) for kind in RESOLVER_PARTS})
    yield _section("until", GoalPart)
    yield _section("disturbances", DisturbancesPart)
    yield _section("disturbances.localisation", LocalisationPart)
    yield _section("retreat", RetreatPart)
    yield from _of_plugins()
    yield _section("limits", LimitsPart)
    yield _section("limits.bounds: a task's function and its keys, with these", BoundPart)
    for kind, part in LIMIT_PARTS.items():
        yield _section(f"limits.bounds, kind: {kind}", part)
    yield _section("collisions", CollisionsPart)
    yield _section("collisions.obstacles", ObstaclePart)
    yield from _kinds("collisions.obstacles.shape", OBSTACLE_PARTS)
    yield _section("steering", SteeringPart)
    yield _section("scene", ScenePart)
    yield _section("scene.carried", CarriedPart)
    yield _section("scene.scenery", SceneryPart)


def _of_plugins() -> Iterator[ReferenceSection]:
    for key, addition in section_names(ScenarioPart.model_fields).items():
        if (section := section_class(addition)) is not None:
            yield _section(key, section)
            for place, part in section.listed.items():
                yield _section(place, part)


def _kinds(
    where: str, parts: Mapping[str, type[KeyedPart]], called: Mapping[str, str] = MappingProxyType({})
) -> Iterator[ReferenceSection]:
    """The kinds of a part, one by one; keys that all of them have stand once, before."""
    sections = []
    for kind, part in parts.items():
        words = called.get(kind, "")
        section = _section(
            f"{where}, kind: {kind}", part, f"{words[0].upper()}{words[1:]}. " if words else ""
        )
        sections.append(section)
    shared = [key for key in sections[0].keys if all(key in section.keys for section in sections)]
    if shared:
        yield ReferenceSection(f"{where}, of any kind", "Beside the kind's own keys.", shared)
    for section in sections:
        yield section._replace(keys=[key for key in section.keys if key not in shared])


def _section(title: str, part: type[KeyedPart], called: str = "") -> ReferenceSection:
    keys = []
    for name, field in part.model_fields.items():
        if name == "kind":
            continue
        default = field.get_default(call_default_factory=True)
        text = "required" if default is PydanticUndefined else _text(default)
        keys.append((name, text, _in_yaml(field.description or "")))
    return ReferenceSection(title, called + " ".join((part.__doc__ or "").split()), keys)


def _in_yaml(text: str) -> str:
    """A parameter's description as a key's: YAML's words, and kinds in place of their classes."""
    text = re.sub(r"\b(\w+)=(True|False)\b", r"\1: \2", text)
    text = re.sub(r"\b(None|True|False)\b", lambda match: YAML[match[1]], text)
    return re.sub(r"`(\w+)`", lambda match: f"`{_kinds_of_classes().get(match[1], match[1])}`", text)


@cache
def _kinds_of_classes() -> dict[str, str]:
    return {kinds[name].__name__: name for kinds in (TASKS, REFERENCES) for name in kinds}


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, SteeringPart):
        return "true"
    if isinstance(value, GoalPart):
        return f"{{m: {value.m:g}, rad: {value.rad:g}}}"
    if isinstance(value, list) and value:
        if all(isinstance(item, str) for item in value):
            return "".join(value)
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value or "")
