"""Sentences with formulas in them as LaTeX: which parts are mathematics, and how those are written."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

from nmm.analysis.formulas.expressions import GREEK, latex_name
from nmm.latex import escaped

_TOKEN = re.compile(
    r"""(?P<minor>Δ\[[^\]]*\]) | (?P<columns>\[[^\]]*\]) | (?P<determinant>det\ J\ J\^T)
    | (?P<option>--[a-z][\w-]*) | (?P<word>[^\W\d]\w*(?:\.\w+)+ | [^\W\d_]{2,}(?:-[^\W\d_]{2,})+)
    | (?P<wave>(?:cos|sin)(?:\^\d+|(?=\())) | (?P<name>[^\W\d]\w*) | (?P<number>\d+(?:\.\d+)?(?:e[+-]?\d+)?)
    | (?P<power>\^\d+) | (?P<operator>!=|>=|[-+/|=<>]) | (?P<space>\s+) | (?P<other>.)""",
    re.VERBOSE,
)
_OPERATORS = {"!=": r"\neq", ">=": r"\geq"}
#: Symbols of the sentences themselves.
_SYMBOLS = {"J": "J", "q": "q", "f": "f", "pi": r"\pi"} | {
    letter: f"\\{name}" for name, letter in GREEK.items()
}
#: Words and units that may be names of a robot's, too: they are these where an operator is beside them.
_WORDS = {"a", "as", "at", "for", "in", "is", "it", "m", "no", "of", "on", "or", "rad", "s", "so", "to"}


@dataclass
class _Token:
    """A piece of a sentence: in LaTeX, and whether it is mathematics, by itself or beside such."""

    text: str
    kind: str
    latex: str
    formula: bool


def typeset(sentence: str, names: Collection[str]) -> str:
    """A sentence of `nmm singularities --symbolic` as LaTeX.

    names : of coordinates, inputs, lengths and other quantities; c12 and s1 are cosine and sine where no one
        of these is called so
    """
    tokens = [_token(found, names) for found in _TOKEN.finditer(sentence)]
    _settle_words(tokens)
    _settle_brackets(tokens)
    return "".join(_runs(tokens))


def _token(found: re.Match[str], names: Collection[str]) -> _Token:
    text, kind = found.group(), str(found.lastgroup)
    if kind in ("minor", "columns"):
        inside = [latex_name(name.strip()) for name in text.strip("Δ[]").split(",")]
        written = rf"\Delta_{{{','.join(inside)}}}" if kind == "minor" else rf"[{', '.join(inside)}]"
        return _Token(text, kind, written, True)
    if kind == "determinant":
        return _Token(text, kind, r"\det J J^T", True)
    if kind == "option":
        return _Token(text, kind, rf"\texttt{{-{{}}-{escaped(text[2:])}}}", False)
    if kind == "wave":
        name, _, power = text.partition("^")
        return _Token(text, kind, rf"\{name}" + (f"^{{{power}}}" if power else ""), True)
    if kind == "name" and (symbol := _symbol(text, names)):
        return _Token(text, kind, symbol, True)
    if kind == "number":
        return _Token(text, kind, text, True)
    if kind == "power":
        return _Token(text, kind, f"^{{{text[1:]}}}", True)
    if kind == "operator":
        return _Token(text, kind, _OPERATORS.get(text, text), False)
    return _Token(text, "space" if kind == "space" else "other", escaped(text), False)


def _symbol(name: str, names: Collection[str]) -> str | None:
    if name in names:
        return latex_name(name)
    if re.fullmatch(r"[cs]\d+", name):
        return f"{name[0]}_{{{name[1:]}}}"
    return _SYMBOLS.get(name)


def _settle_words(tokens: list[_Token]) -> None:
    """A word that is a quantity's name as well is the quantity beside an operator."""
    seen = [token for token in tokens if token.kind != "space"]
    for k, token in enumerate(seen):
        beside = [*seen[max(k - 1, 0) : k], *seen[k + 1 : k + 2]]
        if token.text in _WORDS and not any(one.kind in ("operator", "power") for one in beside):
            token.formula, token.latex = False, escaped(token.text)


def _settle_brackets(tokens: list[_Token]) -> None:
    """Round brackets are mathematics where all in them is."""
    opened: list[int] = []
    for k, token in enumerate(tokens):
        if token.text == "(":
            opened.append(k)
        elif token.text == ")" and opened:
            first = opened.pop()
            inside = [one for one in tokens[first + 1 : k] if one.kind not in ("space", "operator")]
            if inside and all(one.formula for one in inside):
                tokens[first].formula = token.formula = True


def _runs(tokens: list[_Token]) -> Iterator[str]:
    """The sentence's words, and its formulas between dollars."""
    joins = [token.formula or token.kind in ("space", "operator") for token in tokens]
    for together, grouped in groupby(zip(joins, tokens, strict=True), key=itemgetter(0)):
        run = [token for _, token in grouped]
        formula = [k for k, token in enumerate(run) if token.formula or token.text == "|"]
        if not together or not any(token.formula for token in run):
            yield _words(run)
            continue
        first, end = formula[0], formula[-1] + 1
        first -= bool(first) and run[first - 1].text == "-"
        yield f"{_words(run[:first])}${_mathematics(run[first:end])}${_words(run[end:])}"


def _words(tokens: list[_Token]) -> str:
    return "".join(escaped(one.text) if one.kind == "operator" else one.latex for one in tokens)


def _mathematics(run: list[_Token]) -> str:
    """A formula; names of several letters stand apart."""
    written = ""
    for k, token in enumerate(run):
        if token.kind == "space":
            pair = run[k - 1], run[k + 1]
            long = any(r"\mathrm{" in one.latex for one in pair) and all(one.kind == "name" for one in pair)
            written += r" \, " if long else " "
        else:
            written += token.latex
    return written
