"""Text, numbers and formulas as LaTeX writes them, for documents with amsmath and booktabs."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from math import isfinite

from nmm.base.text_format import power_of_ten, printable, signed_sum

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


class Typeset(str):
    """A text, and `latex`, the same for a document. Terminals, JSON and pages take it as the text."""

    latex: str

    def __new__(cls, text: str, latex: str) -> Typeset:
        made = super().__new__(cls, text)
        made.latex = latex
        return made

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]  # for pickle
        return str.__str__(self), self.latex


class Formula(Typeset):
    """A formula: `latex` is what stands between dollars in a sentence."""


#: Names that text writes with a Greek letter.
GREEK = {"Lambda": "Λ", "Gamma": "Γ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω"}
_SIGNS = {" != ": r" \neq ", " >= ": r" \geq "}


def latex_name(name: str) -> str:
    """A quantity's name in mathematics: q_1, \\theta, x_{\\mathrm{ee}}."""
    greek = re.fullmatch(r"(theta|rho|omega|alpha|beta|kappa|Lambda|Gamma|Phi|Psi|Omega)(\d*)", name)
    if greek:
        return f"\\{greek[1]}" + (f"_{{{greek[2]}}}" if greek[2] else "")
    letters = re.fullmatch(r"([A-Za-z])(\d+)", name)
    if letters:
        return f"{letters[1]}_{{{letters[2]}}}" if len(letters[2]) > 1 else f"{letters[1]}_{letters[2]}"
    head, _, tail = name.partition("_")
    if len(head) == 1 and tail:
        return f"{head}_{{\\mathrm{{{tail.replace('_', ',')}}}}}"
    return name if len(name) == 1 else rf"\mathrm{{{name.replace('_', chr(92) + '_')}}}"


def symbol(name: str) -> Formula:
    return Formula(GREEK.get(name, name), latex_name(name))


def formula(*parts: object) -> Formula:
    written = (
        part.latex if isinstance(part, Typeset) else _SIGNS.get(str(part), str(part)) for part in parts
    )
    return Formula("".join(map(str, parts)), "".join(written))


def sentence(*parts: object) -> Typeset:
    return Typeset("".join(map(str, parts)), "".join(map(_inline, parts)))


def _inline(part: object) -> str:
    if isinstance(part, Typeset):
        return f"${part.latex}$" if isinstance(part, Formula) else part.latex
    return f"${part}$" if isinstance(part, int | float) else escaped(str(part))


def joined(parts: Iterable[object], mark: str = ", ", last: str | None = None) -> Typeset:
    pieces = list(parts)
    marks = [mark] * (len(pieces) - 2) + [mark if last is None else last]
    return sentence(*(piece for pair in zip(["", *marks], pieces, strict=False) for piece in pair))


def minor_name(columns: Sequence[str]) -> Formula:
    """A minor by the names of its columns: "Δ[v, omega, q2]"."""
    return Formula(f"Δ[{', '.join(columns)}]", rf"\Delta_{{{','.join(map(latex_name, columns))}}}")


def block(columns: Sequence[str]) -> Formula:
    return Formula(f"[{', '.join(columns)}]", f"[{', '.join(map(latex_name, columns))}]")


def linear_formula(terms: Iterable[tuple[float, Formula]]) -> Formula:
    """A sum of formulas times whole numbers: "Δ[v, q1] - 2 Δ[v, q2]"."""
    numbered = [(n, "" if abs(n) == 1 else f"{abs(n)} ", of) for n, of in terms]
    return Formula(
        signed_sum((n, number + of) for n, number, of in numbered),
        signed_sum((n, number + of.latex) for n, number, of in numbered),
    )


def capitalised(text: str) -> str:
    """A text whose first letter is a capital one; a formula stays as it is."""
    made = text[:1].upper() + text[1:]
    if not isinstance(text, Typeset):
        return made
    return text if text.latex.startswith("$") else Typeset(made, text.latex[:1].upper() + text.latex[1:])
