"""`report`: everything there is to say about a URDF or xacro file before it is used."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from nmm.errors import InputError, RobotError, expect_known
from nmm.robots.loading.advice import advice, joints_by_type
from nmm.robots.loading.check import find_problems
from nmm.robots.loading.description import Description, argument_texts, describe
from nmm.robots.loading.findings import Problem, child, children
from nmm.robots.loading.following import limit_notes
from nmm.robots.loading.ground import Ground
from nmm.robots.loading.load import load
from nmm.robots.loading.packages import Packages
from nmm.robots.loading.provenance import provenance_of
from nmm.robots.loading.second_opinion import second_opinion
from nmm.robots.loading.wheel_advice import wheel_advice
from nmm.robots.loading.xacro_file import expand
from nmm.robots.loading.xml_tree import Element, parse
from nmm.robots.meshes import read_meshes
from nmm.robots.robot import Robot
from nmm.words import counted, one_line, printable

_LINE = re.compile(r"(?:.*: )?line (\d+): ", re.DOTALL)
_NOWHERE = "/(package not found)"
_FIND = re.compile(r"\$\(find ([^)]*)\)")


@dataclass(frozen=True)
class Report:
    """What is wrong with a description, what is odd, and what it holds.

    Attributes
    ----------
    file : the file
    expanded : whether xacro wrote the text that the lines count in
    text : that text: the file's own, or the expanded one
    problems : why it cannot be loaded; none when it can
    warnings : what `load` takes, or takes with an option that the warning names
    facts : what it holds, in words, by label
    robot : it, where it could be loaded, without the shapes whose meshes are missing
    """

    file: Path
    expanded: bool = False
    text: str = ""
    problems: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    robot: Robot | None = None


def report(
    path: str | Path,
    arguments: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | Path] = (),
    **options: Any,
) -> Report:
    """Look at a .urdf or .xacro file from all sides; every problem is named, not only the first.

    Without problems the file was loaded, with what the warnings say: shapes without their meshes left out.

    Parameters
    ----------
    path : the file
    arguments : values of its `xacro:arg`s
    package_dirs : folders that are, or hold, the ROS packages that the file speaks of
    options : platform, lock, wheels, axle, srdf and missing_meshes, with which `load` is tried; meshes that
        are not there are problems with missing_meshes "error" and else warnings

    Raises
    ------
    RobotError : there is no such file, it is none, or an argument or folder is wrong
    """
    expect_known("missing_meshes", options.get("missing_meshes", "skip"), ("error", "skip"), error=RobotError)
    file = Path(path).expanduser()
    try:
        description = describe(file, arguments, package_dirs)
    except RobotError as error:
        if not file.is_file() or file.suffix.lower() not in (".urdf", ".xacro") or _is_callers(str(error)):
            raise
        return _unread(file, error, arguments, package_dirs)
    return _Report(description, arguments, package_dirs, options).made()


def _is_callers(message: str) -> bool:
    """Whether an error is about what the caller gave, not about the file."""
    ours = ("package_dirs: expected", "unknown xacro argument", "are for .xacro files", "arguments: expected")
    return any(text in message for text in ours)


def _unread(
    file: Path,
    error: RobotError,
    arguments: Mapping[str, object] | None,
    package_dirs: Sequence[str | Path],
) -> Report:
    """The report of a file that xacro or the decoder stops at: with every package that is missing."""
    cause = str(error).removeprefix(f"{file.absolute()}: ").removeprefix(f"{file}: ")
    line = _LINE.match(cause)
    problems = [Problem(printable(cause), None)]
    if line is not None and line.end() < len(cause) and cause.startswith("line "):
        problems = [Problem(printable(cause[line.end() :]), int(line[1]))]
    if "$(find " not in cause:
        return Report(file, problems=tuple(problems))
    packages = _Going(file, package_dirs)
    description = None
    # What is included from a package that is not there is not there either.
    with suppress(RobotError):
        xml, used, _ = expand(file.absolute(), argument_texts(arguments), packages)
        description = Description(xml, file, packages, True, used, ())
    problems = [
        _not_found(name, f"$(find {name})", packages)
        for name, folder in packages.found.items()
        if folder is None
    ]
    if description is None:
        return Report(file, problems=tuple(problems))
    return _Report(description, arguments, package_dirs).made(problems)


class _Going(Packages):
    """Packages of which those that are missing are named at the end, not at the first."""

    def find(self, package: str) -> Path | None:
        return super().find(package) or Path(_NOWHERE, package)


def _not_found(package: str, by: str, packages: Packages) -> Problem:
    searched = ", ".join(map(str, dict.fromkeys(packages.searched)))
    return Problem(
        f"{by}: package {package!r} not found (give its folder in package_dirs, --package-dir); looked in "
        f"{searched}"
    )


class _Report:
    """The steps of `report` for a description that could be read."""

    def __init__(
        self,
        description: Description,
        arguments: Mapping[str, object] | None,
        package_dirs: Sequence[str | Path],
        options: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.description, self.packages = description, description.packages
        self.arguments, self.package_dirs, self.options = arguments, package_dirs, options
        self.meshes: dict[str, Path | str] = {}
        self.warnings: list[Problem] = [Problem(note) for note in description.notes]
        self.facts: dict[str, str] = {}
        self.robot: Robot | None = None

    def made(self, found: Sequence[Problem] = ()) -> Report:
        """The report, with problems that were found before."""
        text = self.description.xml
        problems = find_problems(text, self._mesh, self.options.get("lock") or ())
        root = None
        if not any("XML" in p.message for p in problems[:1]):
            root = _root(text)
        if root is not None:
            problems += [*found, *_left_over(root)]
            self._count(root)
            problems += self._about_meshes(root)
            self._about_packages()
            if not problems:
                self.warnings += advice(root)
                problems += self._load(root)
        return Report(
            self.description.path,
            self.description.expanded,
            text,
            tuple(sorted(problems, key=_by_line)),
            tuple(sorted(self.warnings, key=_by_line)),
            self.facts,
            self.robot,
        )

    def _mesh(self, name: str) -> Path | str | None:
        """A mesh's file; one that is not there leaves its shape out, and is a warning."""
        self.meshes[name] = found = self.packages.mesh(name)
        return None if isinstance(found, str) else found

    def _about_meshes(self, root: Element) -> list[Problem]:
        """Meshes that are not there: problems where they are to be errors, else warnings."""
        missing: dict[str, Element] = {}
        for mesh in root.iter("mesh"):
            name = mesh.get("filename", "")
            lost = isinstance(self.meshes.get(name), str) and _NOWHERE not in name
            if lost and isinstance(mesh, Element):
                missing.setdefault(name, mesh)
        usual = ": refused unless missing_meshes='skip' (--missing-meshes skip)"
        asked = self.options.get("missing_meshes", usual)
        words = {"skip": "; its shape is left out", "error": ""}.get(asked, asked)
        found = [
            Problem(f"mesh {name!r}: {self.meshes[name]}{words}", mesh.line) for name, mesh in missing.items()
        ]
        if asked == "error":
            return found
        self.warnings += found
        return []

    def _about_packages(self) -> None:
        """Packages that are not there, and what was found."""
        for package, folder in self.packages.found.items():
            if folder is None and not isinstance(self.packages, _Going):
                self.warnings.append(_not_found(package, f"package://{package}", self.packages))
        found = sum(isinstance(file, Path) for file in self.meshes.values())
        self.facts["meshes"] = f"{found} of {len(self.meshes)} found" if self.meshes else "none"
        folders = [
            f"{name} in {folder}" for name, folder in self.packages.found.items() if folder is not None
        ]
        if folders:
            self.facts["packages"] = "; ".join(folders)

    def _count(self, root: Element) -> None:
        kinds = ", ".join(f"{count} {kind}" for kind, count in joints_by_type(root).items())
        self.facts["robot"] = root.get("name", "")
        if self.description.arguments:
            used = ", ".join(f"{name}={value}" for name, value in self.description.arguments.items())
            self.facts["xacro arguments"] = used
        self.facts["links"] = str(len(children(root, "link")))
        self.facts["joints"] = f"{len(children(root, 'joint'))}: {kinds}" if kinds else "none"

    def _load(self, root: Element) -> list[Problem]:
        """Load it, to see that it loads; what is wrong then."""
        try:
            robot = load(
                self.description.path,
                arguments=self.arguments,
                package_dirs=self.package_dirs,
                **{**self.options, "missing_meshes": "skip"},
            )
            for shapes in robot.shapes:
                read_meshes(shapes.geometryObjects, robot.name)
        except InputError as error:
            return [Problem(str(error).removeprefix(f"{self.description.path}: "))]
        except Exception as error:  # a library's, which `load` did not foresee: a report comes all the same
            return [Problem(f"cannot be loaded: {type(error).__name__}: {one_line(str(error))}")]
        self.warnings += [Problem(text) for text in wheel_advice(robot, _top(root))]
        self.warnings += [Problem(text) for text in limit_notes(robot)]
        self.warnings += [Problem(text) for text in provenance_of(robot).contradictions]
        self.warnings += [Problem(f"SRDF: {text}") for text in robot.semantics.notes]
        self.warnings += [Problem(text) for text in second_opinion(self.description.xml)]
        self._about(robot, _top(root))
        self.robot = robot
        return []

    def _about(self, robot: Robot, root: str) -> None:
        self.facts["platform"] = robot.platform.name
        self.facts["coordinates"] = f"{robot.n}: {', '.join(robot.q_names)}"
        if robot.followers:
            self.facts["followers"] = ", ".join(map(str, robot.followers))
        self.facts["wheels"] = ", ".join(wheel.joint for wheel in robot.wheels) or "none"
        ground = Ground.of(robot) if robot.platform.coordinates else None
        if ground is not None:
            self.facts["ground"] = ground.fact(root)
            self.warnings += [Problem(text) for text in ground.warnings(robot)]
        if robot.semantics.files:
            files = ", ".join(map(str, robot.semantics.files))
            self.facts["SRDF"] = f"{files}: {counted(len(robot.postures), 'posture')}"
        self.facts["mass"] = f"{sum(inertia.mass for inertia in robot.model.inertias):.4g} kg"


def _root(text: str) -> Element | None:
    try:
        root = parse(text)
    except Exception:  # which `find_problems` has named
        return None
    return root if root.tag == "robot" and not any(e.tag.startswith("xacro:") for e in root.iter()) else None


def _left_over(root: Element) -> list[Problem]:
    """$(find pkg) that nobody expands: a URDF is taken as it stands."""
    problems = []
    for element in root.iter():
        for value in element.attrib.values():
            if isinstance(element, Element) and (found := _FIND.search(value)) is not None:
                message = f"<{element.tag}>: holds xacro, $(find {found[1]}): name the file .xacro"
                problems.append(Problem(message, element.line))
    return problems


def _top(root: Element) -> str:
    """The root link's name, in a tree without problems."""
    below = {
        end.get("link") for joint in children(root, "joint") if (end := child(joint, "child")) is not None
    }
    return next(name for link in children(root, "link") if (name := link.get("name", "")) not in below)


def _by_line(problem: Problem) -> int:
    return problem.line or 0
