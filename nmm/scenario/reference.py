"""The keys of a scenario as text: what `nmm scenarios --keys` prints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from pydantic_core import PydanticUndefined

from nmm.kinds import RESOLVERS
from nmm.scenario.collisions import CollisionsPart
from nmm.scenario.conditions import CONDITION_PARTS
from nmm.scenario.functions import FUNCTION_PARTS, REFERENCE_PARTS
from nmm.scenario.goals import GoalPart, RetreatPart
from nmm.scenario.keys import Part
from nmm.scenario.limits import BoundPart, LimitsPart
from nmm.scenario.objectives import OBJECTIVE_PARTS, TermPart
from nmm.scenario.obstacles import ObstaclePart
from nmm.scenario.resolvers import RESOLVER_PARTS
from nmm.scenario.robot import ArmPart, MountedPart, RobotPart
from nmm.scenario.schema import ScenarioPart
from nmm.scenario.shapes import SHAPE_PARTS
from nmm.scenario.steering import SteeringPart
from nmm.scenario.tasks import TASK_PARTS


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
    for kind, task in TASK_PARTS.items():
        yield _section(f"task, kind: {kind}", task)
    for kind, condition in CONDITION_PARTS.items():
        yield _section(f"task.when, kind: {kind}", condition)
    for kind, reference in REFERENCE_PARTS.items():
        if reference is not FUNCTION_PARTS.get(kind):
            yield _section(f"reference, kind: {kind}", reference)
    for kind, objective in OBJECTIVE_PARTS.items():
        yield _section(f"objective, kind: {kind}", objective)
    yield _section("objective.terms", TermPart)
    for kind, resolver in RESOLVER_PARTS.items():
        called = RESOLVERS.words(kind)
        yield _section(f"resolver, kind: {kind}", resolver, f"{called[0].upper()}{called[1:]}. ")
    yield _section("until", GoalPart)
    yield _section("retreat", RetreatPart)
    yield _section("limits", LimitsPart)
    yield _section("limits.bounds: a task's function and its keys, with these", BoundPart)
    yield _section("collisions", CollisionsPart)
    yield _section("collisions.obstacles", ObstaclePart)
    for kind, shape in SHAPE_PARTS.items():
        yield _section(f"collisions.obstacles.shape, kind: {kind}", shape)
    yield _section("steering", SteeringPart)


def _section(title: str, part: type[Part], called: str = "") -> Section:
    keys = []
    for name, field in part.model_fields.items():
        if name == "kind":
            continue
        default = field.get_default(call_default_factory=True)
        text = "required" if default is PydanticUndefined else _text(default)
        keys.append((name, text, field.description or ""))
    return Section(title, called + " ".join((part.__doc__ or "").split()), keys)


def _text(value: object) -> str:
    """A default as the file would say it; nothing where there is none."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, SteeringPart):
        return "true"
    if isinstance(value, list) and value:
        if all(isinstance(item, str) for item in value):
            return "".join(value)
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value or "")
