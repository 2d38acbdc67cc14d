"""A table of runs, and its forms for papers and other programs."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from nmm.base import latex
from nmm.base.errors import expect
from nmm.base.files import written_at
from nmm.base.text_format import listed, number_text, printable

#: A number, a word, or None where a run has none.
Value: TypeAlias = float | int | str | None


@dataclass(frozen=True)
class Quantity:
    """A row: the values of a quantity in every run.

    Attributes
    ----------
    key : its name in summary.json; "u_max.v" for what lies deeper there
    name, latex, unit : for readers, as plain text and as LaTeX; "" for no unit
    nothing : the value of a run in which nothing of it happened; rows of no other are for `csv` alone

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").with_settings({"duration": 1}).run()
    >>> quantity = nmm.comparison_table([run]).quantities[0]
    >>> isinstance(quantity, nmm.extending.Quantity), quantity.name, quantity.unit
    (True, 'step', 's')
    """

    key: str
    name: str
    latex: str
    unit: str
    values: tuple[Value, ...]
    nothing: Value = None

    @property
    def says_something(self) -> bool:
        """Whether it is worth a row to be read."""
        return any(value not in (None, self.nothing) for value in self.values)


@dataclass(frozen=True)
class Table:
    """Quantities of runs.

    Attributes
    ----------
    runs : what they are called
    quantities : each with as many values

    Examples
    --------
    >>> table = nmm.comparison_table([nmm.Scenario.load("unicycle_2r_position", {"duration": 1}).run()])
    >>> table.runs, table.save("case1.tex").name
    (('RG',), 'case1.tex')
    """

    runs: tuple[str, ...]
    quantities: tuple[Quantity, ...]

    @property
    def read(self) -> tuple[Quantity, ...]:
        """The rows to be read: those that say something."""
        return tuple(quantity for quantity in self.quantities if quantity.says_something)

    def latex(self) -> str:
        """A tabular of package booktabs, with a column a run: three digits, powers of ten, names escaped."""
        from nmm import __version__

        rows = [["", *map(latex.escaped, self.runs)]]
        for quantity in self.read:
            # The exponent of m^2 is raised.
            unit = re.sub(r"\\textasciicircum\{\}(-?\d+)", r"$^{\1}$", latex.escaped(quantity.unit))
            unit = unit and f" ({unit})"
            rows.append([quantity.latex + unit, *map(_latex_value, quantity.values)])
        head, *body = (" & ".join(row) + r" \\" for row in rows)
        return "\n".join(
            [
                rf"% nmm {__version__}; needs \usepackage{{booktabs}}",
                rf"\begin{{tabular}}{{@{{}}l{'r' * len(self.runs)}@{{}}}}",
                *(rf"  {line}" for line in (r"\toprule", head, r"\midrule", *body, r"\bottomrule")),
                "\\end{tabular}\n",
            ]
        )

    def csv(self) -> str:
        """A line a run under names with units: the numbers of summary.json, to the last digit."""
        names = [
            f"{quantity.key} [{quantity.unit}]" if quantity.unit else quantity.key
            for quantity in self.quantities
        ]
        text = io.StringIO()
        written = csv.writer(text, lineterminator="\n")
        written.writerow(["run", *names])
        for k, run in enumerate(self.runs):
            written.writerow([run, *(quantity.values[k] for quantity in self.quantities)])
        return text.getvalue()

    def markdown(self) -> str:
        """A table as GitHub and most others read it, with a column a run."""
        rows = [["", *map(_markdown, self.runs)], ["---", *("---:" for _ in self.runs)]]
        for quantity in self.read:
            name = _markdown(f"{quantity.name} ({quantity.unit})" if quantity.unit else quantity.name)
            rows.append([name, *(_markdown(_plain_value(value)) for value in quantity.values)])
        return "".join(f"| {' | '.join(row)} |\n" for row in rows)

    def save(self, path: str | Path) -> Path:
        """Write it; the file's suffix says as what: .tex, .csv or .md.

        Raises
        ------
        InputError : another suffix, a file that cannot be written
        """
        path = Path(path)
        expect(path.suffix.lower() in _SUFFIXES, path, f"a file that ends in {listed(list(_SUFFIXES), 'or')}")
        with written_at(path):
            path.write_text(FORMS[_SUFFIXES[path.suffix.lower()]](self), encoding="utf-8")
        return path


FORMS: dict[str, Callable[[Table], str]] = {
    "latex": Table.latex,
    "csv": Table.csv,
    "markdown": Table.markdown,
}
_SUFFIXES = {".tex": "latex", ".csv": "csv", ".md": "markdown"}


def _latex_value(value: Value) -> str:
    if isinstance(value, str):
        return latex.escaped(value)
    return f"${value}$" if isinstance(value, int) else latex.number(value)


def _plain_value(value: Value) -> str:
    return str(value) if isinstance(value, str | int) else number_text(value)


def _markdown(text: str) -> str:
    """Escape what Markdown takes for markup."""
    return re.sub(r"([\\`*_{}\[\]<>|])", r"\\\1", printable(text))
