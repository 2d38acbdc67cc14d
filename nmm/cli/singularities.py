"""singularities: where the task's Jacobian loses rank, in numbers, along a run, and as formulas."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.cli.groups import Loading, Subject, command
from nmm.cli.options import LengthOption
from nmm.errors import InputError

if TYPE_CHECKING:
    from nmm.analysis.singular.minors import Choice
    from nmm.cli.subjects import Studied
    from nmm.runs.trajectory import Trajectory

#: All minors are listed up to so many.
MANY_MINORS = 60
#: From how many configurations a search starts.
STARTS = 200


@command
def singularities(
    subject: Subject,
    *,
    time: Annotated[
        float | None,
        typer.Option(
            metavar="T",
            help="Instant, s: the targets' of a scenario; of a run, which is then looked at there only.",
            show_default="0; the whole run",
        ),
    ] = None,
    length: LengthOption = None,
    minors: Annotated[
        bool | None,
        typer.Option(
            "--minors/--no-minors",
            help="All maximal minors of J, or none.",
            show_default=f"all, up to {MANY_MINORS}",
        ),
    ] = None,
    minor: Annotated[
        list[str] | None,
        typer.Option(
            metavar="INPUT,INPUT,...", help="Only the minor of these columns of J. May be repeated."
        ),
    ] = None,
    symbolic: Annotated[
        bool,
        typer.Option("--symbolic", help="f, J and its minors as formulas, and what follows from them."),
    ] = False,
    latex: Annotated[
        bool, typer.Option("--latex", help="With --symbolic: the same as LaTeX, the body of a document.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="The numbers as JSON on standard output, for scripts.")
    ] = False,
    search: Annotated[
        bool, typer.Option("--search", help="Look for singular configurations from many starts.")
    ] = False,
    nearest: Annotated[
        bool, typer.Option("--nearest", help="Look for the singular configuration nearest to --at.")
    ] = False,
    starts: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="From how many configurations --search starts.", show_default=str(STARTS)
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(metavar="N", help="Draws other starts of --search and --nearest.", show_default="0"),
    ] = None,
    part: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Of --search and --nearest: where this part is singular; platform, arm, or an arm's name.",
            show_default="the whole robot",
        ),
    ] = None,
    loading: Loading,
) -> None:
    """Say where a robot loses rank with a task, and why.

    J maps the inputs to the task's velocity. Its rank and singular values, for the platform alone, the arm
    alone and the whole robot: so one sees which of the arm's singularities the platform removes. The task's
    direction that is lost, the inputs that bring it back, the minors of J by the names of their columns,
    and whether a resolver fails where J does not: EJ's J_e, RG's partitions.

    \b
    nmm singularities unicycle_2r --task position --at q1=0.4
    nmm singularities unicycle_2r --task position --task heading:link2 --symbolic
    nmm singularities unicycle_2r --task position --set d=0 --symbolic
    nmm singularities unicycle_2r_link_pointing --at q1=pi/2 --length 0.8
    nmm singularities arm.urdf --platform fixed --task pose:tool0 --search
    nmm singularities runs/unicycle_2r_switching-rg

    With --symbolic the formulas come from the robot's file, joint by joint: c12 is cos(q1 + q2). Those of
    a large arm are too long to read: it says so, and gives the numbers. The exit status is 0 where the robot
    is singular too: that is an answer.
    """
    looking = search or nearest
    other = "expected with --search or --nearest"
    wrong = {
        "--latex": (latex and not symbolic, "expected --symbolic with it, whose formulas it writes"),
        "--json": (as_json and (symbolic or looking), "expected without --symbolic, --search and --nearest"),
        "--symbolic": (symbolic and looking, "expected without --search and --nearest, which are numeric"),
        "--minor": (
            minor is not None and (minors is not None or looking),
            "expected without --minors, --no-minors, --search and --nearest",
        ),
        "--starts": (starts is not None and not search, "expected with --search"),
        "--minors": (minors is not None and looking, "expected without --search and --nearest"),
        "--seed": (seed is not None and not looking, other),
        "--part": (part is not None and not looking, other),
    }
    for option, (is_wrong, text) in wrong.items():
        if is_wrong:
            raise InputError(f"{option}: {text}")
    from nmm.cli.subjects import studied

    given = studied(subject.subject, t=time, **subject.keywords(), **loading.keywords())
    if subject.at:
        _warn_of_limits(given)
    if looking:
        from nmm.cli.searching import search_command

        search_command(
            given,
            (STARTS if starts is None else starts) if search else None,
            0 if seed is None else seed,
            part or "robot",
            nearest,
            length,
        )
        return
    choice, left_out = _chosen(given, minors, minor)
    if given.trajectory is not None and symbolic:
        raise InputError(f"--symbolic: expected a robot or a scenario; {subject.subject} is a run")
    if given.trajectory is not None and time is None:
        if subject.at:
            raise InputError(f"--at: {subject.subject} is a run, which is where it was; expected --time")
        _along(given, given.trajectory, choice, left_out, length, as_json)
    elif symbolic:
        _formulas(given, choice, left_out, length, minor is not None, latex)
    else:
        _here(given, choice, left_out, length, as_json)


def _warn_of_limits(given: Studied) -> None:
    """A configuration outside the limits may be asked for, but not by mistake."""
    from nmm.cli.output import warn

    try:
        given.robot.check_limits(given.q)
    except InputError as error:
        warn(str(error))


def _chosen(given: Studied, all_or_none: bool | None, listed: Sequence[str] | None) -> tuple[Choice, int]:
    """Which minors, and how many there are when they are left out because they are many."""
    if listed is not None:
        return list(listed), 0
    if all_or_none is not None:
        return all_or_none, 0
    from nmm.analysis.singular.reached import stacked

    count = math.comb(given.robot.n_u, len(stacked(given.task).rows(given.robot)))
    return (True, 0) if count <= MANY_MINORS else (False, count)


def _here(given: Studied, choice: Choice, left_out: int, length: float | None, as_json: bool) -> None:
    """The numbers at a configuration."""
    from nmm.analysis import analyse

    report = analyse(given.subject, given.q, given.t, length=length, minors=choice)
    if as_json:
        from nmm.cli.singularity_json import report_data

        _print_json(report_data(given, report))
    else:
        from nmm.cli.singularity_tables import show_report

        show_report(given, report, length, left_out)


def _along(
    given: Studied, run: Trajectory, choice: Choice, left_out: int, length: float | None, as_json: bool
) -> None:
    """The numbers along a run."""
    from nmm.analysis import analyse_along

    history = analyse_along(given.subject, run, length=length, minors=choice)
    if as_json:
        from nmm.cli.singularity_json import history_data

        _print_json(history_data(given, history))
    else:
        from nmm.cli.singularity_history import show_history

        show_history(given, run, history, length, left_out)


def _formulas(
    given: Studied, choice: Choice, left_out: int, length: float | None, listed: bool, latex: bool
) -> None:
    """The formulas; the numbers where there are none that a person could read."""
    from nmm.cli.symbolic_latex import show_latex
    from nmm.cli.symbolic_text import formulas, show_formulas

    found, reason = formulas(given)
    if found is None:
        if latex:
            raise InputError(f"--latex: {reason}")
        from nmm.cli.singularity_words import say

        say(f"No formulas: {reason}. Here are the numbers.")
        say()
        _here(given, choice, left_out, length, as_json=False)
        return
    columns = choice if listed and not isinstance(choice, bool) else None
    show = show_latex if latex else show_formulas
    show(given, found, columns)


def _print_json(data: dict[str, Any]) -> None:
    """A key a line."""
    lines = [f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in data.items()]
    print("{\n" + ",\n".join(lines) + "\n}")
