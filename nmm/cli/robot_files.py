"""check and init: what is wrong with a robot's file, and a first scenario for it."""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from nmm.base.bundled import bundled_robots
from nmm.base.errors import InputError, expect
from nmm.base.files import PATIENCE, writing, written_at
from nmm.base.text_format import counted, folded
from nmm.cli.groups import Loading, command
from nmm.cli.options import ARGUMENT, ARM, ROBOT_HELP, arguments_of, flag, option
from nmm.cli.output import BAD_INPUT, OK, complain, readable, show_table, show_text

if TYPE_CHECKING:
    from nmm.base.findings import Finding
    from nmm.model.robots.loading.report import FileReport
    from nmm.model.robots.robot import Robot

#: So many findings with one code, and pairs of links that touch, are shown.
MOST_ALIKE = 10


@command
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help=ROBOT_HELP)],
    arguments: list[str] | None = ARGUMENT,
    *,
    loading: Loading,
    as_json: bool = flag("--json", "What was found as JSON on standard output, for scripts."),
) -> int:
    """Say everything that is wrong with a robot's file.

    Each problem on a line of its own, with the line of the file; then warnings: what nmm takes, but hardly
    was meant, and what it takes only with an option. A file without problems is loaded, to prove it.

    \b
    nmm check my_robot.urdf
    nmm check my_robot.urdf.xacro -a arm=true --package-dir ~/ros/src
    nmm check my_robot.urdf --lock '*finger*=0' --wheels left_drive=0.1,right_drive=0.1
    nmm check my_robot.urdf --json

    The lines of a xacro file's problems are those of the text that xacro makes of it. Of what is alike ten
    are shown. Exit status 2 when there are problems.
    """
    from nmm.model.robots.loading.packages import package_file
    from nmm.model.robots.loading.report import file_report

    settings, keywords = arguments_of(arguments), loading.keywords()
    folders = keywords.pop("package_dirs")
    path = bundled_robots().get(file, Path(file))
    shown = os.path.relpath(path) if file in bundled_robots() else file
    if file.startswith("package://"):
        path = package_file(file, folders)
    made = file_report(path, settings, folders, **keywords)
    facts, touch = dict(made.facts), dict[tuple[str, str], float]()
    if made.robot is not None:
        facts["collisions"], touch = _touching(made.robot)
    if as_json:
        pairs = [{"links": [*pair], "share": share} for pair, share in touch.items()]
        data = {
            "file": file,
            "expanded": made.expanded,
            "problems": [finding.as_json() for finding in made.problems],
            "warnings": [finding.as_json() for finding in made.warnings],
            "facts": {**facts, "touching": pairs},
        }
        print(json.dumps(data, indent=1))
        return BAD_INPUT if made.problems else OK
    counts = []
    for kind, findings in (("problem", made.problems), ("warning", made.warnings)):
        for line in _lines(shown, findings, made, "warning: " if kind == "warning" else ""):
            print(*folded(line), sep="\n")
        counts.append(counted(len(findings), kind) if findings else f"no {kind}s")
    title = f"{file}: {', '.join(counts)}"
    if made.problems:
        sys.stdout.flush()
        complain("nmm check", title)
        return BAD_INPUT
    if made.warnings:
        show_text()
    show_table(["", ""], facts.items(), title=title)
    if touch:
        rows = [[f"{one} and {other}", f"{share:.1%}"] for (one, other), share in touch.items()]
        if len(rows) > MOST_ALIKE:
            most = rows[MOST_ALIKE][1]
            rows[MOST_ALIKE:] = [
                [f"… {len(rows) - MOST_ALIKE} more (all of them: --json)", f"{most} at most"]
            ]
        show_table(["links that touch", "in"], rows)
    return OK


def _touching(robot: Robot) -> tuple[str, dict[tuple[str, str], float]]:
    """How many of the robot's links can touch each other, and which, with how often they do."""
    from nmm.model.collisions.pairs import touching_links

    links = touching_links(robot)
    if not links.shapes:
        return "no shapes: nothing keeps it from touching anything", {}
    if not links.shares:
        return "no two of its links can touch: the model has no pairs", {}
    counts = f"{len(links.never)} never, {len(links.sometimes)} sometimes, {len(links.always)} always"
    summary = (
        f"{len(links.shares)} pairs of links: {counts} touch, in {links.configurations} random configurations"
    )
    return summary, {pair: share for pair, share in links.shares.items() if share > 0.0}


def _lines(file: str, findings: Sequence[Finding], made: FileReport, kind: str) -> Iterator[str]:
    """Of findings with one code at most `MOST_ALIKE`, and how many more there are."""
    counts = Counter[str]()
    for finding in findings:
        counts[finding.code] += 1
        if counts[finding.code] <= MOST_ALIKE:
            yield _line(file, finding, made, kind)
    for code, count in counts.items():
        if count > MOST_ALIKE:
            yield f"{file}: {kind}… {count - MOST_ALIKE} more like these ({code}; all of them: --json)"


def _line(file: str, finding: Finding, made: FileReport, kind: str) -> str:
    """file:line: message, as compilers do; the line of an expanded file comes last."""
    from nmm.base.findings.robot_file import line_of

    message, line = readable(str(finding)), line_of(finding)
    if line is None:
        return f"{file}: {kind}{message}"
    if made.expanded:
        return f"{file}: {kind}{message} (line {line} of the expanded file)"
    return f"{file}:{line}: {kind}{message}"


@command
def init(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help=ROBOT_HELP)],
    *,
    arm: str | None = ARM,
    at: str | None = option(
        "FRAME", "The robot's frame that carries the arm.", show="mount, arm_mount or top"
    ),
    out: Path | None = option("FILE", "Where to write; never over a file.", show="<robot>.yaml"),
    obstacle: list[Path] | None = option(
        "FILE",
        "What was sensed, to keep away from: a cloud (.ply, .pcd, .npz), a map (.yaml) or OctoMap's cells "
        "(.bt). May be repeated.",
        show=False,
    ),
    settings: list[str] | None = ARGUMENT,
    loading: Loading,
) -> None:
    """Write a first scenario for a robot.

    A YAML file with a word on every key: the end of the longest arm is led along a gentle path, from a start
    within limits and away from singularities (a posture of the robot's SRDF, if one will do), with a
    resolver that fits. It has been run before it is written, and runs as it stands. What has no wheels is put
    on a bundled base. With --arm, --lock and --srdf are the arm's.

    \b
    nmm init my_robot.urdf && nmm run my_robot.yaml --play
    nmm init my_arm.urdf --out scenarios/first.yaml
    nmm init car_base --arm my_arm.urdf --at arm_mount
    nmm init my_arm.urdf --platform fixed
    nmm init my_robot.urdf --obstacle scan.pcd --obstacle map.yaml
    """
    from nmm.model.robots.loading.source import source_path
    from nmm.scenario.scaffold import first_scenario
    from nmm.scenario.scaffold.draft import usual_file

    keywords = loading.keywords()
    for source in (robot, arm):
        if source is not None:
            source_path(source, keywords["package_dirs"])  # a wrong name is reported before anything else
    file = usual_file(robot if arm is None else arm) if out is None else out
    _expect_free(file)
    keywords |= {"obstacles": obstacle or [], "arguments": arguments_of(settings)}
    draft = first_scenario(robot, arm=arm, at=at, file=file, **keywords)
    with written_at(f"--out: {file}"):
        _write_new(file, draft.text)
    for line in draft.chosen:
        show_text(line)
    show_text(f"wrote {file}; next: nmm run {file} --play")


def _expect_free(file: Path) -> None:
    """`InputError` for a file that is there, or cannot be: before anything is computed."""
    expect(file.suffix in (".yaml", ".yml"), "--out", "a file that ends in .yaml or .yml", str(file))
    if os.path.lexists(file):
        raise InputError("exists, and is left as it is", where=file, expected="another --out")
    if not os.access(file.parent, os.W_OK | os.X_OK) or not file.parent.is_dir():
        raise InputError(f"{file.parent} is no folder where you may write", where="--out", got=str(file))


def _write_new(file: Path, text: str) -> None:
    """A file with all of the text; one that has come meanwhile stays."""
    try:
        with writing(file, PATIENCE) as hidden, TemporaryDirectory(dir=hidden) as folder:
            part = Path(folder) / file.name
            part.write_text(text, encoding="utf-8")
            os.link(part, file)  # unlike a rename, never in another's place
    except FileExistsError:
        raise InputError("exists, and is left as it is", where=file, expected="another --out") from None
