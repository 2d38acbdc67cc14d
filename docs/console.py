"""Commands in the documentation with what they print: `python docs/console.py` runs and rewrites them.

A block ```console holds what the commands in it print ("$ nmm ..."). They run in an empty folder, one after
the other through the page, so that a page may run a scenario and analyse the run. The tests compare them. A
block ```text with commands is written too, but not compared: its numbers are rounding, or chaotic.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import tempfile
from pathlib import Path

FOLDER = Path(__file__).parent
#: Pages whose blocks are written here.
PAGES = ("singularities.md", "sweeps.md")
COMPARED, WRITTEN = ("console",), ("console", "text")

_BLOCK = re.compile(r"^```(?P<kind>\w+)\n(?P<body>\$ .*?)^```$", re.DOTALL | re.MULTILINE)
_PROMPT = "$ "


def rewritten(text: str, kinds: tuple[str, ...] = WRITTEN) -> str:
    """The page with the commands in blocks of these kinds run anew, in a folder of its own."""

    def anew(block: re.Match[str]) -> str:
        if block["kind"] not in kinds:
            return block.group()
        commands = [line for line in block["body"].splitlines() if line.startswith(_PROMPT)]
        printed = "\n".join(f"{command}\n{_run(command)}".rstrip() for command in commands)
        return f"```{block['kind']}\n{printed}\n```"

    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            return _BLOCK.sub(anew, text)
        finally:
            os.chdir(before)


def _run(command: str) -> str:
    """What a command prints, errors included, as a terminal would show it."""
    from nmm.cli.exit_status import status_of

    program, *arguments = shlex.split(command.removeprefix(_PROMPT))
    if program != "nmm":
        raise ValueError(f"expected a command of nmm, got {command!r}")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        status_of(arguments)
    return printed.getvalue().strip("\n")


if __name__ == "__main__":
    for name in PAGES:
        page = FOLDER / name
        page.write_text(rewritten(page.read_text(encoding="utf-8")), encoding="utf-8")
