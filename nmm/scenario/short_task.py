"""A task in a word, as people type it: "position:ee:xy", "pose", or a mapping as in a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from pydantic import ValidationError

from nmm.errors import InputError, unknown
from nmm.scenario.document import dotted, read_text
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.functions import DistancePart, PointingPart
from nmm.scenario.keys import KeyedError, as_written, first_error
from nmm.scenario.robot_functions import (
    CenterOfMassPart,
    CoordinatesPart,
    HeadingPart,
    OrientationPart,
    PosePart,
    PositionPart,
    PosturePart,
)
from nmm.scenario.tasks import TASKS

if TYPE_CHECKING:
    from nmm.functions.function import Function
    from nmm.functions.tasks import Task
    from nmm.robots.robot import Robot

#: What a text may be.
EXPECTED = "KIND:FRAME:AXES, as in position:ee:xy, or a mapping as in a scenario"

_PARTS: tuple[type[FunctionPart], ...] = (
    PositionPart,
    OrientationPart,
    PosePart,
    PointingPart,
    HeadingPart,
    DistancePart,
    CenterOfMassPart,
    CoordinatesPart,
    PosturePart,
)


def _by_kind(parts: tuple[type[Any], ...]) -> dict[str, type[Any]]:
    return {str(kind): part for part in parts for kind in get_args(part.model_fields["kind"].annotation)}


def short_task(text: str, robot: Robot) -> Task | Function:
    """The task of a text; a function of the robot where the text names no reference.

    KIND, KIND:FRAME, KIND:FRAME:AXES or KIND::AXES; without a frame the end of the arm, without axes those
    that the robot can move along; coordinates:q1,q2 and posture:q1,q2 take names. Or a mapping, as in a
    scenario's `task`.

    Raises
    ------
    InputError : what the text says wrong, and what there is
    """
    stripped = text.strip()
    if not stripped:
        raise InputError(f"task: expected {EXPECTED}, got nothing")
    if stripped.startswith("{"):
        data = read_text(stripped, f"task {text}", lines=False).data["value"]
    else:
        data = _from_words(stripped, robot)
    if not isinstance(data, Mapping):
        raise InputError(f"task {text}: expected {EXPECTED}")
    with_reference = "reference" in data
    parts = _by_kind(TASKS if with_reference else _PARTS)
    if data.get("kind") is None:
        raise InputError(f"task {text}: kind: this key is missing; expected one of {', '.join(parts)}")
    kind = str(data["kind"])
    if kind not in parts:
        raise InputError(unknown("kind", kind, parts, f"task {text}"))
    try:
        part = parts[kind].model_validate(dict(data))
        made: Task | Function = part.build_task(robot) if with_reference else part.build(robot)
    except ValidationError as error:
        wrong = first_error(error, data)
        raise InputError(f"task {text}: {dotted(as_written(wrong.place, data))}: {wrong.text}") from None
    except KeyedError as error:
        raise InputError(f"task {text}: {dotted(error.place)}: {error.text}") from None
    except InputError as error:
        raise InputError(f"task {text}: {error}") from None
    return made


def _from_words(text: str, robot: Robot) -> dict[str, Any]:
    kind, *words = (word.strip() for word in text.split(":"))
    if kind in ("coordinates", "posture"):
        names = [name.strip() for name in words[0].split(",")] if words and words[0] else None
        if len(words) > 1 or (kind == "coordinates" and names is None) or (names and not all(names)):
            raise InputError(f"task {text}: expected {kind}:NAME,NAME,...")
        return {"kind": kind} | ({} if names is None else {"of": names})
    if kind in ("pointing", "distance"):
        key = "at" if kind == "pointing" else "to"
        raise InputError(
            f"task {text}: expected a mapping, as in {{kind: {kind}, frame: ..., {key}: [1, 0, 1]}}"
        )
    if kind not in _by_kind(_PARTS):
        raise InputError(unknown("kind", kind, _by_kind(_PARTS), f"task {text}"))
    data: dict[str, Any] = {"kind": kind}
    given = words.pop(0) if words and (kind != "center_of_mass" or not words[0]) else ""
    if kind != "center_of_mass":
        data["frame"] = given or _tip(robot, text)
        if data["frame"] not in robot.frames:
            raise InputError(unknown("frame", data["frame"], robot.frames, f"task {text}"))
    axes = words.pop(0) if words else ""
    if words or (axes and kind not in ("position", "center_of_mass")):
        raise InputError(
            f"task {text}: expected KIND:FRAME:AXES, as in position:ee:xy; axes are of positions"
        )
    if kind in ("position", "center_of_mass"):
        data["axes"] = axes or _moving_axes(data, robot)
    return data


def _tip(robot: Robot, text: str) -> str:
    from nmm.robots.loading.tips import tips

    ends = tips(robot)
    if len(ends) != 1:
        available = ", ".join(ends or robot.frames)
        raise InputError(
            f"task {text}: expected a frame, as in {text.split(':')[0]}:FRAME; available: {available}"
        )
    return ends[0]


def _moving_axes(data: dict[str, Any], robot: Robot) -> str:
    """Those of x, y, z along which some input moves the point at some of a few configurations."""
    from nmm.functions.program import evaluate
    from nmm.robots.configuration import Configuration

    function = _by_kind(_PARTS)[data["kind"]].model_validate(data | {"axes": "xyz"}).build(robot)
    lower, upper = np.clip(robot.q_limits, -np.pi, np.pi).T
    rng = np.random.default_rng(0)
    moved = np.zeros(3)
    for _ in range(4):
        here = Configuration(robot, robot.following.placed(rng.uniform(lower, upper)))
        moved = np.maximum(moved, np.abs(evaluate(function, 0.0, here).value_q @ here.S).max(axis=1))
    return "".join(axis for axis, motion in zip("xyz", moved, strict=True) if motion > 1e-9) or "xyz"
