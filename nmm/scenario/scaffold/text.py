"""A scenario's text: every key with a comment that says what it is and what else may stand there."""

from collections.abc import Iterator, Mapping
from textwrap import wrap
from typing import Any

import yaml

from nmm.base.kinds import OBJECTIVES, REFERENCES, RESOLVERS, TASKS
from nmm.base.text_format import printable

WIDTH = 116


def text_of(data: Mapping[str, Any], head: str, words: Mapping[str, str]) -> str:
    """YAML of the scenario's keys in order, with a head, and by key a comment on its value."""
    lines = [*_comment(head), ""]
    for key, value in data.items():
        about = " ".join(text for text in (_ABOUT.get(key, ""), words.get(key, "")) if text)
        lines += [*_comment(about), *_entry(key, value), ""]
    for key, about in words.items():
        if key not in data:
            lines += [*_comment(about), ""]
    return "\n".join([*lines, *_comment(_MORE)]) + "\n"


def _comment(text: str) -> list[str]:
    lines = wrap(printable(text), WIDTH - 2, break_long_words=False, break_on_hyphens=False)
    return [f"# {line}" for line in lines]


def _entry(key: str, value: Any) -> Iterator[str]:
    """The key with its value: short ones on its line, mappings and lists below it."""
    flow = _flow(value)
    if not isinstance(value, Mapping | list) or len(key) + 2 + len(flow) <= WIDTH:
        yield f"{key}: {flow}"
        return
    text = yaml.dump(value, Dumper=_Dumper, width=WIDTH - 4, sort_keys=False, allow_unicode=True)
    yield f"{key}:"
    yield from (f"  {line}" for line in text.splitlines())


def _flow(value: Any) -> str:
    text = yaml.dump(
        value, Dumper=_Dumper, default_flow_style=True, width=10**6, sort_keys=False, allow_unicode=True
    )
    return text.removesuffix("\n").removesuffix("\n...")


class _Dumper(yaml.SafeDumper):
    """Lists of numbers and small mappings in one line; no anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_sequence(
        self, tag: str, sequence: Any, flow_style: bool | None = None
    ) -> yaml.SequenceNode:
        plain = not any(isinstance(item, Mapping | list) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain or flow_style)


_ABOUT = {
    "title": "A line that says what it shows.",
    "robot": "The robot: a bundled name (nmm robots), a .urdf, .xacro or .xml file, or a mapping with "
    "source, platform, lock, ... (docs/robots.md).",
    "q0": "Where it starts, m and rad, by name, 0 for the rest; posture: NAME takes one of its SRDF "
    "(nmm info tells them).",
    "duration": "How long, s.",
    "dt": "Time between samples, s. Beside it: method, rk4, midpoint, euler, zoh, zoh_midpoint or adaptive.",
    "task": f"What it does: a task, or a list of them. kind: {', '.join(TASKS)}. reference: "
    f"{', '.join(REFERENCES)}. gain, 1/s, is how fast an error decays.",
    "objective": "What the motion that is left over is used for. kind: "
    f"{', '.join(OBJECTIVES)} (docs/objectives.md).",
    "resolver": f"How the redundancy is resolved. kind: {', '.join(RESOLVERS)} (docs/resolvers.md).",
    "collisions": "What the robot keeps away from, by distance, m; self_collisions: true, from itself, too "
    "(docs/sensed.md, docs/collisions.md).",
    "limits": "What inputs and joints are kept within: what the robot's file says, and what is here "
    "(docs/limits.md).",
}
_MORE = (
    "More keys: collisions (obstacles, and the robot itself), until (a target to reach), retreat, steering: "
    "docs/scenarios.md, or nmm scenarios --keys."
)
