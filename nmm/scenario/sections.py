"""Sections of a scenario that plugins add: a key of the file, with what it does to a run."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.base.plugins import Addition, additions, complain
from nmm.base.progress import Progress
from nmm.control.functions.tasks.task import Task
from nmm.model.robots.robot import Robot
from nmm.scenario.keys import KeyedError, KeyedPart

if TYPE_CHECKING:
    from nmm.motion.trajectory import Trajectory


class SectionMotion(Protocol):
    """A motion that a section makes in place of the closed loop's."""

    def trajectory(self, dt: float) -> Trajectory: ...


@dataclass(frozen=True)
class Making:
    """What a section is made with: the keys of its scenario, the robot, files and progress."""

    parts: Any  #: `Scenario.parts`
    robot: Robot
    absolute: Callable[[str, tuple[str | int, ...]], Path]  #: the path of a file named at a place
    progress: Progress | None = None


class Section(KeyedPart):
    """A mapping of a scenario's file that a plugin adds; `true` is it with its defaults, `false` none.

    A subclass states its keys as fields of pydantic, and what it does in the methods that it overrides. An
    `InputError` of a method is about the section; one about a key is raised within `at("section", "key")`.
    """

    #: The key's description in the list of the file's keys.
    summary: ClassVar[str] = ""
    #: The key behind which it is listed; the last where none is named.
    after: ClassVar[str] = ""
    #: Parts of it that are listed by themselves, by their dotted place.
    listed: ClassVar[Mapping[str, type[KeyedPart]]] = {}
    #: Keys of a run that a controller depends on with this section, and on which it does not without: "q0".
    needs: ClassVar[tuple[str, ...]] = ()
    #: Whether `until` is for the section, so that a run does not end at the task's target.
    takes_until: ClassVar[bool] = False
    #: Whether `tasks` searches for seconds, and tells its progress.
    searches: ClassVar[bool] = False

    @property
    def moves(self) -> bool:
        """Whether a run is the motion of this section, in place of the closed loop's."""
        return False

    def check(self, making: Making) -> None:
        """`InputError` for what does not fit the robot or the scenario."""

    def tasks(self, making: Making, tasks: list[Task]) -> list[Task]:
        """The controller's tasks, from those of the file: the same, more of them, or others."""
        return tasks

    def motion(self, making: Making) -> SectionMotion:
        """The motion that a run is where the section `moves`; `RunError` where there is none."""
        raise NotImplementedError

    def findings(self, run: Trajectory) -> Sequence[Finding]:
        """What the section warns of after a run."""
        return ()


@contextmanager
def about(name: str) -> Iterator[None]:
    """An error of the block that knows no key is about this section."""
    try:
        yield
    except KeyedError:
        raise
    except InputError as error:
        raise KeyedError.of((name,), error) from None


def findings_of(key: str, section: Section, run: Trajectory) -> list[Finding]:
    """What a section warns of after a run; none, and a line of the log, where its method fails."""
    try:
        findings = list(section.findings(run))
        json.dumps([finding.as_json() for finding in findings])  # as a folder will; codes have words
    except Exception as error:  # the run is there, whatever a stranger's method does with it
        complain(key, f"findings: {type(error).__name__}: {error}; they are left out")
        return []
    return findings


def section_names(core: Collection[str], foreign: bool = True) -> dict[str, Addition]:
    """The sections that plugins add to the core's keys, by key."""
    return additions("sections", core, foreign)


@cache
def section_class(addition: Addition) -> type[Section] | None:
    """The class of a section; None, and a line of the log, for what is none."""
    section = addition.load()
    if section is None or (isinstance(section, type) and issubclass(section, Section)):
        return section
    complain(addition.plugin, f"{addition.entry} is no nmm.extending.Section; it is left out")
    return None
