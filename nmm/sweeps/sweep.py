"""`Sweep`: many rollouts of a scenario, over ranges and lists of its keys."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

from nmm import __version__
from nmm.bundled import bundled_scenarios
from nmm.cores import cores
from nmm.errors import InputError, expect_known
from nmm.processes import as_done
from nmm.progress import Progress
from nmm.scenario import Scenario
from nmm.scenario.numbers import integer
from nmm.scenario.yaml_text import dotted
from nmm.sweeps.check import check_varied
from nmm.sweeps.cluster import as_done_by, cluster
from nmm.sweeps.definition import KEPT, Definition
from nmm.sweeps.estimate import check_size
from nmm.sweeps.folder import SweepFolder, is_sweep
from nmm.sweeps.rows import wholly_compiled
from nmm.sweeps.sampling import GRID, SAMPLERS, check_total
from nmm.sweeps.swept import Swept
from nmm.sweeps.varied import Range, Varied, varied
from nmm.sweeps.work import computed
from nmm.words import listed

#: So many rows a core are computed by threads; more are worth processes of their own.
FEW_ROWS = 128
#: So many threads a process has at most, however many cores there are.
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
        varying = tuple(varied(key, given) for key, given in vary.items())
        if not varying:
            raise InputError("vary: expected at least one key to vary, such as q0.x=-1:1")
        sampler, points = _sampling(varying, sampler, samples)
        if keep is not None:
            expect_known("what to keep", keep, KEPT, "keep")
        check_varied(self.scenario, varying)
        robot, document = self.scenario.robot(), self.scenario.document
        bundled = {path: name for name, path in bundled_scenarios().items()}
        self.definition = Definition(
            name=name or self.scenario.name,
            title=title or self.scenario.title or name or self.scenario.name,
            scenario=bundled.get(self.scenario.path) or str(self.scenario.path.resolve()),
            settings={dotted(place): _value(document.data, place) for place in document.settings},
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
    def load(cls, name_or_path: str | Path, **changes: Any) -> Sweep:
        """A sweep that is bundled (`unicycle_2r_starts`) or a YAML file, with other keywords than it says.

        Raises
        ------
        InputError : no such sweep, or what is wrong with it
        """
        from nmm.sweeps.files import read_sweep

        return cls(**(read_sweep(name_or_path) | changes))

    def run(
        self,
        folder: str | Path,
        *,
        jobs: int | None = None,
        scheduler: str | None = None,
        progress: Progress | None = None,
    ) -> Swept:
        """Compute the rows that are not in the folder yet, and write table and page.

        However it ends, what is done stays; the same sweep in the same folder goes on there, nothing lost or
        doubled, and ends with the same table.

        Parameters
        ----------
        folder : a new or an empty one, or one where this sweep was begun
        jobs : rows that are computed at the same time on this machine; as many as it has cores, when not
            given. They are threads where rows are few and share a robot, and processes otherwise, for which a
            script needs `if __name__ == "__main__":`
        scheduler : the address of a Dask scheduler (tcp://host:port) whose workers compute instead
        progress : called with the fraction done, of the rows that were done before, too

        Raises
        ------
        InputError : the folder is another's, scheduler or workers will not do, the sweep is too large,
            or pyarrow (of `nmm[sweep]`) is missing
        RunError : a process or the cluster was lost
        """
        definition, place = self.definition, SweepFolder(folder, self.definition)
        if jobs is not None and scheduler is not None:
            raise InputError("jobs: a cluster has as many as it has workers: expected jobs or scheduler")
        local = _whole(cores() if jobs is None else jobs, "jobs", 1)
        place.check()
        with ExitStack() as stack:
            client = None if scheduler is None else stack.enter_context(cluster(scheduler))
            if not is_sweep(place.path):
                check_size(
                    definition, local if client is None else sum(client.nthreads().values()), place.path
                )
            stack.enter_context(place.opened())
            missing = place.missing()
            done = _Done(definition, missing, progress)
            threads = self._threads(local, sum(map(len, map(definition.indices, missing))))
            job = partial(computed, definition=definition)
            if missing:
                found = (
                    as_done(partial(job, threads=threads), missing, -(-local // threads), done.report)
                    if client is None
                    else as_done_by(client, job, missing)
                )
                for chunk, rows in stack.enter_context(closing(found)):
                    place.add(chunk, rows)
                    done.report(chunk, 1.0)
            place.finish()
            swept = Swept(place.path, definition)
            from nmm.sweeps.page import write_page

            write_page(swept)
        return swept

    def _threads(self, jobs: int, rows: int) -> int:
        """How many rows a process computes at the same time, of `jobs` in all, where so many rows are left.

        Several where a process of their own would hardly have begun before they are done, robots stay the
        same, and steps are compiled as a whole, which holds no GIL; what Python does in between bounds how
        many.
        """
        controller, varying = self.scenario.controller(), self.definition.vary
        shared = not any(one.key.split(".")[0] == "robot" for one in varying)
        if rows > FEW_ROWS * jobs or not shared or self.definition.keep or not wholly_compiled(controller):
            return 1
        return -(-jobs // -(-jobs // MOST_THREADS))


class _Done:
    """How much is done, as chunks tell of themselves."""

    def __init__(self, definition: Definition, missing: list[int], progress: Progress | None) -> None:
        self._sizes = {chunk: len(definition.indices(chunk)) for chunk in missing}
        self._under_way = dict.fromkeys(missing, 0.0)
        self._rows, self._progress = definition.rows, progress
        self._done = definition.rows - sum(self._sizes.values()) + 0.0
        if progress is not None:
            progress(self._done / self._rows)

    def report(self, chunk: int, fraction: float) -> None:
        """A chunk is done to that fraction."""
        self._done += self._sizes[chunk] * (fraction - self._under_way[chunk])
        self._under_way[chunk] = fraction
        if self._progress is not None:
            self._progress(self._done / self._rows)


def _sampling(vary: tuple[Varied, ...], sampler: str | None, samples: object) -> tuple[str, int]:
    """The sampler's name, and how many points it is asked for."""
    ranges = [one for one in vary if isinstance(one, Range)]
    chosen = sampler or ("sobol" if ranges else GRID)
    expect_known("sampler", chosen, [GRID, *SAMPLERS], "sampler")
    if chosen == GRID and ranges:
        one = ranges[0]
        raise InputError(
            f"vary {one.key}: a grid needs a count: expected {one.lower:g}:{one.upper:g}:COUNT, or another "
            f"sampler ({listed(list(SAMPLERS), 'or')})"
        )
    if not ranges:
        if chosen != GRID:
            raise InputError(
                f"sampler: {chosen} has nothing to sample, as every key has its values; expected a range "
                "LOWER:UPPER"
            )
        if samples is not None:
            raise InputError(
                "samples: a grid has as many rollouts as its values have combinations; leave it out"
            )
        return chosen, 1
    if samples is None:
        keys = ", ".join(one.key for one in ranges)
        raise InputError(f"samples: expected how many points of the ranges to take ({keys})")
    total = _whole(samples, "samples", 1)
    check_total(chosen, total)
    return chosen, total


def _whole(value: object, name: str, least: int) -> int:
    try:
        found = integer(value)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if found < least:
        raise InputError(f"{name}: expected at least {least}, got {found}")
    return found


def _value(data: Any, place: tuple[str | int, ...]) -> Any:
    for step in place:
        data = data[step]
    return data
