"""Text and numbers as LaTeX writes them, for documents with amsmath and booktabs."""

from __future__ import annotations

import unicodedata
from math import isfinite

from nmm.words import power_of_ten, printable

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "[": "{[}",  # after \\ and \item it would begin an option
    "]": "{]}",
    "–": "--",
    "…": r"\ldots{}",
} | {character: f"\\{character}" for character in "&%$#_{}"}
_MATHEMATICAL = {
    "−": "-", "·": r"\cdot", "×": r"\times", "°": r"^\circ", "‖": r"\|", "→": r"\to", "²": "^2", "³": "^3",
    "≈": r"\approx", "±": r"\pm", "∞": r"\infty",
}  # fmt: skip


def escaped(text: str) -> str:
    """Text as LaTeX prints it: specials escaped, Greek letters in mathematics; other letters stay."""
    return "".join(map(_character, printable(text)))


def _character(character: str) -> str:
    if character in _SPECIAL:
        return _SPECIAL[character]
    if character in _MATHEMATICAL:
        return f"${_MATHEMATICAL[character]}$"
    kind, _, letter = unicodedata.name(character, "").partition(" LETTER ")
    if kind in ("GREEK SMALL", "GREEK CAPITAL") and letter.isalpha() and letter != "FINAL SIGMA":
        letter = {"LAMDA": "lambda"}.get(letter, letter.lower())
        return _greek(letter, capital=kind == "GREEK CAPITAL")
    return character


def _greek(letter: str, *, capital: bool) -> str:
    """LaTeX has no command for letters that look as Latin ones do."""
    if capital:
        command = rf"\{letter.capitalize()}" if letter in _CAPITALS else _LATIN.get(letter, letter[0].upper())
    else:
        command = "o" if letter == "omicron" else rf"\{letter}"
    return f"${command}$"


_CAPITALS = ("gamma", "delta", "theta", "lambda", "xi", "pi", "sigma", "upsilon", "phi", "psi", "omega")
_LATIN = {"eta": "H", "rho": "P", "chi": "X"}


def number(value: float | None, digits: int = 3) -> str:
    """A number in mathematics, $-2.10 \\times 10^{-29}$; a dash for None and for what is not a number."""
    if value is None or value != value:
        return "--"
    if not isfinite(value):
        return r"$\infty$" if value > 0.0 else r"$-\infty$"
    mantissa, exponent = power_of_ten(value, digits)
    power = "" if exponent is None else rf" \times 10^{{{exponent}}}"
    return f"${mantissa}{power}$"
