"""What the theme leaves to a mouse: blocks and tables that scroll, and captions without a level."""

import re
from typing import Any


def for_keyboards(app: Any, name: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Each part that scrolls can be reached with the tabulator key; captions say what level they are."""
    if "body" in context:
        body = re.sub(r"<pre>", '<pre tabindex="0">', context["body"])
        context["body"] = re.sub(r'(<div class="table-wrapper[^"]*")', r'\1 tabindex="0"', body)
    if "furo_navigation_tree" in context:
        context["furo_navigation_tree"] = context["furo_navigation_tree"].replace(
            'role="heading"', 'role="heading" aria-level="2"'
        )
