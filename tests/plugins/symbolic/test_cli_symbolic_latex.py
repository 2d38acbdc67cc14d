"""nmm singularities --symbolic --latex: a document's body that says all that --symbolic says."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Result
from typeset import check_environments, check_text

from nmm.cli.exit_status import status_of

Command = Callable[..., Result]

#: With a named factor, an auxiliary quantity, names of several letters, many minors that are 0, a note.
SUBJECTS = [
    ("unicycle_2r", "--task", "position"),
    ("unicycle_2r", "--task", "position", "--set", "d=0", "--minor", "q1,q2"),
    ("unicycle_2r_link_pointing",),
    ("unicycle_3r", "--task", "position"),
    ("trailer_base", "--task", "position:trailer2"),
    ("unicycle_3r", "--task", "posture"),
    ("omni_small_arm_door",),
]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run `nmm singularities --symbolic` in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    return lambda *given: Result(status_of(["singularities", *given, "--symbolic"]), *capfd.readouterr())


def plain(line: str) -> str:
    """LaTeX as --symbolic writes the same, by rules that know nothing of how it was made."""
    for pattern, by in (
        (r"\$|\\,|\\item ", ""),
        (r"\\mathrm\{([^{}]*)\}", r"\1"),
        (r"\\(Lambda|Gamma)", lambda found: {"Lambda": "Λ", "Gamma": "Γ"}[found[1]]),
        (r"\\neq", "!="),
        (r"\\geq", ">="),
        (r"\^\{(\d+)\}", r"^\1"),
        (r"(?<!\\)_(?:\{(\d+)\}|(\d))", r"\1\2"),
        (r"\\(theta|omega|rho|pi|cos|sin|det)\b", r"\1"),
        (r"\\Delta_\{([^{}]*)\}", lambda found: f"Δ[{found[1].replace(',', ', ')}]"),
        (r"(?<!\\)_\{([^{}]*)\}", r"_\1"),
        (r"\\_", "_"),
        (r"\\frac\{(.*)\}\{([^{}]*)\}$", r"\1/\2"),
    ):
        line = re.sub(pattern, by, line)  # type: ignore[call-overload]  # text or function
    return re.sub(r"\s+", " ", line).strip()


def test_the_reader_tells_formulas_apart() -> None:
    assert plain(r"$x_{\mathrm{hitch2}} \, H_1 \cos^{2}(\mathrm{h})$") == "x_hitch2 H1 cos^2(h)"
    assert plain(r"\Delta_{v,\omega} &= -\frac{d (\rho - l_2 c_{12})}{\rho}") == (
        "Δ[v, omega] &= -d (rho - l2 c12)/rho"
    )


@pytest.mark.parametrize(
    "subject",
    [
        pytest.param(subject, marks=pytest.mark.thorough if subject in SUBJECTS[1:4:2] else ())
        for subject in SUBJECTS
    ],
    ids=" ".join,
)
def test_all_that_symbolic_says(subject: tuple[str, ...], run: Command) -> None:
    text, body = run(*subject), run(*subject, "--latex")
    assert (body.status, body.err) == (0, "")
    check_environments(body.out)
    assert body.out.startswith("% nmm ")
    before, rest = body.out.split("\\begin{align*}\n")
    formulas, after = rest.split("\n\\end{align*}\n")
    for line in (before + after).splitlines():
        if not line.startswith("%"):
            check_text(re.sub(r"\\(begin|end)\{itemize\}|\\(begin|end)group|\\allowdisplaybreaks", "", line))
    left = {}
    for line in formulas.removesuffix("\n").split(" \\\\\n"):
        name, right = line.strip().split(" &= ")
        left[plain(name)] = right
    lines = text.out.splitlines()
    start, end = lines.index("f"), lines.index("what follows")
    heading = [plain(line).rstrip(".").lower() for line in before.splitlines()]
    for line in lines[: start - 1]:
        if not re.match(r"[cs]\d+ is ", line):
            assert line.lower() in heading
    rows, section, listed = [], "", set()
    for line in lines[start:end]:
        if not line.startswith("  "):
            section = line
            continue
        if found := re.fullmatch(r"  the other (\d+) are 0", line):
            assert f"The other {found[1]} maximal minors are $0$." in after
            continue
        name, _, right = line.strip().partition(" = ")
        if section == "f":
            rows.append(name)
            name = f"f{len(rows)}"
            assert f"{name} ({rows[-1]})" in plain(before)
        elif entry := re.fullmatch(r"\[(.*), (.*)\]", name):
            column = left[f"J_{entry[2]}"]
            inside = re.fullmatch(r"\\begin\{bmatrix\} (.*) \\end\{bmatrix\}", column)
            assert inside is not None
            entries = [plain(one) for one in inside[1].split(r" \\ ")]
            assert entries[rows.index(entry[1])] == right
            continue
        listed.add(name)
        if "sqrt" not in left[name]:
            assert plain(left[name]) == right
    assert listed == {name for name in left if not name.startswith("J")}
    told = [plain(line) for line in after.splitlines()]
    for line in lines[end + 1 :]:
        line = line.strip().removeprefix("note: ")
        if line.startswith("--set "):
            assert f"% {line}" in after
        else:
            assert line in told or f"{line}." in told
    # Each short form is told, once, and none that does not occur.
    short = set(re.findall(r"\b([cs]_\{\d+\})", formulas + after))
    (defined,) = [line for line in before.splitlines() if line.startswith("Short forms")] or [""]
    assert set(re.findall(r"\$([cs]_\{\d+\}) = ", defined)) == short
    for kind, digits in re.findall(r"\b([cs])_\{(\d+)\} = ", defined):
        angle = " + ".join(f"q{digit}" for digit in digits)
        assert f"{kind}{digits} = {'cos' if kind == 'c' else 'sin'}({angle})" in plain(defined)
