"""The command `nmm map`, with its options and its help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nmm.cli.groups import Loading, Subject, command
from nmm.cli.options import LengthOption, out_option


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
) -> int:
    """Map singularity and manipulability over two coordinates or a plane of the workspace.

    Figures show the measure in colour and, over it, where the robot is singular and where its arm alone would
    be; a table says where the smallest and the largest values are.

    \b
    nmm map unicycle_2r --task position:ee:xy --over q1,q2
    nmm map unicycle_2r --task position:ee:xy --task heading:link2 --set d=0 --over q1,q2
    nmm map my_robot.urdf --task pose --over elbow_joint,wrist_2_joint --range elbow_joint=-pi/2:pi/2
    nmm map unicycle_3r --task position --workspace xz --measure weighted,inverse_condition --alpha 0.3

    The folder holds map.npz (axes, values, rank, singular lines and points), map.json (what was computed)
    and a PNG a measure.
    """
    from nmm.cli.map_files import make_map

    return make_map(
        subject.subject,
        over=over,
        ranges=ranges,
        workspace=workspace,
        frame=frame,
        height=height,
        measures=measure,
        part=part,
        samples=samples,
        t=time,
        alpha=alpha,
        weights=weight,
        length=length,
        out=out,
        **subject.keywords(),
        **loading.keywords(),
    )
