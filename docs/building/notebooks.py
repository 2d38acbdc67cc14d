"""Notebooks as pages: their text and their code, with the file to download. Nothing is executed here."""

import json
from pathlib import Path
from typing import Any

from myst_parser.parsers.sphinx_ import MystParser


class NotebookParser(MystParser):
    """Reads .ipynb: Markdown cells as they stand, code cells as Python, printed output below it."""

    supported = ("notebook",)

    def parse(self, inputstring: str, document: Any) -> None:
        """The notebook's text, as Markdown."""
        cells = json.loads(inputstring)["cells"]
        parts = ["".join(cells[0]["source"])] if cells else []
        name = Path(document["source"]).name
        parts.append(f"{{download}}`{name}` is this page as a notebook.")
        for cell in cells[1:]:
            text = "".join(cell["source"])
            if cell["cell_type"] == "code":
                parts.append(f"```python\n{text}\n```")
                printed = "".join("".join(one.get("text", "")) for one in cell.get("outputs", ()))
                parts += [f"```text\n{printed.rstrip()}\n```"] if printed.strip() else []
            else:
                parts.append(text)
        super().parse("\n\n".join(parts) + "\n", document)
