"""LaTeX read by what there is without TeX: braces and dollars counted, formulas read by Matplotlib."""

from __future__ import annotations

import re

import matplotlib.pyplot as plt


def check_text(cell: str) -> None:
    """Nothing that TeX would take otherwise: braces and dollars come in pairs, specials are escaped."""
    bare = re.sub(r"\\[&%$#_{}\\]", "", cell)
    assert bare.count("$") % 2 == 0
    depth = 0
    for character in bare:
        depth += {"{": 1, "}": -1}.get(character, 0)
        assert depth >= 0
    assert depth == 0
    outside = "".join(bare.split("$")[::2])
    assert not re.search(r"[&%#_^~<>|]", outside), cell
    figure = plt.figure()
    for formula in bare.split("$")[1::2]:
        figure.text(0, 0, f"${formula}$")
    figure.canvas.draw()  # Matplotlib's reader of formulas refuses what is none
    plt.close(figure)


def check_environments(text: str) -> None:
    """Each \\begin has its \\end, in order."""
    opened: list[str] = []
    for what, name in re.findall(r"\\(begin|end)(?:\{(\w+\*?)\}|group)", text):
        if what == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert not opened
