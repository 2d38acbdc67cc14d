"""Commands in the documentation with what they print: `python docs/console.py` runs and rewrites them.

A block ```console that begins with "$ nmm ..." holds what its commands print. They run in an empty folder,
one after the other through the page, so that a page may run a scenario and analyse the run.
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
#: Pages whose blocks are written here; the tests compare them.
PAGES = ("singularities.md",)

_BLOCK = re.compile(r"(?<=^```console\n)(.*?)(?=^```$)", re.DOTALL | re.MULTILINE)
_PROMPT = "$ "


def rewritten(text: str) -> str:
    """The page with every console block run anew, in a folder of its own."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            return _BLOCK.sub(lambda block: _run_block(block.group()), text)
        finally:
            os.chdir(before)


def _run_block(block: str) -> str:
    commands = [line for line in block.splitlines() if line.startswith(_PROMPT)]
    return "\n".join(f"{command}\n{_run(command)}".rstrip() for command in commands) + "\n"


def _run(command: str) -> str:
    """What a command prints, errors included, as a terminal would show it."""
    from nmm.cli.app import status_of

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
