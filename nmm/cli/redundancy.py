"""redundancy and laps: what a task leaves free, and whether the posture comes back on a closed path."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from nmm.base.errors import InputError, Setting, SingularError, expect
from nmm.base.files import replaceable
from nmm.cli.groups import Browser, Figures, Loading, Subject, command, opening_command
from nmm.cli.interrupts import shielded
from nmm.cli.options import (
    ResolversOption,
    ScenarioArgument,
    SetOption,
    TableOption,
    flag,
    form_of,
    named,
    option,
    out_option,
    settings_of,
    values_of,
)
from nmm.cli.output import FAILED, OK, complain, print_table, progress, show_table, show_text, warn

if TYPE_CHECKING:
    from nmm.analysis.null_space.laps import Repeatability
    from nmm.analysis.null_space.moving import SelfMotion
    from nmm.analysis.null_space.report import RedundancyReport

#: Between samples of a self-motion, s; less for short ones.
DT = 0.01
#: A page's title does not hide the robot: a longer sentence is left to the table.
LONGEST_TITLE = 100


@command
def redundancy(
    subject: Subject,
    *,
    self_motion: str | None = option(
        "K|INPUT|INPUT=RATE,...",
        "Move along a motion that leaves the task at rest, and back: its number in the list, an "
        "input, or inputs with rates, as v=-1,q2=0.5, of which what moves the task is taken off.",
    ),
    duration: float = option("S", "Of the self-motion one way, s.", default=4.0),
    speed: float = option("SIZE", "Largest size of its inputs, m/s and rad/s together.", default=0.5),
    html: Path | None = option("FILE", "Write the self-motion in 3D: one file, works offline."),
    play: bool = flag("--play", "Play it in the browser; Ctrl-C ends it."),
    browser: Browser,
    loading: Loading,
) -> None:
    """Say what a task leaves free.

    Degrees of static and kinematic redundancy, the ranks at a configuration, the motions of the inputs that
    leave the task at rest, in words, and those of the coordinates that the wheels withhold.

    \b
    nmm redundancy unicycle_2r --task position --at q2=pi/3
    nmm redundancy unicycle_2r --task position --at q2=pi/3 --self-motion 0 --play
    nmm redundancy ur5_unicycle_pose --self-motion v --html self_motion.html
    """
    from nmm.analysis.null_space import report
    from nmm.analysis.null_space.moving import self_motion as moved_along
    from nmm.analysis.null_space.null_fields import expect_direction
    from nmm.base.arrays import positive
    from nmm.cli.subjects import studied

    if self_motion is None and (html is not None or play):
        raise InputError(
            "--html and --play show a self-motion: expected --self-motion, as in --self-motion 0"
        )
    duration, speed = positive(duration, "--duration"), positive(speed, "--speed")
    if html is not None:
        _check_file(html, "--html")
    direction = None if self_motion is None else direction_of(self_motion)
    found = studied(subject.subject, **subject.keywords(), **loading.keywords())
    free = report.redundancy(found.subject, found.q, found.t)
    if direction is None:
        _show_report(free)
        return
    expect_direction(found.robot, free.J, free.rank_J, direction, "--self-motion")
    dt = min(DT, duration / 4.0)
    try:
        moved = moved_along(
            found.subject, found.q, t=found.t, direction=direction, duration=duration, speed=speed, dt=dt
        )
    except SingularError:
        _show_report(free)
        raise
    _show_report(free)
    _show_self_motion(moved)
    short = moved.text if len(moved.text) <= LONGEST_TITLE else "self-motion"
    title = f"{found.robot.name}: {short}"
    motion = moved.trajectory.motion("self-motion")
    if html is not None:
        from nmm.views.playback import write_html

        show_text(f"written: {write_html([motion], html, title=title)}")
    if play:
        from nmm.views.playback import play as play_motions

        play_motions([motion], **browser.keywords(), title=title)


def _check_file(file: Path, option: str) -> None:
    """`InputError` where a file cannot be written, its folder missing: before anything is computed."""
    try:
        folder = replaceable(file).parent
    except InputError as error:
        raise InputError(str(error), where=option) from None
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        what = f"{file} cannot be written: {folder} is not a folder where you may write"
        raise InputError(what, where=option)


def direction_of(text: str) -> int | str | dict[str, float]:
    """What `--self-motion` says: a number, an input, or inputs with rates."""
    text = text.strip()
    expect(text, "--self-motion", "a number, an input or INPUT=RATE,..., as in v=-1,q2=0.5")
    if "=" in text or "," in text:
        return values_of(text.split(","), "--self-motion", "INPUT=RATE,..., as in v=-1,q2=0.5")
    try:
        return int(text)
    except ValueError:
        return text


def _show_report(report: RedundancyReport) -> None:
    from nmm.cli.document import say

    for line in report.text().splitlines():
        say(line)


def _show_self_motion(moved: SelfMotion) -> None:
    from nmm.cli.document import ZERO, number, say

    trajectory, robot = moved.trajectory, moved.trajectory.robot
    for warning in trajectory.warnings:
        warn(warning)
    show_text()
    say(f"self-motion: {moved.text}, and back")
    error = float(abs(trajectory.error).max(initial=0.0))
    # What the feedback moves to take out the drift is noise too: where 1e-10 of `largest` is a zero.
    largest = max(float(abs(trajectory.q).max()), 10.0 * error / ZERO)
    show_table(
        ["coordinate", "unit", "from", "to", "lowest", "highest"],
        [
            [name, unit, *(number(value, largest) for value in (q[0], q[moved.turning], q.min(), q.max()))]
            for name, unit, q in zip(robot.q_names, robot.q_units, trajectory.q.T, strict=True)
        ],
        numeric=["from", "to", "lowest", "highest"],
    )
    say(f"the task stays within {error:.1g} of its value over {trajectory.t[-1]:.3g} s")


@opening_command
def laps(
    scenario: ScenarioArgument,
    *,
    number: int = option("N", "How many; 3 or more tell whether the drift falls.", "--laps", default=5),
    resolvers: ResolversOption = "rg,pg",
    period: float | None = option("S", "Of the path, s.", show="that of circles and periodic splines"),
    settings: SetOption = None,
    out: Annotated[Path | None, out_option("runs/<scenario>-laps")] = None,
    table: TableOption = None,
    figures: Figures,
) -> int:
    """Go round a closed path several times: does the posture come back?

    How far each coordinate drifts in each lap, for each resolver, and whether the drift falls.

    \b
    nmm laps unicycle_2r_position
    nmm laps unicycle_2r_extended_jacobian --resolvers ej --laps 8 --set task.0.reference.radius=0.5

    The folder holds laps.png, laps.csv, summary.json and, for each resolver, a folder with its run.
    """
    from nmm.analysis.null_space.laps import repeatability
    from nmm.scenario import Scenario
    from nmm.views.folders.laps import is_laps, save
    from nmm.views.folders.whole import check_folder

    kinds = named(resolvers, "--resolvers", "kinds with commas between them, as in rg,pg")
    drawn, changed, form = figures.options(), settings_of(settings), form_of(table)
    made = Scenario.load(scenario, changed)
    folder = out or Path("runs") / f"{made.name}-laps"
    check_folder(folder, is_laps)
    with progress(f"{made.name}, {number} laps") as report, _as_options():
        found = repeatability(made, laps=number, resolvers=kinds, period=period, progress=report)
    with shielded():
        save(found, folder, figures=drawn)
    for one in found.laps:
        for warning in one.trajectory.warnings:
            warn(f"{one.name.upper()}: {warning}")
    if form is None:
        _show(found, made.name, folder)
    else:
        from nmm.views.tables import laps_table

        print_table(laps_table(found), form, folder)
    for one in found.laps:
        if not one.finished:
            text = f"{one.name.upper()} {one.verdict}; the part that was computed is in {folder}"
            complain("nmm laps", text)
    return OK if found.complete else FAILED


@contextmanager
def _as_options() -> Iterator[None]:
    """In the block, errors name options where Python has arguments; a key of a resolver is set with its kind,
    since the scenario's own may have no such key."""
    try:
        yield
    except InputError as error:
        from nmm.scenario.resolvers import kinds_with

        where = f"--{error.where}" if error.where in ("laps", "period", "resolvers") else error.where
        mend = error.mend
        match mend:
            case Setting(("resolver", key)):
                mend = f"--set resolver.kind={kinds_with(key)[0]} {mend}"
        raise error.placed(where, mend=mend) from None


def _show(found: Repeatability, name: str, folder: Path) -> None:
    show_text(f"{name}: {found.transient}; period {found.period:.6g} s")
    for one in found.laps:
        show_text()
        columns = ["lap", *(f"Δ{name}" for name in one.robot.q_names), "posture", "platform", "task error"]
        rows = []
        for k, drift in enumerate(one.drift):
            numbers = [*drift, one.distance[k], one.displacement[k], one.errors[k + 1]]
            rows.append([str(k + 1), *(_short(float(number)) for number in numbers)])
        show_table(columns, rows, title=f"{one.name.upper()} {one.verdict}", numeric=columns)
        if one.winding:
            show_text(str(one.winding))
    show_text()
    show_table(["", ""], [["files in", str(folder)]])


def _short(value: float) -> str:
    """Three digits; what is rounding as a power of ten."""
    return f"{value:.3f}" if abs(value) >= 0.01 else f"{value:.0e}" if value else "0"
