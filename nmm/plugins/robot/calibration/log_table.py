"""Tables of numbers in text files with a header: delimiter found, read row by row into little memory."""

from __future__ import annotations

import csv
import math
import warnings
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect, no_such
from nmm.base.files import expect_file
from nmm.base.text_format import quoted

#: What may stand between columns, beside blanks.
DELIMITERS = ",;\t|"
#: What stands for no number.
NOTHING = ("", "nan", "none", "null", "na", "n/a", "-")
#: Of so many lines the delimiter is found; of a longer line nothing is read.
LOOKED_AT, LONGEST = 20, 100_000


@dataclass(frozen=True, eq=False)
class Columns:
    """columns : by name, (N,), NaN where a cell says nothing; lines (N,) : of the file, from 1 on;
    cut : whether the last line lacked its end, and was left out"""

    columns: dict[str, Array]
    lines: Integers
    cut: bool


class TextTable:
    """A text file's table; `InputError` where it has none.

    header : names of its columns
    """

    def __init__(self, path: Path, delimiter: str | None = None) -> None:
        self.path = path
        with self._lines() as lines:
            first = [line for _, line in islice(lines, LOOKED_AT)]
        expect(first, path, "a table with a header", "an empty file")
        self._delimiter = _found(first, path) if delimiter is None else delimiter
        self.header = [name.strip() for name in self._split(first[0].lstrip("# "))]
        if all(_is_number(name) for name in self.header):
            raise InputError(
                where=path, expected="a header: columns' names in its first line", got=first[0][:60]
            )

    def expect_columns(self, wanted: Sequence[str], where: str) -> None:
        """`InputError` for a column that there is not, or twice."""
        for name in wanted:
            if name not in self.header:
                raise no_such("column", name, self.header, where)
            expect(self.header.count(name) == 1, where, f"one column {quoted(name)}", self.header.count(name))

    def read(self, wanted: Sequence[str]) -> Columns:
        """Its columns of these names; `InputError` by line and column for what is no number."""
        self.expect_columns(wanted, str(self.path))
        if (cells := self._plain()) is not None:
            columns = {name: cells[:, self.header.index(name)].copy() for name in wanted}
            return Columns(columns, np.arange(2, len(cells) + 2), cut=False)
        places = [self.header.index(name) for name in wanted]
        values, at, most = [array("d") for _ in wanted], array("q"), len(self.header)
        ended = self._ends()
        with self._lines() as lines:
            next(lines)
            rows = self._rows(lines)
            held = next(rows, None)
            while held is not None:
                (line, row), held = held, next(rows, None)
                if len(row) != most and (len(row) < most or any(cell.strip() for cell in row[most:])):
                    if held is None and not ended:
                        return self._table(wanted, values, at, cut=True)
                    raise InputError(
                        where=f"{self.path}: line {line}", expected=f"{most} cells", got=len(row)
                    )
                try:
                    numbers = [float(row[place]) for place in places]
                except ValueError:
                    numbers = [self._number(row[place], line, self.header[place]) for place in places]
                for column, number in zip(values, numbers, strict=True):
                    column.append(number)
                at.append(line)
        return self._table(wanted, values, at, cut=False)

    def _plain(self) -> Array | None:
        """All cells (N, columns) of a table of nothing but numbers, a row a line: read at once, in a tenth of
        the time; None of another."""
        if not self._ends():
            return None
        delimiter = None if self._delimiter == " " else self._delimiter
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of a table without rows
                cells = np.loadtxt(
                    self.path, delimiter=delimiter, skiprows=1, ndmin=2, comments=None, encoding="utf-8-sig"
                )
        except (ValueError, OSError):
            return None
        with self.path.open("rb") as file:
            lines = sum(block.count(b"\n") for block in iter(lambda: file.read(2**20), b""))
        return cells if cells.shape == (lines - 1, len(self.header)) and len(cells) else None

    def _table(self, wanted: Sequence[str], values: list[array[float]], at: array[int], cut: bool) -> Columns:
        columns = {name: np.array(column) for name, column in zip(wanted, values, strict=True)}
        return Columns(columns, np.array(at, dtype=np.int64), cut)

    def _number(self, text: str, line: int, column: str) -> float:
        cell = text.strip()
        if cell.lower() in NOTHING:
            return math.nan
        if self._delimiter != "," and cell.count(",") == 1:
            cell = cell.replace(",", ".")
        if not _is_number(cell):
            where = f"{self.path}: line {line}: {column}"
            raise InputError(where=where, expected="a number", got=text)
        return float(cell)

    def _rows(self, lines: Iterator[tuple[int, str]]) -> Iterator[tuple[int, list[str]]]:
        line = 0

        def texts() -> Iterator[str]:
            nonlocal line
            for line, text in lines:  # noqa: B007 - read by the loop below
                yield text

        try:
            if self._delimiter == " ":
                for text in texts():
                    yield line, text.split()
            else:
                for row in csv.reader(texts(), delimiter=self._delimiter, skipinitialspace=True):
                    yield line, row
        except csv.Error as error:
            raise InputError(f"is no table: {error}", where=f"{self.path}: line {line}") from None

    def _split(self, text: str) -> list[str]:
        return (
            text.split()
            if self._delimiter == " "
            else next(csv.reader([text], delimiter=self._delimiter, skipinitialspace=True))
        )

    def _lines(self) -> _Lines:
        return _Lines(self.path)

    def _ends(self) -> bool:
        """Whether the last line is whole."""
        with self.path.open("rb") as file:
            file.seek(-1, 2)
            return file.read(1) in b"\r\n"


class _Lines:
    """In the block, a file's lines with their numbers: none that is blank or, behind the first, a remark."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: IO[str] | None = None

    def __enter__(self) -> Iterator[tuple[int, str]]:
        try:
            expect_file(self._path)
            self._file = self._path.open(encoding="utf-8-sig", newline="")
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", where=self._path) from None
        return self._told()

    def _told(self) -> Iterator[tuple[int, str]]:
        assert self._file is not None
        number, first = 0, True
        while True:
            try:
                text = self._file.readline(LONGEST)
            except UnicodeDecodeError:
                raise InputError("is no text in UTF-8", where=f"{self._path}: line {number + 1}") from None
            if not text:
                return
            number += 1
            if len(text) >= LONGEST:
                where = f"{self._path}: line {number}"
                raise InputError(where=where, expected=f"at most {LONGEST} characters")
            if text.strip() and (first or not text.startswith("#")):
                first = False
                yield number, text.rstrip("\r\n")

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()


def _found(lines: list[str], path: Path) -> str:
    """The delimiter of a table's first lines."""
    head = lines[0].lstrip("# ")
    if not any(mark in head for mark in DELIMITERS):
        return " "
    try:
        return csv.Sniffer().sniff("\n".join([head, *lines[1:]]), DELIMITERS).delimiter
    except csv.Error:
        expected = "columns between commas, semicolons, tabs or blanks, or delimiter="
        raise InputError(where=path, expected=expected, got=lines[0][:60]) from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
