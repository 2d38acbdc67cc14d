"""The lab (docs/lab): its notebooks run, its solutions are right, and wrong answers are told why."""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import lab_answers
import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest
import twin
from lab_answers import ANSWERS
from places import ROOT
from test_docs import script

LAB = ROOT / "docs" / "lab"
make = script("lab/make")
NOTEBOOKS = {path.relative_to(LAB).as_posix(): text for path, text in make.notebooks().items()}
STUDENTS = [name for name in NOTEBOOKS if "/" not in name]


@contextlib.contextmanager
def checks() -> Iterator[ModuleType]:
    """The module `check` anew, as in a kernel that has just started; what stood there comes back."""

    def take_out() -> dict[str, ModuleType]:
        return {name: sys.modules.pop(name) for name in list(sys.modules) if name.split(".")[0] == "check"}

    path, before = sys.path.copy(), take_out()
    sys.path.insert(0, str(LAB))
    try:
        yield importlib.import_module("check")
    finally:
        sys.path[:] = path
        take_out()
        sys.modules.update(before)


def printed_by_cells(notebook: str) -> list[tuple[str, str]]:
    """The code of each cell and what it prints: Python without magics, in one namespace, as in a kernel."""
    names: dict[str, Any] = {}
    printed = []
    with checks(), contextlib.chdir((LAB / notebook).parent):
        for number, cell in enumerate(json.loads(NOTEBOOKS[notebook])["cells"]):
            if cell["cell_type"] != "code":
                continue
            code = ast.parse("".join(cell["source"]), f"{notebook}, cell {number}")
            shown = code.body.pop() if isinstance(code.body[-1], ast.Expr) else None
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(code, f"{notebook}, cell {number}", "exec"), names)
                if isinstance(shown, ast.Expr):
                    value = eval(compile(ast.Expression(shown.value), "its last line", "eval"), names)
                    if hasattr(value, "_repr_html_"):
                        print(value._repr_html_()[:7])
            printed.append(("".join(cell["source"]), out.getvalue()))
    plt.close("all")
    return printed


def exercises(notebook: str) -> list[str]:
    """What a lab's module of checks asks for."""
    source = (LAB / "check" / Path(notebook).name).with_suffix(".py").read_text(encoding="utf-8")
    return re.findall(r"^@exercise\ndef (\w+)", source, re.MULTILINE)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_the_one_that_its_source_makes(name: str) -> None:
    assert (LAB / name).read_text(encoding="utf-8") == NOTEBOOKS[name], "run python docs/lab/make.py"


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_valid_and_has_no_outputs(name: str) -> None:
    notebook = nbformat.reads(NOTEBOOKS[name], as_version=4)
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert not any(cell.get("outputs") for cell in notebook.cells)


@pytest.mark.parametrize("name", [name for name in NOTEBOOKS if name not in STUDENTS])
def test_the_solutions_are_right(name: str) -> None:
    printed = printed_by_cells(name)
    verdicts = {m[1]: said for code, said in printed if (m := re.match(r"check\.(\w+)\((?=.)(?!\))", code))}
    drawn = verdicts.pop("drive", "<iframe")
    assert drawn.startswith("<iframe")
    assert list(verdicts) == exercises(name)
    for exercise, said in verdicts.items():
        assert said.startswith("✓ right: "), f"{exercise}: {said}"
    score = printed[-1][1]
    assert score.startswith(f"{len(verdicts)} of {len(verdicts)} right\n")
    assert not any("not yet" in said for _, said in printed)


@pytest.mark.parametrize("name", STUDENTS)
def test_a_notebook_that_is_not_filled_in_says_not_yet(name: str) -> None:
    printed = printed_by_cells(name)
    judged = {m[1]: said for code, said in printed if (m := re.match(r"check\.(\w+)\((?!\))", code))}
    judged.pop("drive", None)
    assert list(judged) == exercises(name)
    for exercise, said in judged.items():
        assert re.match(r"… not yet: .*\n$", said), f"{exercise}: {said}"
    waiting = [
        said for code, said in printed if code.startswith("if check.ready(") or "\nif check.ready(" in code
    ]
    assert waiting
    for said in waiting:
        assert re.fullmatch(r"… not yet: this cell waits for [\w, ]+\n", said)
    assert printed[-1][1].startswith(f"0 of {len(judged)} right\n")


@pytest.mark.parametrize("name", STUDENTS)
def test_no_answer_is_left_in_a_students_notebook(name: str) -> None:
    source = (LAB / "source" / name).with_suffix(".py").read_text(encoding="utf-8")
    answers = re.findall(r"^ *# answer\n(.*?)^ *# end\n", source, re.DOTALL | re.MULTILINE)
    answers += [answer + "\n" for answer in re.findall(r"# answer: (.*)$", source, re.MULTILINE)]
    cells = json.loads(NOTEBOOKS[name])["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    formulas = {line.strip() for line in "".join(answers).splitlines() if len(line.split()) > 2}
    assert len(formulas) >= len(exercises(name))
    for line in formulas:
        assert line not in code
    assert "# answer" not in code
    assert "# end" not in code


@pytest.fixture(scope="module")
def check() -> Iterator[ModuleType]:
    with checks() as module:
        yield module


@pytest.mark.parametrize(("exercise", "answer", "words"), ANSWERS, ids=[f"{a[0]}: {a[2]}" for a in ANSWERS])
def test_an_answer_is_told_right_or_in_what_it_is_wrong(
    exercise: str, answer: object, words: str, check: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    judge: Callable[..., None] = getattr(check, exercise)
    judge(answer)
    said = capsys.readouterr().out
    wanted = words if words.startswith(("✓", "not yet")) else f"(?s)✗ not right: .*({words})"
    assert re.search(wanted, said), said
    assert "check stops" not in said


def test_an_answer_that_uses_a_wrong_one_is_not_called_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {"np": np}
    exec("def S(q):\n    return -right(q)\ndef J(q):\n    return slopes(q) @ np.array([*S(q).T]).T", names)
    names |= {"right": twin.S, "slopes": lambda q: lab_answers.robot.J(q) @ np.linalg.pinv(twin.S(q))}
    with checks() as check:
        check.all_coordinates(names["S"])
        check.jacobian(names["J"])
        said = capsys.readouterr().out.splitlines()
        assert said[1] == "… not yet: J uses your S, which is not right yet (check.all_coordinates)"
        names["S"] = twin.S
        check.jacobian(names["J"])
        assert capsys.readouterr().out.startswith("✓ right")
        names["S"] = lambda q: -twin.S(q)  # which no check has seen
        check.jacobian(names["J"])
        assert capsys.readouterr().out.startswith("✗ not right")


def test_every_exercise_is_tried_with_right_and_wrong_answers() -> None:
    tried = {(exercise, words == "✓ right") for exercise, _, words in ANSWERS}
    listed = [exercise for notebook in STUDENTS for exercise in exercises(notebook)]
    assert tried == {(exercise, right) for exercise in listed for right in (True, False)}
