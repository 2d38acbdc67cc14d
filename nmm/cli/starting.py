"""init: a first scenario for a robot's file."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from nmm.cli.output import show_text
from nmm.errors import InputError
from nmm.writing import PATIENCE, writing


def write_first_scenario(
    robot: str, *, arm: str | None, at: str | None, out: Path | None, **loading: Any
) -> None:
    """Write it, whole or not at all, to a file that is not there yet; say what was chosen."""
    from nmm.drafts import first_scenario
    from nmm.drafts.draft import usual_file
    from nmm.robots.loading.source import path_of

    for source in (robot, arm):
        if source is not None:
            path_of(source, loading.get("package_dirs", ()))  # a slip of the pen, before anything else
    file = usual_file(robot if arm is None else arm) if out is None else out
    _expect_free(file)
    draft = first_scenario(robot, arm=arm, at=at, file=file, **loading)
    _write_new(file, draft.text)
    for line in draft.chosen:
        show_text(line)
    show_text(f"wrote {file}; next: nmm run {file} --play")


def _expect_free(file: Path) -> None:
    """`InputError` for a file that is there, or cannot be: before anything is computed."""
    if file.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out: expected a file that ends in .yaml or .yml, got {file}")
    if os.path.lexists(file):
        raise InputError(f"{file} exists, and is left as it is: expected another --out, or move it away")
    if not os.access(file.parent, os.W_OK | os.X_OK) or not file.parent.is_dir():
        raise InputError(f"--out: {file.parent} is no folder where you may write")


def _write_new(file: Path, text: str) -> None:
    """A file with all of the text; one that has come meanwhile stays."""
    try:
        with writing(file, PATIENCE) as hidden, TemporaryDirectory(dir=hidden) as folder:
            part = Path(folder) / file.name
            part.write_text(text, encoding="utf-8")
            os.link(part, file)  # unlike a rename, never in another's place
    except FileExistsError:
        raise InputError(f"{file} exists, and is left as it is: expected another --out") from None
    except OSError as error:
        raise InputError(f"--out: {file}: cannot be written: {error.strerror}") from None
