"""The paper's folder, written whole or not at all: case after case, and one page."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from nmm import __version__
from nmm.base.errors import RunError, expect
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.base.processes import share_out
from nmm.base.progress import Progress, between
from nmm.base.templates import template
from nmm.cli.paper.cases import CASES, DT, RESOLVERS, Case, CaseResult, PaperClaim
from nmm.cli.paper.claims import claims, smallest_determinant, table
from nmm.motion.trajectory import Outcome, Trajectory
from nmm.views.folders.whole import FolderKind, replaced_folder

if TYPE_CHECKING:
    from nmm.scenario import Scenario
    from nmm.views.tables import Table

is_paper = FolderKind("nmm paper 1", "paper.json")


@dataclass(frozen=True)
class PaperReport:
    """What `write_paper` wrote: the folder, the page in it, the numbers of each case; how long it took, s."""

    folder: Path
    index: Path
    cases: tuple[CaseResult, ...]
    seconds: float

    @property
    def claims(self) -> tuple[PaperClaim, ...]:
        """The claims of all cases, in order."""
        return tuple(claim for case in self.cases for claim in case.claims)

    def table(self) -> Table:
        """The numbers of all runs, a column each: "1 RG", "1 PG", "2 RG", ...; read from the folder."""
        from nmm.views.tables import comparison_table

        runs = []
        for case in CASES:
            for resolver in RESOLVERS:
                run = Trajectory.load(self.folder / case.folder / resolver)
                runs.append(replace(run, label=f"{case.number} {resolver.upper()}"))
        return comparison_table(runs)

    @property
    def holds(self) -> bool:
        """Whether every claim holds."""
        return all(claim.holds for claim in self.claims)


def write_paper(
    folder: str | Path,
    progress: Progress | None = None,
    jobs: int = 2,
    *,
    figures: FigureOptions = PLAIN,
) -> PaperReport:
    """Run the paper's four cases with RG and PG, and write figures, numbers, playback and index.html.

    Parameters
    ----------
    folder : a new folder, or one that an earlier call wrote, which is replaced
    progress : called with the fraction done
    jobs : over how many processes the cases are shared out; with more than 1, a script needs
        `if __name__ == "__main__":`
    figures : formats and width; PNG, which the page shows, is written always

    Raises
    ------
    InputError : jobs below 1; the folder exists and is not ours, or cannot be written
    RunError : a run did not reach its end
    """
    expect(jobs >= 1, "jobs", "at least 1", jobs)
    began = time.perf_counter()
    shown = replace(figures, formats=tuple(dict.fromkeys(["png", *figures.formats])))
    done = dict.fromkeys((case.number for case in CASES), 0.0)

    def advance(number: int, fraction: float) -> None:
        done[number] = max(done[number], fraction)
        if progress is not None:
            progress(sum(done.values()) / len(done))

    with replaced_folder(folder, is_paper, patience=1.0) as temporary:
        by_number = share_out(partial(run_case, folder=temporary, figures=shown), list(done), jobs, advance)
        results = tuple(by_number[number] for number in sorted(by_number))
        (temporary / "index.html").write_text(render(results), encoding="utf-8")
        holds = all(claim.holds for result in results for claim in result.claims)
        is_paper.write(temporary, {"holds": holds, "cases": [asdict(result) for result in results]})
    return PaperReport(Path(folder), Path(folder, "index.html"), results, time.perf_counter() - began)


def render(results: Sequence[CaseResult]) -> str:
    """The page of these cases, with relative links only."""
    holding = [claim.holds for result in results for claim in result.claims]
    return template("nmm.cli.paper", "templates", "index.html").render(
        cases=[(CASES[result.number - 1], result) for result in results],
        resolvers=RESOLVERS,
        dt_ms=f"{1000.0 * DT:g}",
        version=__version__,
        holding=sum(holding),
        claims=len(holding),
    )


def run_case(number: int, progress: Progress, folder: Path, figures: FigureOptions) -> CaseResult:
    """Run a case with RG and PG, and write its files into the existing `folder`; RunError if a run did not
    reach its end, KeyboardInterrupt if it was interrupted."""
    from nmm.views.playback import write_html

    began = time.perf_counter()
    case = CASES[number - 1]
    rg, pg = _runs(case, between(progress, 0.0, 0.3))
    determinant = smallest_determinant(rg, _scenario(case, "rg").controller())
    rows, checked = table(rg, pg, determinant), claims(case, rg, pg, determinant)
    own = folder / case.folder
    own.mkdir()
    for k, trajectory in enumerate((rg, pg)):
        trajectory.save(own / trajectory.resolver, figures=figures)
        progress(0.4 + 0.15 * k)
    _write_figures(case, rg, pg, folder, figures)
    progress(0.7)
    write_html([rg, pg], own / "playback.html", title=f"Case {case.number}: {case.title}")
    progress(1.0)
    return CaseResult(number, tuple(rows), tuple(checked), len(rg), time.perf_counter() - began)


def _scenario(case: Case, resolver: str) -> Scenario:
    from nmm.scenario import Scenario

    return Scenario.load(case.scenario, {"dt": DT}).with_resolver(resolver)


def _runs(case: Case, progress: Progress | None) -> list[Trajectory]:
    runs: list[Trajectory] = []
    for k, resolver in enumerate(RESOLVERS):
        trajectory = _scenario(case, resolver).run(between(progress, 0.5 * k, 0.5))
        if trajectory.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt
        if not trajectory.complete:
            raise RunError(f"case {case.number} with {resolver.upper()}: {trajectory.message}")
        runs.append(trajectory)
    return runs


def _write_figures(case: Case, rg: Trajectory, pg: Trajectory, folder: Path, figures: FigureOptions) -> None:
    from nmm.views.figures import objective_comparison, stroboscopic, tracking
    from nmm.views.figures.style import save_as

    (motion, _), (objective, _) = case.figures
    across = figures.across()
    shown = (tracking if case.number == 4 else stroboscopic)(rg, **across)
    save_as(shown, folder, f"fig{motion:02d}", figures)
    compared = objective_comparison([rg, pg], zoom=(0.0, case.zoom), symbol=case.symbol, **across)
    save_as(compared, folder, f"fig{objective:02d}", figures)
