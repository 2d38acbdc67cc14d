"""run, compare, paper and play."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.cli.output import complain, progress, shielded, show_table
from nmm.cli.report import describe, show_run
from nmm.errors import InputError
from nmm.runs.storage import check_replaceable, has_format, is_run, replaced_folder
from nmm.scenario import Scenario

if TYPE_CHECKING:
    from nmm.playback.ellipsoids import Wanted
    from nmm.runs.trajectory import Trajectory

#: Marks a folder of `nmm compare`.
COMPARISON = "nmm comparison 1"
OK, FAILED = 0, 1


def run_scenario(
    name: str,
    resolver: str | None,
    settings: Mapping[str, object],
    out: Path | None,
    *,
    html: bool,
    play: bool,
    ellipsoids: Wanted = False,
) -> int:
    """Run a scenario, write its folder, print its table."""
    scenario = _load(name, resolver, settings)
    folder = out or Path("runs") / f"{scenario.name}-{scenario.parts.resolver.kind}"
    check_folder(folder, is_run)
    trajectory = _run(scenario)
    with shielded():
        trajectory.save(folder, html=html, ellipsoids=ellipsoids)
    show_run(trajectory, folder)
    status = _status("nmm run", [trajectory], folder)
    if play and len(trajectory):
        trajectory.play(ellipsoids=ellipsoids)
    return status


def compare_resolvers(
    name: str,
    kinds: Sequence[str],
    settings: Mapping[str, object],
    out: Path | None,
    *,
    ellipsoids: Wanted = False,
) -> int:
    """Run a scenario with several resolvers; write and print how they compare."""
    scenarios = [_load(name, kind, settings) for kind in kinds]
    folder = out or Path("runs") / f"{scenarios[0].name}-compare"
    check_folder(folder, _is_comparison)
    for scenario in scenarios:
        scenario.controller()  # what is wrong with the last one shows before the first one runs
    trajectories: list[Trajectory] = []
    for scenario in scenarios:
        trajectories.append(_run(scenario))
        if trajectories[-1].outcome == "interrupted":
            break
    with shielded():
        _write_comparison(scenarios[0].name, trajectories, folder, ellipsoids)
    table = [dict(describe(trajectory, folder / trajectory.resolver)) for trajectory in trajectories]
    labels = list(dict.fromkeys(label for column in table for label in column))
    show_table(
        ["", *(trajectory.resolver.upper() for trajectory in trajectories)],
        [[label, *(column.get(label, "") for column in table)] for label in labels],
        title=f"{scenarios[0].name}: {scenarios[0].title}",
    )
    show_table(["", ""], [["files in", str(folder)]])
    return _status("nmm compare", trajectories, folder)


def write_the_paper(folder: Path) -> int:
    """The paper's cases and figures; 0 when every claim holds."""
    from nmm.paper import write_paper

    with progress("the paper's four cases") as report:
        paper = write_paper(folder, progress=report)
    show_table(
        ["case", "what the paper claims", "holds"],
        [
            [str(case.number), claim.statement, "yes" if claim.holds else "NO"]
            for case in paper.cases
            for claim in case.claims
        ],
    )
    show_table(["", ""], [["open", str(paper.index)]])
    if not paper.holds:
        complain("nmm paper", f"a claim does not hold; what came out is in {paper.index}")
    return OK if paper.holds else FAILED


def play_folder(folder: Path, port: int | None, *, open_browser: bool, ellipsoids: Wanted = False) -> int:
    """Play a run, or the runs of a comparison in one scene."""
    from nmm.playback import play
    from nmm.runs.trajectory import Trajectory

    if _is_comparison(folder):
        folders = [folder / kind for kind in json.loads((folder / "summary.json").read_text("utf-8"))["runs"]]
    else:
        folders = [folder]
    motions = [
        trajectory.motion() for trajectory in (Trajectory.load(path) for path in folders) if len(trajectory)
    ]
    if not motions:
        raise InputError(f"{folder}: expected a run with at least one sample")
    play(motions, port=port, open_browser=open_browser, ellipsoids=ellipsoids)
    return OK


def ellipsoids_of(wanted: bool, scale: float | None) -> Wanted:
    """What `--ellipsoids` and `--ellipsoid-scale` ask for; a scale alone asks for ellipsoids too.

    Raises
    ------
    InputError : a scale that is not above zero
    """
    if scale is None:
        return wanted
    from nmm.playback.ellipsoids import EllipsoidOptions

    return EllipsoidOptions(scale=scale)


def _load(name: str, resolver: str | None, settings: Mapping[str, object]) -> Scenario:
    kind = {} if resolver is None else {"resolver.kind": resolver}
    return Scenario.load(name, kind | dict(settings))


def _run(scenario: Scenario) -> Trajectory:
    scenario.controller()  # complains before there is a progress bar
    with progress(f"{scenario.name}, {scenario.parts.resolver.kind.upper()}") as report:
        return scenario.run(report)


def _status(command: str, trajectories: Sequence[Trajectory], folder: Path) -> int:
    """0, or 1 with a line for each run that did not reach its end."""
    failed = [trajectory for trajectory in trajectories if not trajectory.complete]
    for trajectory in failed:
        complain(
            command,
            f"{trajectory.resolver.upper()} {trajectory.outcome}: {trajectory.message}; "
            f"the part that was computed is in {folder}",
        )
    return FAILED if failed else OK


def check_folder(folder: Path, is_ours: Callable[[Path], bool]) -> None:
    """`InputError` for a folder that must not, or cannot, be written: before anything is computed."""
    check_replaceable(folder, is_ours)
    parent = folder.absolute().parent
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{folder}: cannot be written: {parent} is not a folder where you may write")


def _is_comparison(folder: Path) -> bool:
    return has_format(folder / "summary.json", COMPARISON)


def _write_comparison(
    title: str, trajectories: Sequence[Trajectory], folder: Path, ellipsoids: Wanted
) -> None:
    with replaced_folder(folder, _is_comparison) as temporary:
        for trajectory in trajectories:
            trajectory.save(temporary / trajectory.resolver, figures=False)
        summary = {
            "format": COMPARISON,
            "complete": all(trajectory.complete for trajectory in trajectories),
            "runs": {trajectory.resolver: trajectory.summary() for trajectory in trajectories},
        }
        (temporary / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        shown = [trajectory for trajectory in trajectories if len(trajectory) > 1]
        if shown:
            from nmm.figures import comparison
            from nmm.playback import write_html

            comparison(shown).savefig(temporary / "comparison.png")
            motions = [trajectory.motion() for trajectory in shown]
            write_html(motions, temporary / "playback.html", title=title, ellipsoids=ellipsoids)
