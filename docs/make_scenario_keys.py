"""Write docs/scenarios.md from the scenario's schema: `python docs/make_scenario_keys.py`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path

from nmm.scenario.reference import ReferenceSection, sections

PAGE = Path(__file__).with_name("scenarios.md")
KIND, ANY = ", kind: ", ", of any kind"
Key = tuple[str, str, str]

HEAD = """# Scenarios

A scenario is a YAML file: a robot, a start, a task, an objective and a resolver. Copy a bundled one
(`nmm scenarios`) or let [`nmm init ROBOT`](command_line.md#nmm-init) write one for your robot. `--set` sets
any key by its dotted path; lists count from 0:

    nmm run unicycle_2r_position --set dt=0.001 --set resolver.alpha=5 --set task.0.gain=2
    nmm run my_scenario.yaml --resolver pg

Numbers may be arithmetic with pi (`5/4*pi`). Units are metres, radians and seconds. A wrong key or value
gives one line with the file, the key and what was expected.

```yaml
robot: unicycle_2r
q0: {x: -1, y: -1, theta: pi}
duration: 25
task:
  - {kind: position, frame: ee, axes: xy,
     reference: {kind: circle, center: [2, 2], radius: 3, rate: 0.08*pi}}
  - {kind: heading, frame: link2,
     reference: {kind: bearing, of: task.0.reference, towards: [6, 2]}}
objective: {kind: quadratic, terms: [{of: {theta: 1, q1: 1, q2: 1}, target: 0}]}
resolver: {kind: rg, alpha: 10}
```

A reference may be named by its path wherever one may stand, as `task.0.reference` here;
`--set task.0.reference.radius=2` then changes both. Where YAML anchors (`&`) share a value, `--set` changes
one place and warns about the others.

All keys follow, as `nmm scenarios --keys` prints them. In each table, keys that several kinds have come
first; a kind's row (bold) names those that it also has, and its own keys follow.
"""


def page() -> str:
    """The page's text."""
    parts = [HEAD]
    for top, found in groupby(sections(), lambda section: re.split(r"[.,:]", section.title)[0]):
        group = list(found)
        summary = "" if ", " in group[0].title else f"\n{group[0].summary}\n"
        rows = "\n".join(_rows(group))
        parts.append(f"## {top}\n{summary}\n| key | default | |\n|---|---|---|\n{rows}\n")
    return "\n".join(parts)


def _rows(group: list[ReferenceSection]) -> Iterator[str]:
    """A part's keys, those of its kinds, and those of its parts, each after a row with its name."""
    told: list[Key] = []
    for where, found in groupby(group, lambda section: section.title.partition(KIND)[0]):
        kinds = list(found)
        if KIND in kinds[0].title:
            yield from _of_kinds(kinds, f"{where}: " if "." in where else "")
            continue
        (section,) = kinds
        if section is not group[0] and ANY not in where:
            also = [f"`{key[0]}`" for key in section.keys if key in told]
            text = f"{section.summary} Also {', '.join(also)}." if also else section.summary
            yield _row((where, "", text), "**")
        yield from _merged(key for key in section.keys if key not in told)
        told += section.keys


def _of_kinds(kinds: list[ReferenceSection], where: str) -> Iterator[str]:
    """Keys that several kinds have; then each kind, what it is, which of these it has, and its own keys."""
    count = Counter((name, text) for section in kinds for name, _, text in section.keys)
    texts: dict[str, str] = {}
    for (name, text), times in count.most_common():
        if times > 1:
            texts.setdefault(name, text)
    every = [key for section in kinds for key in section.keys if texts.get(key[0]) == key[2]]
    shared = {name: Counter(key for key in every if key[0] == name).most_common(1)[0][0] for name in texts}
    yield from _merged(shared.values())
    for section in kinds:
        own = [key for key in section.keys if key not in every]
        also = [
            f"`{key[0]}`" if key == shared[key[0]] else f"`{key[0]}` ({key[1]})"
            for key in section.keys
            if key in every
        ]
        told = f"{section.summary} Also {', '.join(also)}." if also else section.summary
        yield _row((where + section.title.partition(KIND)[2], "", told), "**")
        yield from _merged(own)


def _merged(keys: Iterable[Key]) -> Iterator[str]:
    """A row for each key, and one for neighbours that say the same."""
    for text, found in groupby(keys, lambda key: key[2]):
        names, defaults = zip(*(key[:2] for key in found), strict=True)
        said = defaults[:1] if len({*defaults}) == 1 else defaults
        yield _row(("`, `".join(names), ", ".join(said), text), "`")


def _row(key: Key, mark: str) -> str:
    name, default, text = (cell.replace("|", "\\|").replace("\n", " ") for cell in key)
    plain = re.sub(r"(`[^`]*`)|\*", lambda found: found[1] or r"\*", text)
    return f"| {mark}{name}{mark} | {default} | {plain} |"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
