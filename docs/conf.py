"""The site: `sphinx-build -W -b html docs site`, offline; `pip install '.[docs]'` has what it needs."""

import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE / "building")]

from docstrings import as_rst, signature_that_helps
from figures import told_from_others
from formulas import block, inline
from frames import copy_frames, without_missing_frames
from keyboards import for_keyboards
from notebooks import NotebookParser
from short_names import short_name
from sphinx.util.inspect import TypeAliasForwardRef

import nmm

project, author, copyright = "nmm", "The nmm developers", "The nmm developers"
version = release = nmm.__version__
extensions = ["sphinx.ext.autodoc", "myst_parser"]
exclude_patterns = ["building", "lab/solutions"]

# Anchors as code hosts make them, so that a link works here and there.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
myst_fence_as_directive = ["math"]  # as code hosts draw it, too
html_math_renderer = "mathml"

default_role = "py:obj"
autodoc_default_options = {"members": True, "inherited-members": False}
autodoc_member_order = "bysource"
autodoc_inherit_docstrings = False  # a kind's methods are told once, at its base class
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
#: What these stand for is told in words.
autodoc_type_aliases = {
    name: name for name in ("Array", "ArrayLike", "Integers", "Subject", "Named", "Weights")
}
TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # within a union Sphinx shows the object
add_module_names = False
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"nmm {release}"
html_static_path = ["building/site.css"]
html_css_files = ["site.css"]
html_favicon = "building/icon.svg"
html_copy_source = False
suppress_warnings = ["misc.highlighting_failure"]  # a terminal's text may hold anything
pygments_style, pygments_dark_style = "a11y-high-contrast-light", "a11y-high-contrast-dark"


def setup(app: Any) -> None:
    """Docstrings and notebooks as they are written here; pages that a keyboard can read."""
    app.add_source_suffix(".ipynb", "notebook")
    app.add_source_parser(NotebookParser)
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect("source-read", only_folders_that_are_there)
    app.connect("autodoc-process-docstring", lambda *given: as_rst(given[-1]))
    app.connect("autodoc-process-signature", signature_that_helps)
    app.connect("missing-reference", short_name)
    app.connect("doctree-resolved", told_from_others)
    app.connect("html-page-context", without_missing_frames, priority=900)
    app.connect("html-page-context", for_keyboards, priority=900)
    app.connect("build-finished", copy_frames)


def only_folders_that_are_there(app: Any, name: str, source: list[str]) -> None:
    """Leave out a part of the contents whose folder has no page yet, of which Sphinx warns."""
    for part in re.findall(r"```\{toctree\}\n.*?```\n", source[0] if name == "index" else "", re.DOTALL):
        patterns = re.findall(r"^\S*\*$", part, re.MULTILINE)
        if patterns and not any(found for one in patterns for found in HERE.glob(f"{one}.*")):
            source[0] = source[0].replace(part, "")
