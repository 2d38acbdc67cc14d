"""`Sweep`: many rollouts of a scenario, over ranges and lists of its keys."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, closing
from functools import partial, reduce
from operator import getitem
from pathlib import Path
from typing import Any

from nmm import __version__
from nmm.base.arrays import counted
from nmm.base.bundled import bundled_scenarios, bundled_sweeps
from nmm.base.cores import cores
from nmm.base.errors import InputError, ScenarioError, expect, expect_known
from nmm.base.processes import as_done
from nmm.base.progress import Progress
from nmm.base.text_format import listed
from nmm.base.trust import trusting
from nmm.plugins.sweeps.cluster import as_done_by, cluster
from nmm.plugins.sweeps.definition import (
    GRID,
    KEPT,
    SAMPLERS,
    Definition,
    Range,
    Varied,
    check_total,
    check_varied,
    varied,
)
from nmm.plugins.sweeps.folder import SweepFolder, check_size, is_sweep
from nmm.plugins.sweeps.result import SweepResult, write_page
from nmm.plugins.sweeps.rows import MEASURED, computed, wholly_compiled
from nmm.scenario import Scenario
from nmm.scenario.document import read_file
from nmm.scenario.numbers import number
from nmm.scenario.scenario import SUFFIXES
from nmm.scenario.yaml_text import dotted

#: Up to this many rows a core, threads compute them; for more, processes pay.
FEW_ROWS = 128
#: The most threads of a process, on any number of cores.
MOST_THREADS = 3


class Sweep:
    """Many rollouts of a scenario: ranges are sampled, and each point is run with every listed value.

    Parameters
    ----------
    scenario : a bundled name, a file, or a `Scenario`
    vary : by dotted key, as for `Scenario.override`: (lower, upper) is sampled; (lower, upper, count) and a
        list of values are combined; text ("-pi:pi", "0:1:11", "rg,pg") as on the command line
    samples : points of the ranges; not given where there is no range
    sampler : "sobol" (scrambled), "lhs" (Latin hypercube), "random", or "grid" where there is no range
    seed : of the sampler; the parameters of a row depend on it and the row's number alone
    settings : set before anything varies, by dotted key
    keep : None, "trajectories" (a run folder a row) or "playback" (with playback.html)
    name, title : the scenario's, when not given

    Raises
    ------
    InputError : what is wrong with any of these

    Examples
    --------
    >>> sweep = nmm.Sweep("unicycle_2r_position", {"resolver.kind": ["rg", "pg"]}, settings={"duration": 2})
    >>> swept = sweep.run("runs/kinds", jobs=1)
    >>> swept.outcomes
    {'completed': 2}
    """

    def __init__(
        self,
        scenario: str | Path | Scenario,
        vary: Mapping[str, object],
        *,
        samples: object = None,
        sampler: str | None = None,
        seed: object = 0,
        settings: Mapping[str, object] | None = None,
        keep: str | None = None,
        name: str = "",
        title: str = "",
    ) -> None:
        loaded = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
        self.scenario = loaded.with_settings(settings) if settings else loaded
        self.scenario.controller()
        varying = tuple(varied(key, values) for key, values in vary.items())
        expect(varying, "vary", "at least one key to vary, such as q0.x=-1:1")
        sampler, points = _sampling(varying, sampler, samples)
        if keep is not None:
            expect_known("what to keep", keep, KEPT, "keep")
        check_varied(self.scenario, varying)
        robot, document = self.scenario.robot(), self.scenario.document
        data: Any = document.data
        bundled = {path: name for name, path in bundled_scenarios().items()}
        self.definition = Definition(
            name=name or self.scenario.name,
            title=title or self.scenario.title or name or self.scenario.name,
            scenario=bundled.get(self.scenario.path) or str(self.scenario.path.resolve()),
            settings={dotted(place): reduce(getitem, place, data) for place in document.settings},
            document=document,
            keys=self.scenario.resolved(),
            vary=varying,
            samples=points,
            sampler=sampler,
            seed=_whole(seed, "seed", 0),
            keep=keep,
            robot=robot.fingerprint,
            inputs=tuple(robot.u_names),
            version=__version__,
        )

    @classmethod
    def load(cls, name_or_path: str | Path, *, trust: bool = False, **changes: Any) -> Sweep:
        """A sweep that is bundled (`unicycle_2r_starts`) or a YAML file, with other keywords. `trust`: of its
        robots' files, as of `nmm.load`.

        Raises
        ------
        InputError : no such sweep, or what is wrong with it
        """
        with trusting(trust):
            return cls(**(read_sweep(name_or_path) | changes))

    def run(
        self,
        folder: str | Path,
        *,
        jobs: int | None = None,
        scheduler: str | None = None,
        progress: Progress | None = None,
    ) -> SweepResult:
        """Compute the rows that are not in the folder yet, and write table and page.

        After an interruption, the same sweep in the same folder goes on and ends with the same table.

        Parameters
        ----------
        folder : a new or an empty one, or one where this sweep was begun
        jobs : rows computed at the same time on this machine, by default one a core: by threads if rows are
            few and share a robot, else by processes, for which a script needs `if __name__ == "__main__":`
        scheduler : the address of a Dask scheduler (tcp://host:port) whose workers compute instead
        progress : called with the fraction done, of the rows that were done before, too

        Raises
        ------
        InputError : the folder is another's, scheduler or workers will not do, the sweep is too large,
            or pyarrow (of `sweep`) is missing
        RunError : a process or the cluster was lost
        """
        definition, place = self.definition, SweepFolder(folder, self.definition)
        if jobs is not None and scheduler is not None:
            problem = "a cluster has as many as it has workers"
            raise InputError(problem, where="jobs", expected="jobs or scheduler")
        local = _whole(cores() if jobs is None else jobs, "jobs", 1)
        place.check()
        with ExitStack() as stack:
            client = None if scheduler is None else stack.enter_context(cluster(scheduler))
            if not is_sweep(place.path):
                workers = local if client is None else sum(client.nthreads().values())
                check_size(definition, workers, place.path)
            stack.enter_context(place.opened())
            missing = place.missing()
            again = place.damaged(missing)
            done = _Done(definition, missing, progress)
            threads = self._threads(local, sum(map(len, map(definition.indices, missing))))
            job = partial(computed, definition=definition, trust=self.scenario.trust)
            if missing:
                results = (
                    as_done(partial(job, threads=threads), missing, -(-local // threads), done.report)
                    if client is None
                    else as_done_by(client, job, missing)
                )
                for chunk, rows in stack.enter_context(closing(results)):
                    place.add(chunk, rows)
                    done.report(chunk, 1.0)
            place.finish()
            swept = SweepResult(place.path, definition, again)
            write_page(swept, self._units())
        return swept

    def _units(self) -> dict[str, str]:
        """Units of columns that the robot and its tasks tell."""
        robot = self.scenario.robot()
        by_column = {f"q0.{name}": unit for name, unit in zip(robot.q_names, robot.q_units, strict=True)}
        by_column |= {f"u_max.{name}": unit for name, unit in zip(robot.u_names, robot.u_units, strict=True)}
        units = {row.unit for task in self.scenario.controller().task for row in task.rows(robot)}
        if len(units) == 1 and not any(axis.key.startswith("task") for axis in self.definition.vary):
            unit = units.pop()
            by_column |= {column.name: unit for column in MEASURED if column.name.startswith("error_")}
        return by_column

    def _threads(self, jobs: int, rows: int) -> int:
        """Rows that a process computes at the same time, of `jobs` in all, with `rows` left: several if they
        are too few for processes to pay, robots stay the same, and steps are compiled as a whole, which holds
        no GIL; limited by what Python does in between."""
        controller, varying = self.scenario.controller(), self.definition.vary
        shared = not any(axis.key.split(".")[0] == "robot" for axis in varying)
        if rows > FEW_ROWS * jobs or not shared or self.definition.keep or not wholly_compiled(controller):
            return 1
        return -(-jobs // -(-jobs // MOST_THREADS))


class _Done:
    def __init__(self, definition: Definition, missing: list[int], progress: Progress | None) -> None:
        self._sizes = {chunk: len(definition.indices(chunk)) for chunk in missing}
        self._under_way = dict.fromkeys(missing, 0.0)
        self._rows, self._progress = definition.rows, progress
        self._done = definition.rows - sum(self._sizes.values()) + 0.0
        if progress is not None:
            progress(self._done / self._rows)

    def report(self, chunk: int, fraction: float) -> None:
        self._done += self._sizes[chunk] * (fraction - self._under_way[chunk])
        self._under_way[chunk] = fraction
        if self._progress is not None:
            self._progress(self._done / self._rows)


def _sampling(vary: tuple[Varied, ...], sampler: str | None, samples: object) -> tuple[str, int]:
    ranges = [axis for axis in vary if isinstance(axis, Range)]
    chosen = sampler or ("sobol" if ranges else GRID)
    expect_known("sampler", chosen, [GRID, *SAMPLERS], "sampler")
    if chosen == GRID and ranges:
        axis = ranges[0]
        expected = f"{axis.lower:g}:{axis.upper:g}:COUNT, or another sampler ({listed(list(SAMPLERS), 'or')})"
        raise InputError("a grid needs a count", where=f"vary {axis.key}", expected=expected)
    if chosen != GRID and not ranges:
        problem = f"{chosen} has nothing to sample, as every key has its values"
        raise InputError(problem, where="sampler", expected="a range LOWER:UPPER")
    if not ranges:
        if samples is not None:
            problem = "a grid has as many rollouts as its values have combinations; leave it out"
            raise InputError(problem, where="samples")
        return chosen, 1
    keys = ", ".join(axis.key for axis in ranges)
    expect(samples is not None, "samples", f"how many points of the ranges to take ({keys})")
    total = _whole(samples, "samples", 1)
    check_total(chosen, total)
    return chosen, total


def _whole(value: object, name: str, least: int) -> int:
    try:
        return counted(number(value), name, least)
    except InputError as error:
        raise error if error.where == name else error.at(name) from None


#: The keys of a file, and the keyword of `Sweep` for each.
KEYS = {key: key for key in ("name", "title", "scenario", "vary", "samples", "sampler", "seed", "keep")} | {
    "set": "settings"
}


def is_sweep_file(name_or_path: str | Path) -> bool:
    """Whether it names a bundled sweep, or a YAML file that says what varies."""
    if str(name_or_path) in bundled_sweeps():
        return True
    path = Path(name_or_path)
    return path.suffix in SUFFIXES and path.is_file() and "vary" in read_file(path).data


def read_sweep(name_or_path: str | Path) -> dict[str, Any]:
    """Keywords of `Sweep` from a bundled sweep or a file, which is read as strictly as a scenario."""
    bundled = bundled_sweeps()
    path = bundled.get(str(name_or_path), Path(name_or_path))
    if not path.is_file() and path.suffix not in SUFFIXES:
        expect_known("sweep", str(name_or_path), bundled, error=ScenarioError)
    document = read_file(path)
    data = document.data
    for key in data:
        expect_known("key", key, KEYS, document.where((key,)), ScenarioError)
    for key in ("scenario", "vary"):
        if key not in data:
            raise ScenarioError("this key is missing", where=f"{document.where((key,))}: {key}")
    for key in ("vary", "set"):
        if not isinstance(data.get(key, {}), Mapping):
            where = document.where((key,))
            raise ScenarioError(where=where, expected="a mapping (key: value)", got=data[key])
    keywords = {keyword: data[key] for key, keyword in KEYS.items() if key in data}
    name = data["scenario"]
    if not isinstance(name, str):
        raise ScenarioError(where=document.where(("scenario",)), expected="a scenario's name", got=name)
    if name not in bundled_scenarios():
        keywords["scenario"] = document.absolute(name, ("scenario",))
    return {"name": path.name.split(".", 1)[0], **keywords}
