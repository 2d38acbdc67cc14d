"""Words that sentences for people are made of: lists, sums, values with units, text on one line."""

import re
import textwrap
from collections.abc import Iterable, Sequence
from math import degrees, isfinite, pi

#: Values this near a fraction of pi are written as one: files write pi/2 as 1.5708.
NEAR_PI = 5e-5


def is_pattern(name: object) -> bool:
    """Whether a name stands for several: * for any letters, ? for one."""
    return isinstance(name, str) and ("*" in name or "?" in name)


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """The names that a pattern, or a name, stands for."""
    wanted = re.compile(re.escape(pattern).replace(r"\*", ".*").replace(r"\?", "."))
    return [name for name in names if wanted.fullmatch(name)]


def listed(phrases: Sequence[str], word: str = "and") -> str:
    """ "a", "a and b", "a, b and c"."""
    if len(phrases) < 2:
        return "".join(phrases)
    return f"{', '.join(phrases[:-1])} {word} {phrases[-1]}"


def counted(count: int, thing: str) -> str:
    """ "1 sample", "3 samples"."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def signed_sum(terms: Iterable[tuple[float, str]]) -> str:
    """ "a + 2 b", "-2 b - a" of terms: a number whose sign counts, and what is written after the sign."""
    text = ""
    for number, term in terms:
        sign = "-" if number < 0 else "+"
        text += f" {sign} {term}" if text else f"{sign.strip('+')}{term}"
    return text


def fraction_of_pi(value: float, parts: Sequence[int] = (1, 2, 3, 4, 6)) -> str:
    """ "0", "π", "-π/2", "3π/4"; "" for what is no multiple of π over one of the parts."""
    for part in parts:
        times = round(value * part / pi)
        if abs(value - times * pi / part) <= NEAR_PI:
            if times == 0:
                return "0"
            number = "" if abs(times) == 1 else str(abs(times))
            return f"{'-' if times < 0 else ''}{number}π{'' if part == 1 else f'/{part}'}"
    return ""


def superscript(number: int) -> str:
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def power_of_ten(value: float, digits: int = 3) -> tuple[str, int | None]:
    """A number's digits, zeros too, and the power of ten that they are multiplied by: None from 0.01 up to
    10^digits, and for 0, which has one digit."""
    short = f"{value:#.{digits}g}"
    if value == 0.0 or (abs(value) >= 1e-2 and "e" not in short):
        return short.rstrip(".") if value else "0", None
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    return mantissa, int(exponent)


def number_text(value: float | None, digits: int = 3) -> str:
    """A number for people: 0.0230, 2.10·10⁻²⁹; a dash for None and for what is not finite."""
    if value is None or not isfinite(value):
        return "–"
    mantissa, exponent = power_of_ten(value, digits)
    power = "" if exponent is None else f"·10{superscript(exponent)}"
    return mantissa.replace("-", "−") + power


def apart(value: float, *others: float, digits: int = 4) -> list[str]:
    """Numbers in as few digits, no fewer than `digits`, as tell the first from the others: 3.0001 from 3."""
    for count in range(digits, 18):
        texts = [f"{number:.{count}g}" for number in (value, *others)]
        if all(
            text != texts[0] or number == value for text, number in zip(texts, (value, *others), strict=True)
        ):
            break
    return texts


def measured(value: float, unit: str) -> str:
    """A number of four digits with its unit, an angle in degrees too: "0.3 m", "0.5236 rad (30°)"."""
    return f"{value:.4g} {unit}" + (f" ({degrees(value):.4g}°)" if unit == "rad" else "")


def value_text(value: float, unit: str) -> str:
    """A coordinate with its unit; an angle as a fraction of π where it is one."""
    if unit != "rad":
        return measured(value if abs(value) > NEAR_PI else 0.0, unit)
    return fraction_of_pi(value) or measured(value, unit)


def split_outside_brackets(text: str, mark: str) -> list[str]:
    """The parts of a text between marks that stand in no bracket: "a,[b,c]" at "," is "a" and "[b,c]"."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "[{(") - (character in "]})")
        if character == mark and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def printable(text: str) -> str:
    """The text with control characters, line breaks among them, as escapes: names in files may hold any."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def short_words(text: str, limit: int = 280) -> str:
    """The text with the middle of each longer word left out: a name in a file may be as long as the file."""
    half = limit // 2 - 1
    return re.sub(rf"\S{{{limit + 1},}}", lambda word: f"{word[0][:half]}…{word[0][-half:]}", text)


def folded(line: str, limit: int = 300) -> list[str]:
    """The line or, where it is longer than `limit`, the lines in which it is told, the others indented."""
    if len(line) <= limit:
        return [line]
    return textwrap.wrap(
        short_words(line, limit - 20), limit, subsequent_indent="    ", break_on_hyphens=False
    )


def quoted(value: object, limit: int = 60) -> str:
    """A value as an error shows it: on one line, not too long."""
    # Of a long text repr would make a longer one first.
    return one_line(repr(value[:limit] if isinstance(value, str | bytes) else value), limit)


def one_line(text: str, limit: int = 300) -> str:
    """The text with all white space as single spaces, cut after `limit` characters."""
    joined = " ".join(text.split())
    return joined if len(joined) <= limit else f"{joined[: limit - 1]}…"
