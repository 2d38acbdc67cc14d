"""Long commands made short, in a process of their own: one case of the paper, a film without a browser."""

from __future__ import annotations

import os
import pickle
from pathlib import Path
from typing import Any

#: Takes pictures as ffmpeg does, and writes its file bit by bit.
FFMPEG = """#!/bin/sh
for made; do :; done
while read -r line; do echo "$line" >>"$made"; done
echo whole >>"$made"
"""


class Page:
    """Pictures of no page."""

    def __init__(self, file: Path, size: tuple[int, int]) -> None:
        assert file.stat().st_size > 0

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *of: object) -> None:
        pass

    def wait_for(self, expression: str) -> None:
        pass

    evaluate = wait_for

    def picture(self) -> bytes:
        return b"picture\n"


def film() -> None:
    """`nmm render` with a small ffmpeg, and no browser."""
    from nmm.plugins.live.rendering import render

    folder = Path.cwd().parent / "programs"
    folder.mkdir(exist_ok=True)
    (folder / "ffmpeg").write_text(FFMPEG)
    (folder / "ffmpeg").chmod(0o755)
    os.environ["PATH"] = f"{folder}:{os.environ['PATH']}"
    module: Any = __import__("sys").modules[render.__module__]
    module.find_browser, module.HeadlessPage = lambda: "none", Page


def one_case() -> None:
    """`nmm paper` with one case, in this process, whose files are computed once."""
    from nmm.cli.paper import write

    kept = Path.cwd().parent / "case"

    def case(number: int, progress: Any, folder: Path, figures: Any) -> Any:
        if not kept.exists():
            kept.mkdir()
            found = compute(number, progress, kept, figures)
            (kept / "result").write_bytes(pickle.dumps(found))
        for path in kept.rglob("*"):  # not `copytree`, whose errors have no number
            if path.is_file() and path.name != "result":
                made = folder / path.relative_to(kept)
                made.parent.mkdir(parents=True, exist_ok=True)
                made.write_bytes(path.read_bytes())
        return pickle.loads((kept / "result").read_bytes())

    compute, share_out = write.run_case, write.share_out
    write.run_case = case
    write.share_out = lambda work, items, jobs, advance: share_out(work, items[:1], 1, advance)
