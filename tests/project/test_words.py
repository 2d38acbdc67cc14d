"""Names say what they hold."""

from __future__ import annotations

import ast
import keyword
import tokenize
from collections import Counter

from places import ROOT

#: Pronouns and participles, which say nothing of what a variable holds.
VAGUE = {"one", "found", "given", "here", "there", "those", "kept", "told", "said"}
#: So many of 1,000 names may be vague: attributes and parameters that users see, and pairs `one`, `other`.
MOST = 3.0


def test_few_names_are_vague() -> None:
    names: Counter[bool] = Counter()
    files: Counter[str] = Counter()
    for path in (ROOT / "nmm").rglob("*.py"):
        with path.open("rb") as file:
            for token in tokenize.tokenize(file.readline):
                if token.type == tokenize.NAME and not keyword.iskeyword(token.string):
                    names[token.string in VAGUE] += 1
                    files[str(path.relative_to(ROOT))] += token.string in VAGUE
    assert 1000.0 * names[True] / names.total() <= MOST, files.most_common(5)


def test_a_class_has_a_name_of_its_own() -> None:
    places: dict[str, list[str]] = {}
    for path in (ROOT / "nmm").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert {name: lines for name, lines in places.items() if len(lines) > 1} == {}
