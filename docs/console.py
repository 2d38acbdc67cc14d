"""Pages of the documentation that run: `python docs/console.py [PAGE …]` runs them and writes what comes out.

A page's blocks run in order, in one empty folder:

- ```console: what the commands in it ("$ nmm …", "$ python FILE", "$ cat FILE") print. The tests compare it.
  "$ nmm … | grep -E PATTERN" prints the lines that match; standard error passes by, unless it is "2>&1 |".
- ```text with commands: the same, not compared: its numbers are times, rounding, or chaotic. The tests run
  its "$ nmm …"; scripts have tests of their own.
- ```bash: lines "nmm …" run, without what they print. What waits for Ctrl-C (view, drive, --play, …) gets it
  when its page is open.
- a file in tutorials/ to which it links, "](NAME.py)", is copied there first.
- a block of any language whose first line is "# NAME" or "<!-- NAME -->" is the file NAME.
- ```python else runs as it stands, with the names of the page's blocks before it.

A picture "](STEM/PATH)" or a frame src="STEM/PATH" of page STEM.md is the PATH that the commands wrote; a
copy stays in the folder STEM/. Pages in frames are large and not in the repository: the site has them where
this ran before it was built.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TextIO

FOLDER = Path(__file__).parent
TUTORIALS = sorted((FOLDER / "tutorials").glob("*.md"))
#: Pages whose blocks run.
_OTHERS = ("singularities", "sweeps", "papers", "calibration")
PAGES = (*(FOLDER / f"{name}.md" for name in _OTHERS), *TUTORIALS)
COMPARED = "console"

_BLOCK = re.compile(r"^```(?P<kind>\w+)\n(?P<body>.*?)^```$", re.DOTALL | re.MULTILINE)
_NAMED = re.compile(r"(?:# |<!-- )(?P<name>[\w-]+\.\w+)(?: -->)?\n")
_LINKED = re.compile(r"\]\((?:tutorials/)?([\w-]+\.(?:py|urdf))\)")
_PROMPT = "$ "
_STAYS = ("view", "drive", "play")
_PATIENCE = 120.0


def rewritten(text: str, folder: Path | None = None, *, scripts: bool = True) -> str:
    """The page with what its commands print now, run in an empty folder; `scripts` not compared run, too."""
    run_in = {COMPARED: _PROMPT, "text": _PROMPT if scripts else f"{_PROMPT}nmm "}
    names: dict[str, object] = {"__name__": "__main__"}

    def anew(block: re.Match[str]) -> str:
        kind, body = block["kind"], block["body"]
        if named := _NAMED.match(body):
            Path(named["name"]).write_text(body, encoding="utf-8")
        elif kind in run_in and body.startswith(run_in[kind]):
            commands = [line for line in body.splitlines() if line.startswith(_PROMPT)]
            printed = "\n".join(
                f"{line}\n{_printed(line.removeprefix(_PROMPT))}".rstrip() for line in commands
            )
            return f"```{kind}\n{printed}\n```"
        elif kind == "bash":
            for line in body.splitlines():
                run(line)
        elif kind == "python":
            exec(compile(body, "a block of the page", "exec"), names)
        return block.group()

    with tempfile.TemporaryDirectory() as empty, contextlib.chdir(folder or empty):
        for name in _LINKED.findall(text):
            shutil.copyfile(FOLDER / "tutorials" / name, name)
        return _BLOCK.sub(anew, text)


def compared(text: str) -> str:
    """The page's blocks whose numbers are the same everywhere."""
    return "\n".join(block["body"] for block in _BLOCK.finditer(text) if block["kind"] == COMPARED)


def _printed(command: str) -> str:
    """What a command prints, errors included, as a terminal would show it."""
    program, *arguments = shlex.split(command, comments=True)
    if program == "grep":
        _, pattern, name = arguments
        lines = Path(name).read_text(encoding="utf-8").splitlines()
        return "\n".join(line for line in lines if re.search(pattern, line))
    if program == "cat":
        return "\n".join(Path(name).read_text(encoding="utf-8").strip("\n") for name in arguments)
    if program == "python":
        return _script(*arguments).strip("\n")
    if program != "nmm":
        raise ValueError(f"expected nmm, python, cat or grep -E, got {command!r}")
    return _done(arguments)[1].strip("\n")


def _script(name: str, text: str = "") -> str:
    """What a Python program prints, run in this process: one of its own would import everything again.

    `python NAME`, and `python -c TEXT`; modules beside it are imported anew for each program.
    """
    code = text if name == "-c" else Path(name).read_text(encoding="utf-8")
    here, before, printed = str(Path.cwd()), {*sys.modules}, io.StringIO()
    sys.path.insert(0, here)
    importlib.invalidate_caches()
    try:
        with contextlib.redirect_stderr(printed), contextlib.redirect_stdout(printed):
            exec(compile(code, name, "exec"), {"__name__": "__main__"})
    finally:
        sys.path.remove(here)
        for module in {*sys.modules} - before:
            if str(getattr(sys.modules[module], "__file__", None)).startswith(here):
                del sys.modules[module]
    return printed.getvalue()


def _done(arguments: list[str]) -> tuple[int, str]:
    """A command's exit status, and what a terminal shows: errors too, and not what "> FILE" takes."""
    from nmm.cli.exit_status import status_of

    if "|" in arguments:
        *arguments, _, grep, extended, pattern = arguments
        if (grep, extended) != ("grep", "-E"):
            raise ValueError(f"expected grep -E after |, got {grep} {extended}")
        errors, printed = io.StringIO(), io.StringIO()
        if arguments[-1] == "2>&1":
            arguments, errors = arguments[:-1], printed
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(printed):
            status = status_of(arguments)
        found = [line for line in printed.getvalue().splitlines() if re.search(pattern, line)]
        passed_by = "" if errors is printed else errors.getvalue()
        return status, passed_by + "\n".join(found)
    printed = io.StringIO()
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stderr(printed))
        out: TextIO = printed
        if ">" in arguments:  # what is printed goes to a file
            *arguments, _, name = arguments
            out = stack.enter_context(Path(name).open("w", encoding="utf-8"))
        stack.enter_context(contextlib.redirect_stdout(out))
        status = status_of(arguments)
    return status, printed.getvalue()


def run(line: str) -> None:
    """A command; `RuntimeError` where it fails."""
    program, *arguments = shlex.split(line, comments=True) or [""]
    if program != "nmm":
        return
    if arguments[0] in _STAYS or "--play" in arguments:
        status, said = _interrupted(arguments)
        failed = status not in (0, 130) or "http://" not in said
    else:
        status, said = _done(arguments)
        failed = status != 0
    if failed:
        raise RuntimeError(f"{line}: exit status {status}\n{said}")


def _interrupted(arguments: list[str]) -> tuple[int, str]:
    """The exit status and the words of a command that gets Ctrl-C when its page is open."""
    command = [sys.executable, "-u", "-m", "nmm", *arguments, "--no-open"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    said = ""
    try:
        assert process.stdout is not None
        for printed in process.stdout:
            said += printed
            if "http://" in printed:
                break
        process.send_signal(signal.SIGINT)
        said += process.communicate(timeout=_PATIENCE)[0]
    finally:
        process.kill()
    return process.returncode, said


def shown(page: Path) -> list[str]:
    """What the page shows of what its commands write."""
    found = re.findall(rf"(?:\]\(|src=\"){page.stem}/([^)\"#]+)", page.read_text(encoding="utf-8"))
    return [str(path) for path in found]


def write(page: Path, folder: Path) -> None:
    """Run a page in a folder, write what it prints, and keep what it shows."""
    page.write_text(rewritten(page.read_text(encoding="utf-8"), folder), encoding="utf-8")
    shutil.rmtree(page.with_suffix(""), ignore_errors=True)
    for path in shown(page):
        kept = page.with_suffix("") / path
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(folder / path, kept)


if __name__ == "__main__":
    for page in [FOLDER / name for name in sys.argv[1:]] or PAGES:
        with tempfile.TemporaryDirectory() as empty:
            write(page, Path(empty))
