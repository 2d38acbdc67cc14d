"""gallery."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nmm.cli.options import names_of
from nmm.cli.output import complain, progress, show_table

OK, FAILED = 0, 1


def gallery(
    *,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write, as for `nmm run`.")] = Path(
        "gallery"
    ),
    only: Annotated[
        str | None,
        typer.Option(metavar="NAME,NAME,...", help="Some of the scenarios.", show_default="all of them"),
    ] = None,
) -> int:
    """Show every bundled scenario on one page.

    \b
    nmm gallery
    nmm gallery --only unicycle_2r_position,tiago_shelf --out two

    Open index.html in the folder: of each scenario a picture, a page that plays it, numbers and its file. All
    of them take about a minute. Exit status 1 when one could not be run to its end; its card says why.
    """
    from nmm.folders.whole import check_folder
    from nmm.gallery.write import checked, is_gallery, write_gallery

    names = checked(None if only is None else names_of(only, "--only"), "--only")
    check_folder(out, is_gallery)
    with progress(f"{len(names)} scenarios") as report:
        made = write_gallery(out, names, progress=report)
    show_table(
        ["scenario", "outcome", "what it shows"],
        [[card.name, card.outcome, card.title] for card in made.cards],
    )
    show_table(["", ""], [["open", str(made.index)]])
    failed = [card for card in made.cards if not card.ran]
    for card in failed:
        complain("nmm gallery", f"{card.name} {card.outcome}: {card.message}")
    return FAILED if failed else OK
