"""One case from its scenario to its files: both runs, their folders, the paper's figures, the playback."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.errors import RunError
from nmm.paper.cases import CASES, DT, RESOLVERS, Case
from nmm.paper.claims import claims
from nmm.paper.numbers import smallest_determinant, table
from nmm.paper.results import CaseResult
from nmm.progress import Progress, between
from nmm.runs.figure_options import PLAIN, FigureOptions
from nmm.runs.trajectory import Outcome, Trajectory

if TYPE_CHECKING:
    from nmm.scenario import Scenario


def run_case(number: int, folder: Path, progress: Progress, figures: FigureOptions = PLAIN) -> CaseResult:
    """Run a case with RG and PG, and write its files into `folder`, which exists.

    Raises
    ------
    RunError : a run did not reach its end
    KeyboardInterrupt : a run was interrupted
    """
    began = time.perf_counter()
    case = CASES[number - 1]
    rg, pg = _runs(case, between(progress, 0.0, 0.3))
    determinant = smallest_determinant(rg, _scenario(case, "rg").controller())
    rows, found = table(rg, pg, determinant), claims(case, rg, pg, determinant)
    own = folder / case.folder
    own.mkdir()
    for k, trajectory in enumerate((rg, pg)):
        trajectory.save(own / trajectory.resolver, figures=figures)
        progress(0.4 + 0.15 * k)
    _write_figures(case, rg, pg, folder, figures)
    progress(0.7)
    _write_playback(case, [rg, pg], own / "playback.html")
    progress(1.0)
    return CaseResult(number, tuple(rows), tuple(found), len(rg), time.perf_counter() - began)


def _scenario(case: Case, resolver: str) -> Scenario:
    from nmm.scenario import Scenario

    return Scenario.load(case.scenario, {"dt": DT}).with_resolver(resolver)


def _runs(case: Case, progress: Progress | None) -> list[Trajectory]:
    found: list[Trajectory] = []
    for k, resolver in enumerate(RESOLVERS):
        share = between(progress, k / len(RESOLVERS), 1.0 / len(RESOLVERS))
        trajectory = _scenario(case, resolver).run(share)
        if trajectory.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt
        if not trajectory.complete:
            raise RunError(f"case {case.number} with {resolver.upper()}: {trajectory.message}")
        found.append(trajectory)
    return found


def _write_figures(case: Case, rg: Trajectory, pg: Trajectory, folder: Path, figures: FigureOptions) -> None:
    """The paper's two figures of the case, fig03.png to fig10.png."""
    from nmm.figures import objective_comparison, stroboscopic, tracking
    from nmm.figures.files import save_as

    (motion, _), (objective, _) = case.figures
    across = figures.across()
    shown = (tracking if case.number == 4 else stroboscopic)(rg, **across)
    save_as(shown, folder, f"fig{motion:02d}", figures)
    compared = objective_comparison([rg, pg], zoom=(0.0, case.zoom), symbol=case.symbol, **across)
    save_as(compared, folder, f"fig{objective:02d}", figures)


def _write_playback(case: Case, runs: list[Trajectory], path: Path) -> None:
    from nmm.playback import write_html

    title = f"Case {case.number}: {case.title}"
    write_html(runs, path, title=title)
