"""Playback pages inside pages: `<iframe src="paper/case1/playback.html">` of a tutorial.

Such pages are large and made by commands: where one lies beside its tutorial it goes into the site, and where
there is none the frame is left out.
"""

import re
import shutil
from pathlib import Path
from typing import Any

_FRAME = re.compile(r'<iframe\b[^>]*\bsrc="([^":#]+)[^"]*"[^>]*>\s*</iframe>')


def without_missing_frames(app: Any, name: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Leave out frames of pages that were not made."""
    here = Path(app.srcdir, name).parent
    if "body" in context:
        context["body"] = _FRAME.sub(
            lambda found: found[0] if (here / found[1]).exists() else "", context["body"]
        )


def copy_frames(app: Any, failed: Exception | None) -> None:
    """Copy the pages that frames show."""
    if failed is not None:
        return
    for name in app.env.found_docs:
        source = Path(app.env.doc2path(name))
        for shown in _FRAME.findall(source.read_text(encoding="utf-8")):
            page, copy = source.parent / shown, Path(app.outdir, name).parent / shown
            if page.exists():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(page, copy)
