"""Logs of drives from text files: a table of counters, and a reference in it or in a table of its own."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from nmm.base.arrays import Array, Integers, array, scalar
from nmm.base.errors import InputError, expect, few, no_such
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.drive_log import DriveLog, Kind, Wrapped
from nmm.plugins.robot.calibration.log_checks import (
    MeasuredDrive,
    check_determined,
    check_moves,
    check_rates,
    check_times,
    expect_forward,
)
from nmm.plugins.robot.calibration.log_reference import check_reference
from nmm.plugins.robot.calibration.log_table import Columns, TextTable
from nmm.plugins.robot.calibration.log_turns import counted_on, stated_for
from nmm.plugins.robot.calibration.log_units import Counter, Unit, Units, counters_of, near_names

#: The columns of a reference.
PLACE = ("x", "y", "theta")
#: Of the rows, such a share may have the stamp of the row before: more are stamps too coarse for the rows.
TWICE = 0.1
CLOSED = "closed"


@dataclass
class _Log:
    """What is being read: the table's header, the column of each counter and of each part of the reference,
    the units, and what was found."""

    robot: Robot
    path: Path
    header: list[str]
    counters: dict[str, Counter]
    columns: dict[str, str]
    units: Units
    findings: list[Finding]


def from_csv(
    path: str | Path,
    robot: Robot,
    reference: str | Path | None = None,
    *,
    units: Mapping[str, str] | str | None = None,
    time: str = "t",
    reference_time: str | None = None,
    columns: Mapping[str, str] | None = None,
    wrapped: Wrapped = None,
    ends: str | ArrayLike | None = None,
    shift: float = 0.0,
    delimiter: str | None = None,
    name: str | None = None,
) -> DriveLog:
    """See `DriveLog.from_csv`."""
    file = Path(path)
    table = TextTable(file, delimiter)
    known = counters_of(robot)
    asked = _columns(columns, known, str(file))
    counted = {role: asked.get(role, role) for role in known if role in asked or role in table.header}
    if not any(known[role].group != "steering" for role in counted):
        wheels = [role for role, counter in known.items() if counter.group == "wheels"] or [*known]
        raise near_names(wheels, table.header, str(file))
    place = [role for role in PLACE if role in asked or reference is not None or role in table.header]
    log = _Log(
        robot,
        file,
        table.header,
        {role: known[role] for role in counted},
        counted | {role: asked.get(role, role) for role in place},
        Units(units, (*known, *PLACE, time, reference_time or time), str(file)),
        [],
    )
    seen_in = None if reference is None else TextTable(Path(reference), delimiter)
    if ends is not None:
        expect(reference is None, f"{file}: ends", "no reference beside them", reference)
        place = []
    elif seen_in is None and not {"x", "y"} <= {*place}:
        expected = "reference=, columns x and y or columns={'x': COLUMN, …}, or ends='closed'"
        raise InputError("no reference", where=file, expected=expected, got=few(table.header))
    else:
        place = _place(log, seen_in or table, place, asked)
    with_reference = place if seen_in is None else []
    table.expect_columns([time], f"{file}: time")
    read = table.read([time, *dict.fromkeys(log.columns[role] for role in (*counted, *with_reference))])
    clock = log.units.group("time", time)
    stated = {role: log.units.counter(role, log.counters[role]) for role in counted}
    placed = {role: log.units.group("heading" if role == "theta" else "position", role) for role in place}
    stamp = reference_time or time
    other = None if seen_in is None else log.units.group("reference_time", stamp)
    log.units.expect_all()
    of = {role: unit for role, unit in (stated | placed).items() if unit is not None}
    measured = _measured(log, read, time, clock, of, wrapped)
    title = file.name if name is None else name
    findings = log.findings
    if ends is not None:
        made = _with_ends(title, measured, ends, f"{file}: ends")
    else:
        if seen_in is None:
            seen, rows = _seen(log, read, file, time, clock, place, of)
        else:
            seen_in.expect_columns([stamp], f"{seen_in.path}: reference_time")
            away = seen_in.read([stamp, *dict.fromkeys(log.columns[role] for role in place)])
            seen, rows = _seen(log, away, seen_in.path, stamp, other, place, of)
        seen += scalar(shift, f"{file}: shift")
        kind: Kind = "poses" if len(place) == 3 else "positions"
        made = DriveLog(title, measured.t, measured.readings, seen, rows, kind)
        both = of["x"], of.get("theta", of["x"])
        check_reference(robot, measured, made.reference_t, made.reference, both, str(file))
    for finding in findings:
        warnings.warn(f"{title}: {finding}", RuntimeWarning, stacklevel=3)
    return made


def _columns(columns: Mapping[str, str] | None, known: Mapping[str, Counter], where: str) -> dict[str, str]:
    """The columns that a user names, by what they are."""
    if columns is not None and not isinstance(columns, Mapping):
        expected = "what a column is and its name, as {'left_wheel_joint': 'enc_l'}"
        raise InputError(where=f"{where}: columns", expected=expected, got=columns)
    asked = {} if columns is None else {str(role): str(column) for role, column in columns.items()}
    for role in asked:
        if role not in (*known, *PLACE):
            raise no_such("joint", role, [*known, *PLACE], f"{where}: columns")
    return asked


def _place(log: _Log, table: TextTable, place: Sequence[str], asked: Mapping[str, str]) -> list[str]:
    """The parts of the reference that its table has; x and y must be there."""
    some = [role for role in PLACE if role in ("x", "y") or role in place]
    if log.columns.get("theta") not in table.header and "theta" not in asked:
        some = some[:2]
    table.expect_columns([log.columns[role] for role in some], f"{table.path}: columns")
    return some


def _measured(
    log: _Log, table: Columns, time: str, clock: Unit | None, units: Mapping[str, Unit], wrapped: Wrapped
) -> MeasuredDrive:
    """Counters in rad or m at times in s, counted on or integrated."""
    assert clock is not None
    names = [*log.counters]
    raw = {role: table.columns[log.columns[role]] for role in names}
    for role in names:
        if units[role].per == "row":
            raw[role] = _added(raw[role], f"{log.path}: {log.columns[role]}", table.lines)
    whole = _whole(log, table, time, [log.columns[role] for role in names], log.path)
    expect(len(whole) > 1, log.path, "at least two rows with numbers of all counters", len(whole))
    whole = _forward(log, table.columns[time][whole] * clock.factor, whole, table.lines, log.path)
    t, lines = table.columns[time][whole] * clock.factor, table.lines[whole]
    check_times(t, clock, str(log.path))
    asked = stated_for(wrapped, names, str(log.path))
    readings, anew = {}, []
    for role in names:
        values, unit, label = raw[role][whole], units[role], log.columns[role]
        if unit.per == "row":
            readings[role] = (values - values[0]) * unit.factor
            continue
        if unit.per == "s":
            readings[role] = cumulative_trapezoid(values * unit.factor, t, initial=0)
            continue
        begins = False if unit.turn is None and asked[role] is True and wrapped is True else asked[role]
        on, span = counted_on(values, unit, begins, label, str(log.path), lambda k: f"line {lines[k]}")
        if span is not None and asked[role] is None:
            anew.append(f"{label} (after {span:.6g} {unit.text.partition(':')[0]})")
        readings[role] = on * unit.factor
    if anew:
        log.findings.append(Finding("turns_counted_on", {"names": anew}))
    labels = {role: log.columns[role] for role in names}
    measured = MeasuredDrive(t, readings, log.counters, {role: units[role] for role in names}, labels)
    log.findings += check_rates(measured, str(log.path))
    check_moves(log.robot, readings, log.counters, str(log.path))
    check_determined(log.robot, readings, str(log.path), log.header)
    return measured


def _added(steps: Array, where: str, lines: Integers) -> Array:
    """What was counted from row to row (N,), added up."""
    lost = ~np.isfinite(steps)
    if lost.any():
        what = "what was counted since the row before is not known"
        raise InputError(what, where=f"{where}: line {lines[int(np.argmax(lost))]}")
    return np.cumsum(steps)


def _whole(log: _Log, table: Columns, time: str, columns: Sequence[str], path: Path) -> Integers:
    """The rows that have all numbers; those that have some of them are told, and those that have none
    where no other column has any."""
    if table.cut and not any(role.code == "row_cut" for role in log.findings):
        log.findings.append(Finding("row_cut", {"file": path.name}))
    stamped = np.isfinite(table.columns[time])
    there = np.array([np.isfinite(table.columns[column]) for column in dict.fromkeys(columns)])
    others = [np.isfinite(values) for name, values in table.columns.items() if name not in (*columns, time)]
    elsewhere = np.any(others, axis=0) if others else np.zeros(len(stamped), dtype=bool)
    good = stamped & there.all(axis=0)
    lost = ~good & ~(stamped & ~there.any(axis=0) & elsewhere)
    if lost.any():
        names = [
            column for column, some in zip(dict.fromkeys(columns), there, strict=True) if (~some & lost).any()
        ]
        names += [time] * bool((~stamped & lost).any())
        log.findings.append(
            Finding(
                "rows_left_out",
                {"file": path.name, "count": int(lost.sum()), "of": len(lost), "names": names},
            )
        )
    return np.flatnonzero(good)


def _forward(log: _Log, t: Array, rows: Integers, lines: Integers, path: Path) -> Integers:
    """The rows of which none has the stamp of the one after it."""
    twice = np.diff(t, append=np.inf) == 0.0
    count = int(twice.sum())
    if count > TWICE * len(t):
        what = f"{count} of {len(t)} rows have the stamp of the row before"
        raise InputError(
            what, where=path, expected="times that increase from row to row: more digits of them"
        )
    if count:
        line = int(lines[rows[int(np.argmax(twice)) + 1]])
        log.findings.append(Finding("stamps_twice", {"file": path.name, "count": count}, {"line": line}))
    kept = rows[~twice]
    expect_forward(t[~twice], str(path), [*lines[kept].tolist()], "line")
    return kept


def _seen(
    log: _Log,
    table: Columns,
    path: Path,
    time: str,
    clock: Unit | None,
    place: Sequence[str],
    units: Mapping[str, Unit],
) -> tuple[Array, Array]:
    """Stamps (M,), s, and x, y and heading where there is one, (M, 2 or 3), of a reference."""
    assert clock is not None
    whole = _whole(log, table, time, [log.columns[role] for role in place], path)
    expect(len(whole) > 1, path, "at least two rows with numbers of the reference", len(whole))
    whole = _forward(log, table.columns[time][whole] * clock.factor, whole, table.lines, path)
    rows = [table.columns[log.columns[role]][whole] * units[role].factor for role in place]
    return table.columns[time][whole] * clock.factor, np.column_stack(rows)


def _with_ends(title: str, measured: MeasuredDrive, ends: str | ArrayLike, where: str) -> DriveLog:
    if isinstance(ends, str):
        expect(ends == CLOSED, where, f"{CLOSED!r}, or where it begins and ends, (2, 3) or (2, 2)", ends)
        return DriveLog.closed(title, measured.t, measured.readings)
    rows = array(ends, where)
    return DriveLog(title, measured.t, measured.readings, measured.t[[0, -1]], rows, "ends")
