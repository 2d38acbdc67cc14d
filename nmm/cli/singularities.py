"""singularities: where the task's Jacobian loses rank, in numbers, along a run, and as formulas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from nmm.base.errors import InputError, expect
from nmm.base.text_format import listed
from nmm.cli.groups import AddedOptions, Loading, PlaceOfOptions, Subject, command
from nmm.cli.options import LENGTH, flag, option
from nmm.cli.output import warn

if TYPE_CHECKING:
    from nmm.analysis.singular.minors import Choice
    from nmm.cli.subjects import Studied

#: All minors are listed up to so many.
MANY_MINORS = 60


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
    formulas: Annotated[AddedOptions, PlaceOfOptions("singularities.formulas")],
    as_json: bool = flag("--json", "The numbers as JSON on standard output, for scripts."),
    search: Annotated[AddedOptions, PlaceOfOptions("singularities.search")],
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
    symbolic, looking = formulas.asked(), search.asked()
    formulas.check()
    others = listed([*formulas.answers, *search.answers])
    expect(not (as_json and (symbolic or looking)), "--json", f"without {others}")
    searches = listed(search.answers)
    expect(not (symbolic and looking), symbolic, f"without {searches}, which are numeric")
    alone = minor is None or (minors is None and not looking)
    expect(alone, "--minor", f"without {listed(['--minors', '--no-minors', *search.answers])}")
    search.check()
    expect(not looking or minors is None, "--minors", f"without {searches}")
    from nmm.analysis import analyse, analyse_along
    from nmm.cli import singularity_history, singularity_report
    from nmm.cli.document import print_json, show
    from nmm.cli.subjects import studied

    study = studied(subject.subject, t=time, **subject.keywords(), **loading.keywords())
    if subject.at:  # outside the limits may be asked for, but not by mistake
        try:
            study.robot.check_limits(study.q)
        except InputError as error:
            warn(str(error))
    if looking:
        search.answer(study, length)
        return
    choice, left_out = _chosen(study, minors, minor)
    run = study.trajectory
    if run is not None and symbolic:
        raise InputError(f"{subject.subject} is a run", where=symbolic, expected="a robot or a scenario")
    if run is not None and time is None and subject.at:
        what = f"{subject.subject} is a run, which is where it was; expected --time"
        raise InputError(what, where="--at")
    if symbolic and formulas.answer(study, minor) is not None:
        return
    if run is not None and time is None:
        history = analyse_along(study.subject, run, length=length, minors=choice)
        items = [*singularity_history.described(study, run, history, length, left_out)]
        data = singularity_history.history_data(study, history)
    else:
        report = analyse(study.subject, study.q, study.t, length=length, minors=choice)
        items = [*singularity_report.described(study, report, length, left_out)]
        data = singularity_report.report_data(study, report)
    if as_json:
        print_json(data, items)
    else:
        show(items)


def _chosen(study: Studied, all_or_none: bool | None, some: Sequence[str] | None) -> tuple[Choice, int]:
    if some is not None:
        return list(some), 0
    if all_or_none is not None:
        return all_or_none, 0
    from nmm.analysis.singular.jacobians import stacked

    count = math.comb(study.robot.n_u, len(stacked(study.task).rows(study.robot)))
    return (True, 0) if count <= MANY_MINORS else (False, count)
