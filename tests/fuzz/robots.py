"""Robots' files with something changed in them: refused in a line, or robots whose wheels roll."""

from __future__ import annotations

import re
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import xacro
from hypothesis import strategies as st

import nmm
from nmm.base.bundled import bundled_robots
from nmm.base.errors import NmmError

from .hunting import Hunt, refused
from .mutants import CUTS, VALUES, damaged

NAMES = ("unicycle_2r", "car_base", "small_arm")

CASES = st.fixed_dictionaries(
    {
        "robot": st.sampled_from(NAMES),
        "attributes": st.lists(
            st.tuples(st.floats(0.0, 1.0, exclude_max=True), VALUES), min_size=0, max_size=3
        ),
        "elements": st.lists(
            st.tuples(st.sampled_from(["drop", "repeat"]), st.floats(0.0, 1.0, exclude_max=True)), max_size=2
        ),
        "cuts": st.one_of(st.just([]), CUTS),
    }
)


def check(case: Any) -> str:
    text = _text(case["robot"])
    for share, value in case["attributes"]:
        found = list(re.finditer(r'="([^"]*)"', text))
        one = found[int(share * len(found))]
        safe = value.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
        text = f"{text[: one.start(1)]}{safe}{text[one.end(1) :]}"
    for how, share in case["elements"]:
        found = list(re.finditer(r"<(\w+)[^<>]*/>|<(joint|link|visual|collision) .*?</\2>", text, re.DOTALL))
        if found:
            one = found[int(share * len(found))]
            text = text[: one.start()] + (2 if how == "repeat" else 0) * one[0] + text[one.end() :]
    raw = damaged(text.encode("utf-8", "surrogatepass"), case["cuts"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_bytes(raw)
        try:
            robot = nmm.load(path)
        except NmmError as error:
            return refused(error)
    lawful(robot)
    return "loaded"


def lawful(robot: nmm.Robot) -> None:
    """A G = 0, and J = (∂f/∂q) S of each frame is that of finite differences."""
    rng = np.random.default_rng(0)
    lower, upper = np.clip(robot.q_limits, -0.4, 0.4).T
    q = rng.uniform(np.minimum(lower, upper), np.maximum(lower, upper))
    n_p = robot.platform.n_p
    S = robot.S(q)
    assert np.all(np.isfinite(S))
    size = 1.0 + np.abs(S).max(initial=0.0)
    assert np.abs(robot.platform.A(q[:n_p]) @ robot.platform.G(q[:n_p])).max(initial=0.0) <= 1e-12 * size
    here, h = nmm.Configuration(robot, q), 1e-6
    frame = robot.frames[-1]
    where = here.placement(frame)
    far = 1.0 + float(np.abs(where.translation).max())
    assert np.isfinite(far), "a frame that is nowhere"
    for column in S.T:
        length = max(1.0, float(np.abs(column).max()))
        there = [nmm.Configuration(robot, q + s * h * column / length).placement(frame) for s in (-1.0, 1.0)]
        moved = np.concatenate(
            [
                (there[1].translation - there[0].translation) / (2 * h),
                pin.log3(there[1].rotation @ there[0].rotation.T) / (2 * h),
            ]
        )
        jacobian = here.jacobian(frame) @ column / length
        np.testing.assert_allclose(jacobian, moved, rtol=0, atol=2e-8 * far * size, err_msg=frame)


@cache
def _text(name: str) -> str:
    return str(xacro.process_file(str(bundled_robots()[name])).toxml())


HUNT = Hunt("robots", CASES, check)
