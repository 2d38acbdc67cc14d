"""singularities: where the task's Jacobian loses rank, in numbers, along a run, and as formulas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from nmm.cli.groups import Loading, Subject, command
from nmm.cli.options import LENGTH, flag, option
from nmm.cli.output import progress, show_table, show_text, warn
from nmm.errors import InputError, expect
from nmm.text_format import listed, value_text

if TYPE_CHECKING:
    from nmm.analysis.search.many_starts import SingularitySearch
    from nmm.analysis.search.nearest import SingularPoint
    from nmm.analysis.singular.minors import Choice
    from nmm.cli.subjects import Studied

#: All minors are listed up to so many.
MANY_MINORS = 60
#: From how many configurations a search starts.
STARTS = 200


@command
def singularities(
    subject: Subject,
    *,
    time: float | None = option(
        "T",
        "Instant, s: the targets' of a scenario; of a run, which is then looked at there only.",
        show="0; the whole run",
    ),
    length: float | None = LENGTH,
    minors: bool | None = flag(
        "--minors/--no-minors",
        "All maximal minors of J, or none.",
        default=None,
        show=f"all, up to {MANY_MINORS}",
    ),
    minor: list[str] | None = option(
        "INPUT,INPUT,...", "Only the minor of these columns of J. May be repeated."
    ),
    symbolic: bool = flag("--symbolic", "f, J and its minors as formulas, and what follows from them."),
    latex: bool = flag("--latex", "With --symbolic: the same as LaTeX, the body of a document."),
    as_json: bool = flag("--json", "The numbers as JSON on standard output, for scripts."),
    search: bool = flag("--search", "Look for singular configurations from many starts."),
    nearest: bool = flag("--nearest", "Look for the singular configuration nearest to --at."),
    starts: int | None = option("N", "From how many configurations --search starts.", show=str(STARTS)),
    seed: int | None = option("N", "Draws other starts of --search and --nearest.", show="0"),
    part: str | None = option(
        "NAME",
        "Of --search and --nearest: where this part is singular; platform, arm, or an arm's name.",
        show="the whole robot",
    ),
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
    expect(symbolic or not latex, "--latex", "--symbolic with it, whose formulas it writes")
    expect(not (as_json and (symbolic or looking)), "--json", "without --symbolic, --search and --nearest")
    expect(not (symbolic and looking), "--symbolic", "without --search and --nearest, which are numeric")
    alone = minor is None or (minors is None and not looking)
    expect(alone, "--minor", "without --minors, --no-minors, --search and --nearest")
    expect(search or starts is None, "--starts", "with --search")
    expect(not looking or minors is None, "--minors", "without --search and --nearest")
    for name, one in (("--seed", seed), ("--part", part)):
        expect(looking or one is None, name, "with --search or --nearest")
    from nmm.analysis import analyse, analyse_along
    from nmm.cli import singularity_history, singularity_report
    from nmm.cli.document import print_json, say, show
    from nmm.cli.subjects import studied
    from nmm.cli.symbolic import show_formulas, show_latex

    given = studied(subject.subject, t=time, **subject.keywords(), **loading.keywords())
    if subject.at:  # outside the limits may be asked for, but not by mistake
        try:
            given.robot.check_limits(given.q)
        except InputError as error:
            warn(str(error))
    if looking:
        count = STARTS if starts is None else starts
        options = {"seed": 0 if seed is None else seed, "part": part or "robot", "length": length}
        search_command(given, count if search else None, nearest, **options)
        return
    choice, left_out = _chosen(given, minors, minor)
    run = given.trajectory
    if run is not None and symbolic:
        raise InputError(f"{subject.subject} is a run", where="--symbolic", expected="a robot or a scenario")
    if run is not None and time is None and subject.at:
        what = f"{subject.subject} is a run, which is where it was; expected --time"
        raise InputError(what, where="--at")
    if symbolic:
        from nmm.analysis.formulas import symbolic as formulas_of
        from nmm.analysis.singular.jacobians import Jacobians

        Jacobians(given.subject)  # complains about what is wrong with the input, formulas or not
        try:
            found = formulas_of(given.robot, given.task)
        except InputError as error:
            if latex:
                raise InputError(error.what, where="--latex") from None
            say(f"No formulas: {error.what}. Here are the numbers.")
            say()
        else:
            (show_latex if latex else show_formulas)(given, found, minor)
            return
    if run is not None and time is None:
        history = analyse_along(given.subject, run, length=length, minors=choice)
        items = [*singularity_history.described(given, run, history, length, left_out)]
        data = singularity_history.history_data(given, history)
    else:
        report = analyse(given.subject, given.q, given.t, length=length, minors=choice)
        items = [*singularity_report.described(given, report, length, left_out)]
        data = singularity_report.report_data(given, report)
    if as_json:
        print_json(data, items)
    else:
        show(items)


def _chosen(given: Studied, all_or_none: bool | None, some: Sequence[str] | None) -> tuple[Choice, int]:
    if some is not None:
        return list(some), 0
    if all_or_none is not None:
        return all_or_none, 0
    from nmm.analysis.singular.jacobians import stacked

    count = math.comb(given.robot.n_u, len(stacked(given.task).rows(given.robot)))
    return (True, 0) if count <= MANY_MINORS else (False, count)


def search_command(
    studied: Studied, starts: int | None = None, nearest: bool = False, **options: Any
) -> None:
    """Search all singular configurations from so many starts, the nearest to the one studied, or both; print
    what was found. `options` : seed, part and length of `find_singularities`."""
    from nmm.analysis.search.many_starts import find_singularities
    from nmm.analysis.search.nearest import nearest_singularity

    options["t"] = studied.t
    if starts is not None:
        with progress("searching") as options["progress"]:
            search = find_singularities(studied.subject, starts=starts, at=studied.q, **options)
        show_search(search)
    if nearest:
        with progress("the nearest") as options["progress"]:
            found = nearest_singularity(studied.subject, studied.q, **options)
        if starts is not None:
            show_text()
        show_nearest(found)


def show_search(search: SingularitySearch) -> None:
    """The families in a table, what each loses and where, what was searched."""
    show_text(search.summary)
    if search.found and not search.everywhere:
        rows = [
            (
                str(number),
                family.conditions,
                ", ".join(family.free) or "nothing",
                f"{family.dimension} of {family.moving}",
                f"{family.rank} of {family.full_rank}",
                str(family.starts),
            )
            for number, family in enumerate(search.families, 1)
        ]
        columns = ["", "where", "free", "dimension", "rank", "starts"]
        show_table(columns, rows, numeric=columns[3:])
    for number, family in enumerate(search.families, 1):
        at = search.configuration_text(family.examples[0])
        which = "" if search.everywhere else f"{number} "
        show_text(f"{which}loses {listed(family.lost)}{f', at {at}' if at else ''}")
    for line in search.remarks:
        show_text(line)


def show_nearest(point: SingularPoint | None) -> None:
    if point is None:
        show_text("no singular configuration found near this one, nor elsewhere inside the limits")
        return
    show_text(point.summary)
    if point.changes:
        rows = [
            (name, value_text(float(there), unit), value_text(point.changes[name], unit))
            for name, there, unit in zip(point.names, point.q, point.units, strict=True)
            if name in point.changes
        ]
        show_table(["", "there", "change"], rows)
    for line in point.remarks:
        show_text(line)
