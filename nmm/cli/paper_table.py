"""`--table`: the numbers as a paper takes them, in the place of the terminal's table."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nmm.cli.output import readable
from nmm.errors import InputError
from nmm.words import listed

if TYPE_CHECKING:
    from nmm.tables import Table

#: Kept here: `nmm --help` imports no table.
_FORMS = ("latex", "csv", "markdown")

TableOption = Annotated[
    str | None,
    typer.Option(
        "--table",
        metavar="|".join(_FORMS),
        help="Print the numbers as a paper takes them, with units, and nothing else on standard output.",
        show_default="a table for the terminal",
    ),
]


def form_of(given: str | None) -> str | None:
    """The form asked for; `InputError` for an unknown one."""
    if given is None or given in _FORMS:
        return given
    raise InputError(f"--table: expected {listed(list(_FORMS), 'or')}, got {given!r}")


def print_table(table: Table, form: str, folder: Path) -> None:
    """The table alone on standard output; on standard error where the rest is."""
    from nmm.tables import FORMS

    sys.stdout.write(FORMS[form](table))
    sys.stdout.flush()
    print(f"files in  {readable(str(folder))}", file=sys.stderr)
