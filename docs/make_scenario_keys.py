"""Write docs/scenarios.md from the scenario's schema: `python docs/make_scenario_keys.py`."""

from __future__ import annotations

from pathlib import Path

from nmm.scenario.reference import sections

PAGE = Path(__file__).with_name("scenarios.md")

HEAD = """# Scenarios

A scenario is a YAML file: a robot, a start, a task, an objective and a resolver. `nmm scenarios` lists the
bundled ones; copy one and change it, or let [`nmm init ROBOT`](command_line.md#nmm-init) write one for
your robot. Any key can be set from the command line by its dotted path, lists counting from 0:

    nmm run unicycle_2r_position --set dt=0.001 --set resolver.alpha=5 --set task.0.gain=2
    nmm run my_scenario.yaml --resolver pg

Numbers may be arithmetic with pi (`5/4*pi`). Units are metres, radians and seconds. A key that does not
exist, a frame that the robot does not have, text where a number belongs: each is one line that names the
file, the key and what was expected.

```yaml
%s```

A reference that another one is made from stands once, and is named by its path wherever a reference may
stand: a bearing's or velocity's `of`, a point, a direction, an objective's target, another task's
`reference`.

```yaml
task:
  - {kind: position, frame: ee, axes: xy, reference: {kind: circle, center: [2, 2], radius: 3, rate: 0.25}}
  - {kind: heading, frame: link2, reference: {kind: bearing, of: task.0.reference, towards: [6, 2]}}
```

`--set task.0.reference.radius=2` then changes both. Below an anchor (`&`) of YAML it changes that place
alone, with a warning that names those that the anchor ties to it.

Below, every key. (`docs/make_scenario_keys.py` writes this page from the schema that checks the files.)
"""


def page() -> str:
    """The page's text."""
    from nmm.bundled import bundled_scenarios

    example = bundled_scenarios()["unicycle_2r_link_pointing"].read_text(encoding="utf-8")
    parts = [HEAD % example]
    for section in sections():
        parts.append(f"## {section.title}\n\n{section.summary}\n")
        if section.keys:
            rows = [f"| `{key}` | {_cell(default)} | {_cell(text)} |" for key, default, text in section.keys]
            parts.append("\n".join(["| key | default | |", "|---|---|---|", *rows]) + "\n")
    return "\n".join(parts)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
