"""map: measures over two coordinates or a plane of the workspace, in figures and a table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from nmm.base.errors import InputError, expect
from nmm.cli.groups import Figures, Loading, Subject, command
from nmm.cli.options import LENGTH, names_of, option, out_option, values_of
from nmm.cli.output import progress, show_table

if TYPE_CHECKING:
    from nmm.analysis.maps.result import Map
    from nmm.analysis.maps.singular_set import SingularSet


@command
def map_measures(
    subject: Subject,
    *,
    over: str | None = option(
        "NAME,NAME",
        "The two coordinates of the map's axes.",
        show="the arm's first two, or the first two",
    ),
    ranges: list[str] | None = option(
        "NAME=LOWER:UPPER",
        "Range of a coordinate, m or rad; in a workspace of an arm's joint. Arithmetic with pi will "
        "do. May be repeated.",
        "--range",
        show="its limits, of an angle at most one turn",
    ),
    workspace: str | None = option(
        "xy|xz|yz",
        "Map a plane of the workspace instead: best and worst over the arm's postures that put the "
        "frame there, the platform standing at --at.",
    ),
    frame: str | None = option("FRAME", "With --workspace: the frame mapped.", show="that of the task"),
    height: str | None = option(
        "LOWER:UPPER",
        "With --workspace: only postures with the frame's third coordinate in here, m.",
        show="all, projected onto the plane",
    ),
    measure: str = option(
        "NAME,...",
        "Some of sigma_min, inverse_condition, manipulability, arm_manipulability, "
        "platform_manipulability, weighted, eccentricity.",
        default="sigma_min",
    ),
    part: str = option("NAME", "Whose inputs: robot, platform, arm or an arm's name.", default="robot"),
    samples: str = option(
        "N|NxM", "Samples along each axis, or along the first and the second.", default="300"
    ),
    time: float | None = option("S", "Instant, s.", show="0, or a run's first"),
    alpha: float = option("A", "Share of the arm in the measure weighted, from 0 to 1.", default=0.5),
    weight: list[str] | None = option(
        "NAME=VALUE",
        "Weight of an input or a group (platform, arm): 4 counts as half as fast. May be repeated.",
        show="1",
    ),
    length: float | None = LENGTH,
    out: Annotated[Path | None, out_option("runs/<subject>-map")] = None,
    loading: Loading,
    figures: Figures,
) -> None:
    """Map singularity and manipulability over two coordinates or a plane of the workspace.

    Figures show the measure in colour and, over it, where the robot is singular and where its arm alone would
    be; a table says where the smallest and the largest values are.

    \b
    nmm map unicycle_2r --task position:ee:xy --over q1,q2
    nmm map unicycle_2r --task position:ee:xy --task heading:link2 --set d=0 --over q1,q2
    nmm map my_robot.urdf --task pose --over elbow_joint,wrist_2_joint --range elbow_joint=-pi/2:pi/2
    nmm map unicycle_3r --task position --workspace xz --measure weighted,inverse_condition --alpha 0.3

    The folder holds map.npz (axes, values, rank, singular lines and points), map.json (what was computed)
    and a figure a measure.
    """
    from nmm.analysis.maps.coordinates import check_held, singularity_map
    from nmm.analysis.maps.workspace import check_given, workspace_map
    from nmm.cli.subjects import coordinates_at, studied
    from nmm.views.folders.map import is_map
    from nmm.views.folders.whole import check_folder

    drawn = figures.options()
    counts = counts_of(samples)
    bounds = values_of(ranges, "--range", "NAME=LOWER:UPPER, as in q1=-pi:pi", range_of)
    if workspace is None:
        needs, strange = "--workspace PLANE", {"--frame": frame, "--height": height}
    else:
        needs, strange = "a map over two coordinates, without --workspace", {"--over": over}
        expect(len(set(counts)) == 1, "--samples", f"one number with --workspace, got {samples}")
    wrong = [name for name, value in strange.items() if value is not None]
    expect(not wrong, ", ".join(wrong), f"with {needs}")
    what = studied(subject.subject, t=time, **subject.keywords(), **loading.keywords())
    folder = out or Path("runs") / f"{what.name}-map"
    check_folder(folder, is_map)
    common: dict[str, Any] = {
        "ranges": bounds,
        "measures": names_of(measure, "--measure"),
        "part": part,
        "at": what.q,
        "t": what.t,
        "alpha": alpha,
        "weights": values_of(weight, "--weight", "NAME=VALUE, as in platform=4") or None,
        "length": length,
    }
    coordinates = coordinates_at(what.robot, subject.at)
    with progress(f"map of {what.name}") as common["progress"]:
        if workspace is None:
            arm = what.robot.u_names[what.robot.platform.p :]
            usual = arm if len(arm) >= 2 else what.robot.q_names
            names = list(usual[:2]) if over is None else names_of(over, "--over")
            check_held(coordinates, names, "--at")
            made = singularity_map(what.subject, names, samples=counts, **common)
        else:
            check_given(coordinates, what.subject, frame, what.q, "--at")
            slab = None if height is None else range_of(height, "--height")
            made = workspace_map(
                what.subject, frame, plane=workspace, height=slab, samples=counts[0], **common
            )
    made.save(folder, figures=drawn)
    show_map(made, folder)


def show_map(made: Map, folder: Path) -> None:
    rows = [row for name in made.values for row in _measure_rows(made, name)]
    show_table(
        ["measure", "smallest", "at", "largest", "at ", "unit"],
        rows,
        title=f"{made.about.robot}: {', '.join(made.about.task)}",
        numeric=["smallest", "largest"],
    )
    others = [(f"{made.about.part} singular", _found(made, made.singular))]
    if made.arm_singular is not None:
        others.append(("arm alone singular", _found(made, made.arm_singular)))
    if made.kind == "workspace":
        others.append(("reached", f"{(made.rank >= 0).mean():.0%} of {made.rank.size} cells"))
    show_table(["", ""], [*others, ("files in", str(folder))])


def _measure_rows(made: Map, name: str) -> Iterator[list[str]]:
    """One row; of a workspace one of the best and one of the worst postures."""
    from nmm.analysis.maps.measures import MEASURES

    layers = {"": False} if made.kind == "coordinates" else {", best": False, ", worst": True}
    # Of the best postures no singular place is known: between the cells a value may be worse yet.
    low = "smallest" if MEASURES[name].better > 0.0 else "largest"
    for layer, worst in layers.items():
        between = " (of the cells only)" if made.kind == "workspace" and not worst else ""
        row = [name + layer]
        for end, (value, where, on) in made.extremes(name, worst=worst).items():
            place = ", ".join(f"{axis} = {x:.4g}" for axis, x in zip(made.names, where, strict=True))
            row += [f"{value:.4g}", on or place + (between if end == low else "")]
        yield [*row, made.about.units[name] or "-"]


def _found(made: Map, singular: SingularSet) -> str:
    """Lines, and how many points; in a workspace these are of some postures drawn, not of all."""
    sampled = made.kind == "workspace" and len(singular.points) > 0
    return singular.text() + (", of postures drawn" if sampled else "")


def counts_of(text: str) -> tuple[int, int]:
    """ "500" or "300x200"."""
    words = text.lower().split("x")
    whole = len(words) <= 2 and all(word.strip().isdecimal() for word in words)
    expect(whole, "--samples", "a whole number, or two as in 300x200", text)
    return int(words[0]), int(words[-1])


def range_of(text: str, where: str = "") -> tuple[float, float]:
    """LOWER:UPPER, each arithmetic with pi."""
    from nmm.scenario.numbers import evaluate

    words = text.split(":")
    expect(len(words) == 2, where, "LOWER:UPPER, as in -pi:pi", text)
    try:
        lower, upper = map(evaluate, words)
    except InputError as error:
        raise error.at(where) from None
    return lower, upper
