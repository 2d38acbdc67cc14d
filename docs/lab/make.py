"""Makes the lab's notebooks from docs/lab/source: `python docs/lab/make.py`.

A source is Python in cells: "# %%" begins one of code, "# %% [markdown]" one of text. An answer is the lines
between "# answer" and "# end", or the line behind "# answer: " on the line whose place it takes. The
notebooks in solutions/ have the answers; those beside this file have dots instead.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
SOURCES = tuple(sorted((FOLDER / "source").glob("*.py")))
#: The first cell of the solutions: the checks are where the student's notebooks are.
ONE_FOLDER_UP = 'import sys\n\nsys.path.insert(0, "..")'

_CELL = re.compile(r"^# %%(?P<text> \[markdown\])?\n", re.MULTILINE)
_BLOCK = re.compile(r"^(?P<indent> *)# answer\n(?P<lines>.*?)^ *# end\n", re.DOTALL | re.MULTILINE)
_LINE = re.compile(r"^(?P<indent> *)(?P<blank>.*?)  # answer: (?P<answer>.*)$", re.MULTILINE)


def answered(source: str) -> str:
    """The source as it is solved."""
    return _LINE.sub(r"\g<indent>\g<answer>", _BLOCK.sub(r"\g<lines>", source))


def blanked(source: str) -> str:
    """The source as students get it."""
    return _LINE.sub(r"\g<indent>\g<blank>", _BLOCK.sub(r"\g<indent>...\n", source))


def notebook(source: str, *first: str) -> str:
    """A notebook (nbformat 4.5) without outputs, with some cells of code before the source's own."""
    _, *parts = _CELL.split(source)
    cells = [(False, code) for code in first]
    for text, body in zip(parts[::2], parts[1::2], strict=True):
        cells.append((bool(text), re.sub(r"^# ?", "", body, flags=re.MULTILINE) if text else body))
    return (
        json.dumps(
            {
                "cells": [_cell(number, text, body.strip()) for number, (text, body) in enumerate(cells)],
                "metadata": {
                    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
                    "language_info": {"name": "python"},
                },
                "nbformat": 4,
                "nbformat_minor": 5,
            },
            ensure_ascii=False,
            indent=1,
        )
        + "\n"
    )


def _cell(number: int, text: bool, body: str) -> dict[str, object]:
    kind: dict[str, object] = {"cell_type": "markdown"} if text else {"cell_type": "code"}
    recorded = {} if text else {"execution_count": None, "outputs": []}
    return {
        **kind,
        "id": f"cell-{number}",
        "metadata": {},
        **recorded,
        "source": body.splitlines(keepends=True),
    }


def notebooks() -> dict[Path, str]:
    """Every notebook, by its file."""
    made = {}
    for path in SOURCES:
        source = path.read_text(encoding="utf-8")
        made[FOLDER / f"{path.stem}.ipynb"] = notebook(blanked(source))
        made[FOLDER / "solutions" / f"{path.stem}.ipynb"] = notebook(answered(source), ONE_FOLDER_UP)
    return made


if __name__ == "__main__":
    for path, text in notebooks().items():
        path.write_text(text, encoding="utf-8")
