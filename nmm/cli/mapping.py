"""The command `nmm map`, with its options and its help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from nmm.cli.groups import Figures, Loading, Subject, command
from nmm.cli.options import LengthOption, names_of, out_option, values_of
from nmm.cli.output import progress
from nmm.errors import InputError
from nmm.folders.whole import check_folder


@command
def map_measures(
    subject: Subject,
    *,
    over: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="The two coordinates of the map's axes.",
            show_default="the arm's first two, or the first two",
        ),
    ] = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--range",
            metavar="NAME=LOWER:UPPER",
            help="Range of a coordinate, m or rad; in a workspace of an arm's joint. Arithmetic with pi will "
            "do. May be repeated.",
            show_default="its limits, of an angle at most one turn",
        ),
    ] = None,
    workspace: Annotated[
        str | None,
        typer.Option(
            metavar="xy|xz|yz",
            help="Map a plane of the workspace instead: best and worst over the arm's postures that put the "
            "frame there, the platform standing at --at.",
        ),
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(
            metavar="FRAME", help="With --workspace: the frame mapped.", show_default="that of the task"
        ),
    ] = None,
    height: Annotated[
        str | None,
        typer.Option(
            metavar="LOWER:UPPER",
            help="With --workspace: only postures with the frame's third coordinate in here, m.",
            show_default="all, projected onto the plane",
        ),
    ] = None,
    measure: Annotated[
        str,
        typer.Option(
            metavar="NAME,...",
            help="Some of sigma_min, inverse_condition, manipulability, arm_manipulability, "
            "platform_manipulability, weighted, eccentricity.",
        ),
    ] = "sigma_min",
    part: Annotated[
        str, typer.Option(metavar="NAME", help="Whose inputs: robot, platform, arm or an arm's name.")
    ] = "robot",
    samples: Annotated[
        str,
        typer.Option(metavar="N|NxM", help="Samples along each axis, or along the first and the second."),
    ] = "300",
    time: Annotated[
        float | None,
        typer.Option("--time", metavar="S", help="Instant, s.", show_default="0, or a run's first"),
    ] = None,
    alpha: Annotated[
        float, typer.Option(metavar="A", help="Share of the arm in the measure weighted, from 0 to 1.")
    ] = 0.5,
    weight: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Weight of an input or a group (platform, arm): 4 counts as half as fast. May be repeated.",
            show_default="1",
        ),
    ] = None,
    length: LengthOption = None,
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
    from nmm.cli.map_files import counts_of, range_of, ranges_of, refuse, show_map, two_first
    from nmm.cli.subjects import coordinates_at, studied
    from nmm.folders.map import is_map

    drawn = figures.options()
    counts, bounds = counts_of(samples), ranges_of(ranges)
    if workspace is None:
        refuse({"--frame": frame, "--height": height}, "--workspace PLANE")
    else:
        refuse({"--over": over}, "a map over two coordinates, without --workspace")
        if len(set(counts)) > 1:
            raise InputError(f"--samples: expected one number with --workspace, got {samples}")
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
    given = coordinates_at(what.robot, subject.at)
    with progress(f"map of {what.name}") as common["progress"]:
        if workspace is None:
            names = two_first(what.robot) if over is None else names_of(over, "--over")
            check_held(given, names, "--at")
            made = singularity_map(what.subject, names, samples=counts, **common)
        else:
            check_given(given, what.subject, frame, what.q, "--at")
            slab = None if height is None else range_of(height, "--height")
            made = workspace_map(
                what.subject, frame, plane=workspace, height=slab, samples=counts[0], **common
            )
    made.save(folder, figures=drawn)
    show_map(made, folder)
