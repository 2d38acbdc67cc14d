"""What the commands print: tables by rich, warnings, and progress; plain text in a pipe."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from nmm.base.text_format import folded, one_line, printable

if TYPE_CHECKING:
    from rich.console import Console, JustifyMethod
    from rich.progress import Progress, ProgressColumn

    from nmm.views.tables import Table as PaperTable

#: Exit statuses.
OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
#: A pipe has no width of its own: lines end where the text does, or here.
WIDTH_OF_A_PIPE = 300
#: Of a message, and of a word in it (a path, or a value), characters.
LONGEST, LONGEST_WORD = 4000, 500


def console() -> Console:
    """Standard output; in a pipe without colours and without breaking lines."""
    from rich.console import Console

    piped = not sys.stdout.isatty() and "COLUMNS" not in os.environ
    out = Console(markup=False, highlight=False, emoji=False, width=WIDTH_OF_A_PIPE if piped else None)
    out.on_broken_pipe = _raise  # type: ignore[method-assign]  # rich would end the process
    return out


def _raise() -> NoReturn:
    raise  # the error that rich is handling


def show_table(
    columns: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "", numeric: Sequence[str] = ()
) -> None:
    """Print a table; columns named in `numeric` are aligned to the right. All but the first column fold."""
    from rich.table import Table

    out, title = console(), _shown(title)
    table = Table(
        box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold", show_header=any(columns)
    )
    for i, name in enumerate(map(_shown, columns)):
        side: JustifyMethod = "right" if name in numeric else "left"
        table.add_column(name, justify=side, overflow="fold", no_wrap=i == 0)
    for row in rows:
        table.add_row(*map(_shown, row))
    if title:
        out.print(title, style="bold")
    if out.is_terminal:
        out.print(table)
        return
    with out.capture() as capture:
        out.print(table)
    for line in capture.get().splitlines():
        out.print(line.rstrip(), soft_wrap=True)


def print_table(table: PaperTable, form: str, folder: Path) -> None:
    """The table alone on standard output, as a paper takes it; on standard error where the rest is."""
    from nmm.views.tables import FORMS

    sys.stdout.write(FORMS[form](table))
    sys.stdout.flush()
    print(f"files in  {readable(str(folder))}", file=sys.stderr)


def show_text(text: str = "") -> None:
    out = console()
    for line in _shown(text).split("\n"):
        for part in [line] if out.is_terminal else folded(line):
            out.print(part, soft_wrap=not out.is_terminal)


def _shown(text: str) -> str:
    """Names and titles hold anything: what a terminal would take for commands is shown as escapes."""
    return "\n".join(map(printable, text.split("\n")))


def tell_what_takes_long() -> None:
    """Show nmm's log of slow work on a terminal; a pipe gets warnings alone."""
    if sys.stderr is None or not sys.stderr.isatty():
        return
    import logging

    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("nmm: %(message)s"))
    logger = logging.getLogger("nmm")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False


def readable(text: str) -> str:
    """A message on one line, without what a terminal would take for commands, and not endless."""
    words = printable(one_line(text, LONGEST)).split(" ")
    return " ".join(one_line(word, LONGEST_WORD) for word in words)


def warn(text: str) -> None:
    print(f"warning: {readable(text)}", file=sys.stderr)


def complain(prefix: str, text: str) -> None:
    """One line on standard error: why the exit status is not 0."""
    with suppress(OSError):  # a full disk; the exit status remains
        print(one_line(f"{prefix}: {readable(text)}", WIDTH_OF_A_PIPE), file=sys.stderr, flush=True)


@contextmanager
def progress(label: str) -> Iterator[Callable[[float], None] | None]:
    """A function that shows the fraction done, on a terminal; None where there is none."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import TaskProgressColumn, TimeRemainingColumn

    with bar_of(TaskProgressColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


def bar_of(*columns: ProgressColumn, **options: Any) -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    label = TextColumn("{task.description}", markup=False)
    return Progress(label, BarColumn(), *columns, console=Console(stderr=True), transient=True, **options)
