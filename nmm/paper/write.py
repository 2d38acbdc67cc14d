"""The paper's folder: written whole or not at all."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.errors import InputError
from nmm.folders.whole import has_format, replaced_folder
from nmm.machine import made_with
from nmm.paper.cases import CASES, RESOLVERS
from nmm.paper.results import CaseResult, Claim
from nmm.processes import share_out
from nmm.progress import Progress
from nmm.runs.figure_options import PLAIN, FigureOptions

if TYPE_CHECKING:
    from nmm.tables import Table

#: Marks a folder as one of ours.
FORMAT = "nmm paper 1"
_MARKER = "paper.json"


@dataclass(frozen=True)
class PaperReport:
    """What `write_paper` wrote.

    Attributes
    ----------
    folder, index : the folder, and the page in it
    cases : the numbers of each case
    seconds : that it took
    """

    folder: Path
    index: Path
    cases: tuple[CaseResult, ...]
    seconds: float

    @property
    def claims(self) -> tuple[Claim, ...]:
        """The claims of all cases, in order."""
        return tuple(claim for case in self.cases for claim in case.claims)

    def table(self) -> Table:
        """The numbers of all runs, a column each: "1 RG", "1 PG", "2 RG", ...; read from the folder."""
        from nmm.runs.trajectory import Trajectory
        from nmm.tables import comparison_table

        runs = [
            replace(
                Trajectory.load(self.folder / case.folder / resolver),
                label=f"{case.number} {resolver.upper()}",
            )
            for case in CASES
            for resolver in RESOLVERS
        ]
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
    if jobs < 1:
        raise InputError(f"jobs: expected at least 1, got {jobs}")
    began = time.perf_counter()
    shown = replace(figures, formats=tuple(dict.fromkeys(["png", *figures.formats])))
    done = dict.fromkeys((case.number for case in CASES), 0.0)

    def advance(number: int, fraction: float) -> None:
        done[number] = max(done[number], fraction)
        if progress is not None:
            progress(sum(done.values()) / len(done))

    with replaced_folder(folder, is_paper, patience=1.0) as temporary:
        found = share_out(partial(_case, folder=temporary, figures=shown), list(done), jobs, advance)
        results = tuple(found[number] for number in sorted(found))
        from nmm.paper.page import render

        (temporary / "index.html").write_text(render(results), encoding="utf-8")
        content = {
            "format": FORMAT,
            "made_with": made_with(),
            "holds": all(claim.holds for result in results for claim in result.claims),
            "cases": [asdict(result) for result in results],
        }
        text = json.dumps(content, indent=2, ensure_ascii=False)
        (temporary / _MARKER).write_text(text + "\n", encoding="utf-8")
    folder = Path(folder)
    return PaperReport(folder, folder / "index.html", results, time.perf_counter() - began)


def is_paper(folder: Path) -> bool:
    """Whether a folder was written by `write_paper`."""
    return has_format(folder / _MARKER, FORMAT)


def _case(number: int, progress: Progress, folder: Path, figures: FigureOptions) -> CaseResult:
    # Imported where it is done: a process that only shares the cases out needs none of it.
    from nmm.paper.case_run import run_case

    return run_case(number, folder, progress, figures)
