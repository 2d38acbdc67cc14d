"""Formulas (```math, LaTeX) as MathML, made when the site is built: a browser draws it and loads nothing."""

from html import escape
from importlib.util import find_spec
from typing import Any

from docutils import nodes


def drawn(formula: str, display: str) -> str:
    """MathML; where latex2mathml is not installed, the formula as it is written."""
    if find_spec("latex2mathml") is None:
        return f"<code>{escape(formula)}</code>" if display == "inline" else f"<pre>{escape(formula)}</pre>"
    from latex2mathml.converter import convert

    return str(convert(formula, display=display))


def inline(page: Any, node: nodes.math) -> None:
    """A formula within a line."""
    page.body.append(drawn(node.astext(), "inline"))
    raise nodes.SkipNode


def block(page: Any, node: nodes.math_block) -> None:
    """A formula of its own."""
    page.body.append(f'<div class="formula">{drawn(node.astext(), "block")}</div>\n')
    raise nodes.SkipNode
