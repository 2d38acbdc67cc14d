"""`file_report`: everything there is to say about a URDF or xacro file before it is used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nmm.base.errors import InputError, RobotError, expect_known, few
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import line_of
from nmm.base.text_format import counted, one_line
from nmm.base.trust import is_trusted, trusting
from nmm.model.robots.loading.check import inspect
from nmm.model.robots.loading.check_parts import advice
from nmm.model.robots.loading.description import Description, argument_texts, describe, expand
from nmm.model.robots.loading.ground import GroundContacts, wheel_advice
from nmm.model.robots.loading.load import load
from nmm.model.robots.loading.locking import limit_notes
from nmm.model.robots.loading.packages import Packages
from nmm.model.robots.loading.provenance import acceleration_notes, provenance_of
from nmm.model.robots.loading.xml_tree import Element, children, link_at
from nmm.model.robots.meshes import read_meshes
from nmm.model.robots.robot import Robot

_NOWHERE = "/(package not found)"
#: What a xacro file was let do, by whether it was trusted.
_TRUST = {
    False: "computes only, and reads the robot's own files (a file that needs more is refused: --trust)",
    True: "trusted: it may run programs, and read any file and the environment",
}


@dataclass(frozen=True)
class FileReport:
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
    problems: tuple[Finding, ...] = ()
    warnings: tuple[Finding, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    robot: Robot | None = None


def file_report(
    path: str | Path,
    arguments: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | Path] = (),
    trust: bool = False,
    **options: Any,
) -> FileReport:
    """Look at a .urdf, .xacro or .xml file from all sides; every problem is named, not only the first.

    Without problems the file was loaded, with what the warnings say: shapes without their meshes left out.
    arguments, package_dirs, trust and options (platform, lock, wheels, axle, srdf, missing_meshes) are those
    of `load`; meshes that are not there are problems with missing_meshes "error" and else warnings.

    Raises
    ------
    RobotError : there is no such file, it is none, or an argument or folder is wrong
    """
    expect_known("missing_meshes", options.get("missing_meshes", "skip"), ("error", "skip"), error=RobotError)
    file = Path(path).expanduser()
    settings: Mapping[str, Any] = {"arguments": arguments, "package_dirs": package_dirs}
    with trusting(trust):
        try:
            description = describe(file, **settings)
        except RobotError as error:
            if not error.findings:  # what the caller gave is wrong, not what is in the file
                raise
            return _unread(file, error.findings, settings)
        return _report(description, {**settings, **options})


def _unread(file: Path, findings: tuple[Finding, ...], settings: Mapping[str, Any]) -> FileReport:
    """The report of a file that xacro or the decoder stops at, with every missing package."""
    if all(finding.code != "package_missing" for finding in findings):
        return FileReport(file, problems=findings)
    packages = _Going(file, settings["package_dirs"])
    description = None
    # What is included from a package that is not there is not there either.
    with suppress(RobotError):
        xml, used, _ = expand(file.absolute(), argument_texts(settings["arguments"]), packages)
        description = Description(xml, file, packages, expanded=True, arguments=used)
    lost = [name for name, folder in packages.found.items() if folder is None]
    problems = [packages.missing(name, f"$(find {name})") for name in lost]
    if description is None:
        return FileReport(file, problems=tuple(problems))
    return _report(description, settings, problems)


class _Going(Packages):
    """Packages that collects missing ones instead of stopping at the first."""

    def find(self, package: str, asking: Path | None = None) -> Path | None:
        return super().find(package, asking) or Path(_NOWHERE, package)


def _report(
    description: Description, settings: Mapping[str, Any], findings: Sequence[Finding] = ()
) -> FileReport:
    """The report of a description that could be read; `settings` are for `load`, `findings` its problems."""
    packages, asked = description.packages, settings.get("missing_meshes")
    meshes: dict[str, Path | Finding] = {}

    def find_mesh(name: str) -> Path | None:
        mesh = meshes[name] = packages.mesh(name)
        return mesh if isinstance(mesh, Path) else None

    checked, problems = inspect(description.urdf, find_mesh, settings.get("lock") or ())
    warnings, facts = [*description.notes], dict[str, str]()
    robot = None
    if checked is not None:
        root = checked.root
        missing = {name: mesh for name, mesh in meshes.items() if isinstance(mesh, Finding)}
        problems += findings
        warnings += [*checked.spared, *packages.notes, *description.placed(checked.unread)]
        (problems if asked == "error" else warnings).extend(_missing_meshes(root, missing, asked))
        if not isinstance(packages, _Going):
            lost = [package for package, folder in packages.found.items() if folder is None]
            warnings += [packages.missing(package, f"package://{package}") for package in lost]
        facts = _facts_of_file(description, root)
        facts["meshes"] = f"{len(meshes) - len(missing)} of {len(meshes)} found" if meshes else "none"
        folders = [f"{name} in {folder}" for name, folder in packages.found.items() if folder is not None]
        if folders:
            facts["packages"] = "; ".join(folders)
    if checked is not None and not problems:
        warnings += advice(root)
        robot, problems = _loaded(description.path, settings)
    if robot is not None:
        top, ground = _top(root), GroundContacts.of(robot) if robot.platform.coordinates else None
        warnings += [note for note in robot.notes if note.code == "names_taken"]
        warnings += [*wheel_advice(robot), *limit_notes(robot), *acceleration_notes(robot)]
        warnings += [*provenance_of(robot).contradictions, *robot.semantics.notes]
        warnings += [] if ground is None else ground.warnings(robot)
        facts |= _facts_of_robot(robot, None if ground is None else ground.fact(top))
    return FileReport(
        description.path,
        description.expanded,
        description.xml,
        tuple(sorted(problems, key=_by_line)),
        tuple(sorted(warnings, key=_by_line)),
        facts,
        robot,
    )


def _missing_meshes(root: Element, missing: Mapping[str, Finding], asked: str | None) -> list[Finding]:
    """The missing meshes, each at its first line, and what becomes of their shapes."""
    becomes = {"shape": {"skip": "left_out", "error": "", None: "refused"}[asked]}
    findings: dict[str, Finding] = {}
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        lost = missing.get(name)
        if lost is not None and _NOWHERE not in name and isinstance(mesh, Element):
            values = {**lost.values, **becomes}
            findings.setdefault(name, replace(lost, values=values, where=mesh.place))
    return [*findings.values()]


def _facts_of_file(description: Description, root: Element) -> dict[str, str]:
    types = sorted(joint.get("type", "") for joint in children(root, "joint"))
    kinds = ", ".join(f"{types.count(kind)} {kind}" for kind in dict.fromkeys(types))
    facts = {"robot": root.get("name", "")}
    if description.arguments:
        used = ", ".join(f"{name}={value}" for name, value in description.arguments.items())
        facts["xacro arguments"] = used
    if description.expanded:
        facts["xacro"] = _TRUST[is_trusted()]
    facts["links"] = str(len(children(root, "link")))
    facts["joints"] = f"{len(types)}: {kinds}" if kinds else "none"
    return facts


def _loaded(path: Path, settings: Mapping[str, Any]) -> tuple[Robot | None, list[Finding]]:
    """The robot with all its meshes, or what is wrong when it is loaded."""
    try:
        robot = load(path, **{**settings, "missing_meshes": "skip"})
        for shapes in robot.shapes:
            read_meshes(shapes.geometryObjects, robot.name)
    except InputError as error:
        inner = error.where.removeprefix(str(path)).removeprefix(": ")
        if isinstance(error.finding, Finding):
            return None, [error.finding]
        return None, [*getattr(error, "findings", ())] or [_refused(error.placed(inner))]
    except Exception as error:  # a library's, which `load` did not foresee: a report comes all the same
        values = {"error": type(error).__name__, "reason": one_line(str(error))}
        return None, [Finding("library_failed", values)]
    return robot, []


def _facts_of_robot(robot: Robot, ground: str | None) -> dict[str, str]:
    facts = {"platform": robot.platform.name, "coordinates": f"{robot.n}: {few(robot.q_names)}"}
    if robot.mimic_joints:
        facts["followers"] = few([*map(str, robot.mimic_joints)])
    facts["wheels"] = few([wheel.joint for wheel in robot.wheels])
    if ground is not None:
        facts["ground"] = ground
    if robot.semantics.files:
        files = ", ".join(map(str, robot.semantics.files))
        facts["SRDF"] = f"{files}: {counted(len(robot.postures), 'posture')}"
    facts["mass"] = f"{sum(inertia.mass for inertia in robot.model.inertias):.4g} kg"
    return facts


def _refused(error: InputError) -> Finding:
    fields = {"what": error.what, "where": error.where, "expected": error.expected}
    names = {} if error.available is None else {"available": [*error.available]}
    return Finding("refused", {"text": str(error), **fields, **names})


def _top(root: Element) -> str:
    below = {link_at(joint, "child") for joint in children(root, "joint")}
    return next(name for link in children(root, "link") if (name := link.get("name", "")) not in below)


def _by_line(finding: Finding) -> int:
    return line_of(finding) or 0
