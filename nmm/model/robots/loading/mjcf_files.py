"""The files that an MJCF file is put together from."""

from collections.abc import Iterator
from pathlib import Path
from typing import cast
from xml.etree import ElementTree

from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.model.robots.loading.xml_tree import DEEPEST, Element, XmlError, parse, read_text


def include(root: Element, file: Path) -> None:
    """Puts what other files hold, each read once as in MuJoCo, in the place of <include>."""
    _include(root, file.parent, file, {file.absolute()}, 0)


def _include(parent: Element, folder: Path, main: Path, seen: set[Path], depth: int) -> None:
    if depth > DEEPEST:
        raise refusal(main, Finding("nested_too_deep", {"most": DEEPEST}))
    parts: list[Element] = []
    for part in inside(parent):
        if part.tag != "include":
            _include(part, folder, main, seen, depth + 1)
            parts.append(part)
            continue
        name = part.get("file", "")
        # Beside the main file, or else beside the one that includes it.
        file = next(
            (path for path in (main.parent / name, folder / name) if path.is_file()), main.parent / name
        )
        place = {"file": name}
        if file.absolute() in seen:
            raise refusal(main, Finding("mjcf_included_twice", {}, place))
        seen.add(file.absolute())
        included = parsed(file, name, main)
        _include(included, file.parent, main, seen, depth + 1)
        parts += inside(included)
    parent[:] = parts


def parsed(file: Path, name: str, main: Path) -> Element:
    """The root element of a file that the main one calls by that name."""
    place = {"file": name}
    try:
        root = parse(read_text(file))
    except FileNotFoundError:
        raise refusal(main, Finding("file_unreadable", {"reason": "no such file"}, place)) from None
    except XmlError as error:
        line = {**error.finding.where, **place}
        raise refusal(main, Finding(error.finding.code, error.finding.values, line)) from None
    for element in cast("Iterator[Element]", root.iter()):
        element.file = name
    return root


def inside(element: ElementTree.Element, deep: bool = False) -> list[Element]:
    """The elements in one; `deep`: also those in these."""
    return cast("list[Element]", [*element.iter()][1:] if deep else [*element])
