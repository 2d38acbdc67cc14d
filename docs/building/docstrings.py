"""Docstrings as they are written here (docs/architecture.md), as reStructuredText.

Sections are underlined as numpydoc has them; what stands behind a parameter's colon says what it is, its type
stands in the signature. The text is for people: only `code` and *words* in it are markup.
"""

import re
from typing import Any

_SECTION = re.compile(r"-{3,}$")
_ITEM = re.compile(r"^(?P<names>\S.*?)\s*(?:: |:$)(?P<text>.*)$")
_DOCTEST = ">>> "
#: A class with a longer signature and no Parameters is a record, characters.
LONGEST = 350


def as_rst(lines: list[str]) -> None:
    """Rewrite a docstring's lines in place."""
    made: list[str] = []
    section = ""
    for part in _parts("\n".join(lines).expandtabs().split("\n")):
        if len(part) > 1 and _SECTION.match(part[1].strip()):
            section, part = part[0].strip(), part[2:]
            made += [f".. rubric:: {section}", ""]
        if not part:
            continue
        if part[0].lstrip().startswith(_DOCTEST):
            made += part
        elif section and section not in ("Examples", "Notes", "References"):
            for item in _items(part):
                made += _definition(item)
        elif part[0].startswith(" "):
            made += ["::", "", *(f"    {line}" for line in part)]
        else:
            made += _plain("\n".join(part)).split("\n")
        made.append("")
    lines[:] = made


def signature_that_helps(
    app: Any, what: str, name: str, thing: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str, str | None] | None:
    """None of a record, whose many fields are told as attributes; else one that can be read."""
    if signature is None:
        return None
    if what == "class" and len(signature) > LONGEST and "Parameters\n" not in (vars(thing)["__doc__"] or ""):
        return "", None
    return re.sub(r"<[^<>]+>", "...", signature), returned


def _parts(lines: list[str]) -> list[list[str]]:
    """What stands between empty lines."""
    parts: list[list[str]] = [[]]
    for line in lines:
        if line.strip():
            parts[-1].append(line.rstrip())
        elif parts[-1]:
            parts.append([])
    return [part for part in parts if part]


def _items(part: list[str]) -> list[list[str]]:
    """The items of a section: a line at its margin with the deeper ones below it."""
    items: list[list[str]] = []
    for line in part:
        if items and line.startswith(" "):
            items[-1].append(line.strip())
        else:
            items.append([line.strip()])
    return items


def _definition(item: list[str]) -> list[str]:
    """ "name : text" as a term with its definition; a sentence, as under Returns, stays one."""
    found = _ITEM.match(item[0])
    if found is None:
        return [_plain(" ".join(item)), ""]
    text = " ".join(line for line in (found["text"], *item[1:]) if line)
    return [f"**{_plain(found['names'], quoted=False)}**", f"    {_plain(text)}", ""]


def _plain(text: str, *, quoted: bool = True) -> str:
    """Text whose bars, underscores and single stars are no markup; `code` and *words* stay what they are."""
    pieces = (
        re.split(r"(``.*?``|:\w+:`[^`]*`|`[^`]*`|(?<!\w)\*[A-Za-z]+\*(?!\w))", text) if quoted else [text]
    )
    for i in range(0, len(pieces), 2):
        pieces[i] = re.sub(r"([*|\\`])|_(?=\W|$)", lambda found: "\\" + found[0], pieces[i])
    for i in range(1, len(pieces), 2):
        if pieces[i][0] == "`" and not re.fullmatch(r"`[\w.]+`", pieces[i]):  # no name: nothing to look up
            pieces[i] = f"``{pieces[i].strip('`')}``"
        if pieces[i + 1][:1].isalnum():  # the s of `Task`s
            pieces[i] += "\\ "
    return "".join(pieces)
