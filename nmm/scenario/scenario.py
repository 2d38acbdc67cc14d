"""`Scenario`: a YAML file read, changed, and run."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from pydantic import ValidationError

from nmm.base.errors import InputError, ScenarioError, no_such
from nmm.base.files import expect_name
from nmm.base.findings import Finding
from nmm.base.progress import Progress
from nmm.base.trust import is_trusted, trusting
from nmm.model.robots.surroundings import Surroundings
from nmm.scenario.document import Document, read_file
from nmm.scenario.keys import KeyedError, NamedReferences, as_written, at, first_error

if TYPE_CHECKING:
    from nmm import Plan
    from nmm.control.controller import Controller
    from nmm.control.resolvers.base import Resolver
    from nmm.model.collisions.obstacle import Obstacle
    from nmm.model.robots.robot import Robot
    from nmm.motion.recording import Recorder
    from nmm.motion.trajectory import Trajectory
    from nmm.scenario.sections import SectionMotion

SUFFIXES = (".yaml", ".yml")
#: The kind of a resolver that is no kind of ours.
OWN = "own"
#: The keys that a controller without a plan does not depend on.
KEYS_OF_A_RUN = ("q0", "duration", "method", "tolerance", "disturbances", "scene")


class Scenario:
    """A robot, a start, a task, an objective and a resolver, as a YAML file states them.

    Made by `Scenario.load`; nothing in it changes afterwards: `override` and `with_resolver` return
    another. `nmm scenarios --keys` lists the keys of the file.

    Attributes
    ----------
    name, title : of the scenario
    path : the file that it was read from
    parts : its keys, checked
    document : its text as plain data, with what was set
    trust : whether xacro files of its robots may run any Python

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position", {"resolver.alpha": 5, "duration": 10})
    >>> run = scenario.with_resolver("pg").run()
    >>> run.complete, float(run.t[-1])
    (True, 10.0)
    """

    def __init__(self, document: Document, trust: bool = False) -> None:
        self.document = document
        self.trust = trust or is_trusted()
        self.path = Path(document.name)
        own_name = re.sub(r"[^\w.-]", "_", self.path.name.split(".", 1)[0]) or "scenario"
        data = {"name": own_name, **document.data}
        from nmm.scenario.files import with_files
        from nmm.scenario.schema import schema

        with self._located():
            try:
                parts = schema(data).model_validate(data, context=NamedReferences(data))
            except ValidationError as error:
                raise first_error(error, data) from None
        self.parts = with_files(parts, document.absolute)
        #: What is worth a warning of what was set, a sentence each.
        self.warnings = tuple(document.parted())
        self.name = self.parts.name
        self.title = self.parts.title
        #: The absolute path of a file that is named at a place of it.
        self.absolute = document.absolute
        self._robot: Robot | None = None
        self._own: Resolver | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled as its text: the classes of its parts are made at run time, and no import finds them."""
        return Scenario, (self.document, self.trust), {"_own": self._own}

    @classmethod
    def load(
        cls, name_or_path: str | Path, overrides: Mapping[str, object] | None = None, *, trust: bool = False
    ) -> Scenario:
        """Read a scenario.

        Parameters
        ----------
        name_or_path : a bundled scenario's name, or a YAML file
        overrides : values by dotted key, as for `override`
        trust : whether xacro files of its robots may run any Python, as `nmm.load` says; no key of it can
            say so

        Raises
        ------
        ScenarioError : no such scenario; or the file, the line, the key and what was expected there
        """
        return cls(_with_settings(read_file(_find(name_or_path)), overrides or {}), trust)

    def override(self, key: str, value: object) -> Scenario:
        """This scenario with another value at a dotted key.

        Parameters
        ----------
        key : as "dt", "resolver.alpha", "task.0.gain", "robot.arguments.d"; lists count from 0.
            A new "resolver.kind" keeps those keys of the resolver that the kind knows
        value : text as it stands in a file ("0.001", "5/4*pi", "[[v, q1]]"), or numbers, lists, mappings

        Raises
        ------
        ScenarioError : the key leads nowhere, or the value is not what is expected there
        """
        return self.with_settings({key: value})

    def with_settings(self, settings: Mapping[str, object]) -> Scenario:
        """This scenario with other values at dotted keys, set one after the other and then checked together.

        Raises
        ------
        ScenarioError : as `override`
        """
        derived = Scenario(_with_settings(self.document, settings), self.trust)
        derived._own = self._own
        of_robot = any(key.split(".", 1)[0] == "robot" for key in settings)
        if not of_robot or derived.parts.robot == self.parts.robot:
            derived._robot = self._robot
        return derived

    def with_resolver(self, resolver: str | Resolver, source: str = "") -> Scenario:
        """This scenario with another resolver: a kind, which keeps the keys that it knows, or your own.

        Parameters
        ----------
        resolver : "rg", "pg", ..., or a `Resolver`
        source : where one of your own is from, as a run's folder records it
        """
        if isinstance(resolver, str):
            return self if resolver == self.parts.resolver.kind else self.override("resolver.kind", resolver)
        derived = self.override("resolver", {"kind": OWN, "source": source or resolver.name})
        derived._own = resolver
        return derived

    @property
    def keys_of_a_run(self) -> tuple[str, ...]:
        """The keys that its controller does not depend on."""
        needed = {key for section in self.parts.sections().values() for key in section.needs}
        return tuple(key for key in KEYS_OF_A_RUN if key not in needed)

    def robot(self) -> Robot:
        """The robot, loaded once."""
        if self._robot is None:
            with self._located(), at("robot"), trusting(self.trust):
                self._robot = self.parts.robot.build()
        return self._robot

    def controller(self, progress: Progress | None = None) -> Controller:
        """A new controller; with it, every key has been checked. `progress` is of a plan that it follows.

        Raises
        ------
        ScenarioError : what the robot does not have, or what does not fit together
        """
        robot = self.robot()
        with self._located():
            own = self._own if self.parts.resolver.kind == OWN else None
            return self.parts.build(robot, self.absolute, own, progress)

    def obstacles(self, robot: Robot) -> tuple[Obstacle, ...]:
        """What a robot keeps off in it; `ScenarioError` for a mesh that is not there."""
        part = self.parts.collisions
        if part is None:
            return ()
        with self._located(), at("collisions"):
            return tuple(part.build_obstacles(robot))

    def surroundings(self, robot: Robot) -> Surroundings:
        """What is drawn beside a robot in it; `ScenarioError` for a frame or a mesh that is not there."""
        if self.parts.scene is None:
            return Surroundings()
        with self._located(), at("scene"):
            return self.parts.scene.build(robot)

    def plan(self, progress: Progress | None = None) -> Plan:
        """The planned motion from its start, by the key `plan` or its defaults: see `nmm.plan`.

        Raises
        ------
        ScenarioError : as `controller`; a task whose target moves
        RunError : no way was found
        """
        return cast("Plan", self._motion("plan", progress))

    def _motion(self, section: str, progress: Progress | None) -> SectionMotion:
        from nmm.scenario.sections import Making

        robot = self.robot()
        with self._located():
            self.parts.check_start(robot)
            return self.parts.motion(section, Making(self.parts, robot, self.absolute, progress))

    def run(
        self,
        progress: Progress | None = None,
        controller: Controller | None = None,
        watch: Callable[[Recorder], object] | None = None,
    ) -> Trajectory:
        """Run it; a run that fails or is interrupted (Ctrl-C) returns what was computed. With the key `plan`
        it is the planned motion, or follows it (`plan.track`); `RunError` where none is found.

        Parameters
        ----------
        progress : called with the fraction done, about a hundred times
        controller : one of a scenario that differs in `keys_of_a_run` alone, to be used again; a new one when
            not given
        watch : as `simulate` takes it
        """
        from nmm.motion.simulation import simulate

        parts = self.parts
        if parts.moved_by:
            return self._with_scenario(self._motion(parts.moved_by, progress).trajectory(parts.dt))
        with self._located():
            if controller is None:
                controller = self.controller()
            else:
                parts.check_start(self.robot())
            with at(), parts.own_keys():
                trajectory = simulate(
                    controller,
                    parts.q0,
                    parts.duration,
                    parts.dt,
                    parts.method,
                    tolerance=parts.tolerance,
                    until=parts.goal(),
                    progress=progress,
                    watch=watch,
                    disturbances=None if parts.disturbances is None else parts.disturbances.make(),
                )
        return self._with_scenario(trajectory)

    def _with_scenario(self, trajectory: Trajectory) -> Trajectory:
        """A run with the scenario that it came from."""
        from nmm.scenario.sections import findings_of

        warnings = [Finding("setting_parted", {"text": text}) for text in self.warnings]
        for key, section in self.parts.sections().items():
            warnings += findings_of(key, section, trajectory)
        return trajectory.with_scenario(self.resolved(), warnings, self.surroundings(self.robot()))

    def resolved(self) -> dict[str, Any]:
        """Every key as plain data, defaults included, numbers evaluated, files with absolute paths.

        Written to a YAML file, it gives the same run to the last bit.
        """
        return self.parts.explicit()

    @contextmanager
    def _located(self) -> Iterator[None]:
        """Errors of the block that know their key name the file and the line, too."""
        try:
            yield
        except KeyedError as error:
            place = self.document.where(as_written(error.place, self.document.data))
            raise error.at(place, ScenarioError) from None


def _with_settings(document: Document, settings: Mapping[str, object]) -> Document:
    kind = settings.get("resolver.kind")
    if not isinstance(kind, str):
        return document.with_settings(settings)
    from nmm.scenario.resolvers import RESOLVER_PARTS

    if kind not in RESOLVER_PARTS:
        return document.with_settings(settings)
    keys = [*settings]
    first = keys.index("resolver.kind") + 1  # what is set after it has to be known to the new kind
    document = document.with_settings({key: settings[key] for key in keys[:first]})
    resolver, known = document.data["resolver"], RESOLVER_PARTS[kind].model_fields
    document.data["resolver"] = {name: item for name, item in resolver.items() if name in known}
    return document.with_settings({key: settings[key] for key in keys[first:]})


def _find(name_or_path: str | Path) -> Path:
    """The file of a bundled name or a path."""
    from nmm.base.bundled import bundled_scenarios

    path = Path(name_or_path).expanduser()
    bundled = bundled_scenarios()
    if isinstance(name_or_path, str) and name_or_path in bundled:
        return bundled[name_or_path]
    try:
        expect_name(path)
    except InputError as error:
        raise ScenarioError(str(error)) from None
    if path.is_file() or path.suffix in SUFFIXES or len(path.parts) > 1:
        return path
    raise no_such("scenario", str(name_or_path), bundled, error=ScenarioError)
