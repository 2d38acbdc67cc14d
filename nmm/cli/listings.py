"""scenarios and robots: what is bundled."""

from __future__ import annotations

import re

from nmm.bundled import bundled_robots, bundled_scenarios
from nmm.cli.output import show_table, show_text


def list_scenarios() -> None:
    """The bundled scenarios."""
    from nmm.scenario.document import read_file

    titles = [[name, read_file(path).data.get("title", "")] for name, path in bundled_scenarios().items()]
    show_table(["scenario", "what it shows"], titles)


def list_keys() -> None:
    """The keys of a scenario file."""
    from nmm.scenario.reference import sections

    for section in sections():
        show_text(f"{section.title} ({section.summary.rstrip('.')})")
        if section.keys:
            show_table(["key", "default", "meaning"], section.keys)
        show_text()


def list_robots() -> None:
    """The bundled robots, with the platform of those whose files declare one."""
    rows = []
    for name, path in bundled_robots().items():
        text = path.read_text(encoding="utf-8")
        about = re.search(r"<!--\s*(.+?)\s*(?:\n\s*\n|-->)", text, re.DOTALL)
        declared = re.search(r'<nmm\s+platform="([^"]+)"', text)
        platform = f" Platform: {declared.group(1)}." if declared else ""
        arguments = re.findall(r'<xacro:arg\s+name="([^"]+)"\s+default="([^"]*)"', text)
        rows.append(
            [
                name,
                (" ".join(about.group(1).split()) if about else "") + platform,
                ", ".join(f"{argument}={default}" for argument, default in arguments),
            ]
        )
    show_table(["robot", "what it is", "arguments (m, rad)"], rows)
