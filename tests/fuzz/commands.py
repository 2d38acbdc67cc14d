"""Command lines with options and values of all kinds: a status, a line when it is not 0, and no traceback."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from pathlib import Path
from typing import Any

import typer.main
from hypothesis import strategies as st

from nmm.cli.app import app
from nmm.cli.exit_status import status_of

from .hunting import LONGEST_LINE, Hunt
from .mutants import VALUES

#: They stay until Ctrl-C, or begin a browser or a process for each core.
NOT_HUNTED = {"play", "view", "drive", "render", "sweep", "paper"}
STAYING = {"--play", "--open", "--no-open"}
SUBJECTS = st.sampled_from(["unicycle_2r_position", "unicycle_2r", "car_base", "small_arm", "", "nothing"])
#: Values that options understand, so that not all are refused at once.
WORDS = st.sampled_from(
    ["position", "position:ee:xy", "heading", "pose", "q1=0.3", "q2=0:1", "q1,q2", "duration=0.05", "dt=0.01",
     "resolver.alpha=5", "xy", "rg,pg", "rg", "png", "column", "3", "5", "sigma_min", "out", "page.html"]
)  # fmt: skip

_group: Any = typer.main.get_command(app)
COMMANDS = {name: one for name, one in _group.commands.items() if name not in NOT_HUNTED}


def _options(command: Any) -> list[tuple[str, bool]]:
    """Names of its options, and whether they take a value."""
    options = [one for one in command.params if one.param_type_name == "option"]
    names = [(name, not one.is_flag) for one in options for name in (*one.opts, *one.secondary_opts)]
    return [(name, takes) for name, takes in names if name not in STAYING and not name.startswith("--help")]


@st.composite
def _lines(draw: st.DrawFn) -> list[str]:
    name = draw(st.sampled_from(sorted(COMMANDS)))
    line = [name, draw(SUBJECTS)]
    options = _options(COMMANDS[name])
    some = st.lists(st.sampled_from(options), max_size=3, unique=True) if options else st.just([])
    for option, takes in draw(some):
        line += [option, draw(st.one_of(WORDS, WORDS, VALUES))] if takes else [option]
    if name in ("run", "compare", "laps"):
        line += ["--set", "duration=0.05"]
    return line


def check(line: Any) -> str:
    out, err = io.StringIO(), io.StringIO()
    home = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                status = status_of(line)
        finally:
            os.chdir(home)
    told = err.getvalue()
    assert status in (0, 1, 2), f"status {status}"
    assert "Traceback" not in told + out.getvalue()
    if status != 0:
        assert told.strip(), f"status {status} without a line"
        assert max(len(one) for one in told.splitlines()) <= LONGEST_LINE + 100
        assert "\x1b[31m" not in told
    return f"status {status}"


HUNT = Hunt("commands", _lines(), check)
