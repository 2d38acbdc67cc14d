"""plan: a motion to a goal, searched and written as a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError
from nmm.base.text_format import counted
from nmm.cli.groups import Browser, OfRobot, command
from nmm.cli.options import ROBOT_HELP, SetOption, flag, names_of, option, out_option, settings_of
from nmm.cli.output import OK, progress, show_table
from nmm.cli.runs import tell_and_save

if TYPE_CHECKING:
    from nmm.scenario import Scenario

#: How a configuration is written.
_FORM = "COORDINATE=VALUE,..."


@command
def plan(
    subject: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|SCENARIO",
            help=f"{ROBOT_HELP} Or a scenario, with its start, limits and obstacles.",
            show_default=False,
        ),
    ],
    *,
    to: str | None = option(
        _FORM,
        "The goal, m or rad: x=6,y=0,theta=pi/2; posture=NAME is one of the SRDF's. Others are free.",
        show="a scenario's own",
    ),
    through: list[str] | None = option(_FORM, "A goal on the way, in the same form. May be repeated."),
    hold: str | None = option(
        "FRAME", "Its pose stays as at the start; the goal is then the platform's x, y and theta."
    ),
    start: str | None = option(_FORM, "Where it begins.", show="a scenario's start; 0 and the rest"),
    obstacles: Path | None = option(
        "FILE", "A YAML file whose key obstacles has a list as in a scenario, or a scenario.", show="none"
    ),
    seconds: float | None = option("S", "After which the search gives up.", show="10"),
    seed: int | None = option("N", "Of the random numbers; a seed gives one plan.", show="1"),
    settings: SetOption = None,
    of_robot: OfRobot,
    out: Annotated[Path | None, out_option("runs/<name>-plan")] = None,
    html: bool = flag("--html", "Write playback.html too: the motion in 3D, one file, works offline."),
    play: bool = flag("--play", "Then play the motion in the browser; Ctrl-C ends it."),
    browser: Browser,
    as_json: bool = flag("--json", "What was found as JSON on standard output, for scripts."),
) -> int:
    """Plan a motion that keeps distances and limits.

    From a start to a goal, round what is in the way; for platforms and goals see docs/plans.md.

    \b
    nmm plan unicycle_3r --to x=2,y=1,theta=0
    nmm plan unicycle_3r --to x=6,y=0,theta=0 --obstacles behind_the_wall --play
    nmm plan car_base --to y=1,x=0,theta=0 --set limits.velocity.v=0.5 --set limits.acceleration=1
    nmm plan behind_the_wall --seed 3 --json

    The folder is that of a run; its scenario.yaml plans it again. Exit status 1, with what was tried, where
    none is found.
    """
    from nmm.cli.subjects import scenario_with
    from nmm.views.folders.run import is_run
    from nmm.views.folders.whole import check_folder

    if not play:
        browser.refuse("--play")
    made = _scenario(subject, to, obstacles)
    changed: dict[str, Any] = {}
    own = made.parts.section("plan")
    if own is None or not own.moves:
        changed = {"plan": {}} if own is None else {"plan.track": False}
    if start is not None:
        changed["q0"] = _coordinates(start, "--start")
    if to is not None:
        changed["plan.to"] = _coordinates(to, "--to")
    if through:
        changed["plan.through"] = [_coordinates(text, "--through") for text in through]
    changed |= {
        f"plan.{key}": value
        for key, value in (("seconds", seconds), ("seed", seed), ("hold", hold))
        if value is not None
    }
    made = made.with_settings({**changed, **settings_of(settings)})
    made = scenario_with(made, of_robot.keywords())
    folder = out or Path("runs") / f"{made.name}-plan"
    check_folder(folder, is_run)
    with progress(f"{made.name}, plan") as report:
        plan = made.plan(report)
        trajectory = plan.trajectory(made.parts.dt).with_scenario(
            made.resolved(), (), made.surroundings(made.robot())
        )
    if as_json:
        trajectory.save(folder, html=html)
        summary = {
            "robot": plan.robot.name,
            "duration": plan.duration,
            "end": dict(zip(plan.robot.q_names, plan.end.tolist(), strict=True)),
            "stops": plan.stops.tolist(),
            "corners": plan.corners.tolist(),
            "motions": plan.motions,
            "postures": plan.postures,
            "folder": str(folder),
        }
        print(json.dumps(summary, indent=1), flush=True)
    else:
        tell_and_save(trajectory, folder, html=html)
        looked = counted(plan.motions, "motion"), counted(plan.postures, "configuration")
        show_table(["", ""], [["looked at", " and ".join(looked)]])
    if play:
        trajectory.play(**browser.keywords())
    return OK


def _scenario(subject: str, to: str | None, obstacles: Path | None) -> Scenario:
    """The scenario that is planned: SUBJECT, or one made for a robot, with the obstacles of a file."""
    from nmm.base.bundled import bundled_robots, bundled_scenarios
    from nmm.cli.subjects import is_scenario
    from nmm.scenario import Scenario
    from nmm.scenario.document import Document, read_file

    if is_scenario(subject):
        if obstacles is not None:
            raise InputError(f"{subject} has its own: --set collisions.obstacles=…", where="--obstacles")
        return Scenario.load(subject)
    if to is None:
        raise InputError(where="--to", expected=f"a goal of the robot, {_FORM}")
    source = subject
    if source not in bundled_robots() and not source.startswith("package://"):
        source = str(Path(source).expanduser().absolute())
    document, collisions = Document(subject, {}), None
    if obstacles is not None:
        document = read_file(bundled_scenarios().get(str(obstacles), obstacles))
        own = document.data.get("collisions")
        collisions = own if own is not None else {"obstacles": document.data.get("obstacles")}
        below = () if own is not None else ("collisions",)
        document.lines = {
            (*below, *place): line
            for place, line in document.lines.items()
            if place[0] in ("collisions", "obstacles")
        }
    # A run of a plan has no use for a task and a resolver: it needs what the goal is, and that is `to`.
    document.data = {
        "name": Path(subject).name.split(".")[0],
        "robot": {"source": source},
        "q0": {},
        "duration": "1",
        "dt": "0.02",
        "task": {
            "kind": "coordinates",
            "of": [names_of(to, "--to")[0].partition("=")[0]],
            "reference": ["0"],
        },
        "resolver": {"kind": "pg"},
        "collisions": collisions or False,
    }
    return Scenario(document)


def _coordinates(assignments: str, where: str) -> dict[str, str]:
    """Numbers, as text, by coordinate, and a posture's name."""
    coordinates: dict[str, str] = {}
    for text in names_of(assignments, where, f"{_FORM}, as in x=6,y=0"):
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value) or name in coordinates:
            raise InputError(where=where, expected=f"{_FORM}, each once, as in x=6,y=0", got=text)
        coordinates[name] = value
    return coordinates
