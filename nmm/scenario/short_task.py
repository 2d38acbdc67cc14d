"""A task in a word, as people type it: "position:ee:xy", "pose", or a mapping as in a scenario."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import ValidationError

from nmm.base.errors import InputError, expect, expect_known
from nmm.base.kinds import TASKS
from nmm.base.text_format import counted, listed
from nmm.control.functions.function import Function
from nmm.control.functions.program import evaluate
from nmm.control.functions.tasks.task import Task
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.reach import arm_branches, arm_end
from nmm.model.robots.robot import Robot
from nmm.scenario.constructors import POINT, SPELLINGS, STARRED, parameters
from nmm.scenario.functions import FUNCTION_PARTS
from nmm.scenario.keys import KeyedError, as_written, first_error
from nmm.scenario.tasks import TASK_PARTS
from nmm.scenario.yaml_text import dotted, read_text

#: What a text may be.
EXPECTED = "KIND:FRAME:AXES, as in position:ee:xy, or a mapping as in a scenario"


def short_task(text: str, robot: Robot) -> Task | Function:
    """The task of a text; a function of the robot where the text names no reference.

    KIND, KIND:FRAME, KIND:FRAME:AXES or KIND::AXES; without a frame the end of the arm, without axes those
    that the robot can move along; coordinates:q1,q2 and posture:q1,q2 take names. Or a mapping, as in a
    scenario's `task`.
    """
    stripped = text.strip()
    expect(stripped, "task", EXPECTED, text)
    if stripped.startswith("{"):
        data = read_text(stripped, f"task {text}", lines=False).value
    else:
        data = _from_words(stripped, robot)
    expect(isinstance(data, Mapping), f"task {text}", EXPECTED)
    if data.get("kind") is None:
        raise InputError("this key is missing", where=f"task {text}: kind", available=TASKS)
    kind = str(data["kind"])
    expect_known("kind", kind, TASKS, f"task {text}")
    try:
        if "reference" in data:
            return TASK_PARTS[kind].model_validate(dict(data)).build_task(robot)
        return FUNCTION_PARTS[kind].model_validate(dict(data)).build(robot)
    except ValidationError as error:
        wrong = first_error(error, data)
        raise wrong.at(f"task {text}: {dotted(as_written(wrong.place, data))}", InputError) from None
    except KeyedError as error:
        raise error.at(f"task {text}: {dotted(error.place)}", InputError) from None
    except InputError as error:
        raise error.at(f"task {text}") from None


def _from_words(text: str, robot: Robot) -> dict[str, Any]:
    """The mapping that words stand for; the keys of a kind decide which words it has."""
    kind, *words = (word.strip() for word in text.split(":"))
    expect_known("kind", kind, TASKS, f"task {text}")
    part = FUNCTION_PARTS[kind]
    keys = part.model_fields
    if STARRED in keys:
        names = [name.strip() for name in words[0].split(",")] if words and words[0] else None
        if len(words) > 1 or (names is None and keys[STARRED].is_required()) or not all(names or ["-"]):
            raise InputError(where=f"task {text}", expected=f"{kind}:NAME,NAME,...")
        return {"kind": kind} | ({} if names is None else {STARRED: names})
    others = [key for key, field in keys.items() if field.is_required() and key not in ("kind", "frame")]
    if others:
        framed = ["frame: ..."] if "frame" in keys else []
        points = {p.key for p in parameters(part.makes) if SPELLINGS.get(p.annotation) is POINT}
        shown = [f"{key}: {'[1, 0, 1]' if key in points else '...'}" for key in others]
        needed = ", ".join([f"kind: {kind}", *framed, *shown])
        raise InputError(where=f"task {text}", expected=f"a mapping, as in {{{needed}}}")
    data: dict[str, Any] = {"kind": kind}
    frame = words.pop(0) if words and ("frame" in keys or not words[0]) else ""
    if "frame" in keys:
        data["frame"] = frame or _tip(robot, text)
        expect_known("frame", data["frame"], robot.frames, f"task {text}")
    axes = words.pop(0) if words else ""
    if words or (axes and "axes" not in keys):
        raise InputError(where=f"task {text}", expected="KIND:FRAME:AXES, AXES for positions only")
    if "axes" in keys:
        data["axes"] = axes or moving_axes(data, robot)
    return data


def _tip(robot: Robot, text: str) -> str:
    """The end of the arm; of several branches (a head, a tray) that of the one with the most joints."""
    tips = [(len(branch), arm_end(robot, branch[-1])) for branch in arm_branches(robot)]
    ends = sorted(((count, end) for count, end in tips if end), key=lambda pair: -pair[0])
    if not ends or (len(ends) > 1 and ends[0][0] == ends[1][0]):
        names = [f"{end} ({counted(count, 'joint')})" for count, end in ends[:4]]
        what = f"arms end at {listed(names)}" if ends else ""
        expected = f"a frame, as in {text.split(':')[0]}:FRAME"
        raise InputError(what, where=f"task {text}", expected=expected, available=robot.frames)
    return ends[0][1]


def moving_axes(data: Mapping[str, Any], robot: Robot) -> str:
    """Those of x, y, z along which some input moves a position at some of a few configurations."""
    function = FUNCTION_PARTS[data["kind"]].model_validate({**data, "axes": "xyz"}).build(robot)
    lower, upper = np.clip(robot.q_limits, -np.pi, np.pi).T
    rng = np.random.default_rng(0)
    moved = np.zeros(3)
    for _ in range(4):
        configuration = Configuration(robot, robot.following.placed(rng.uniform(lower, upper)))
        moved = np.maximum(
            moved, np.abs(evaluate(function, 0.0, configuration).value_q @ configuration.S).max(axis=1)
        )
    return "".join(axis for axis, motion in zip("xyz", moved, strict=True) if motion > 1e-9) or "xyz"
