"""What this package adds to nmm, its words and its command; every `nmm` loads this file, so it is light."""

from typing import Annotated

import typer

from nmm.extending import Plugin

PLUGIN = Plugin(
    "patrol",
    kinds={"resolver": {"least_norm": "nmm_patrol.patrol:LeastNorm"}},
    sections={"patrol": "nmm_patrol.patrol:Patrol"},
    commands={"patrol": "nmm_patrol.plugin:patrol"},
    after={"patrol": "run"},
    findings=("nmm_patrol.plugin:WORDS",),
)

WORDS = {
    "patrol_unfinished": (
        "at t = {t:.4g} s the patrol ends, after {visited} of {places} places: it takes {needed:g} s"
    )
}


def patrol(scenario: Annotated[str, typer.Argument(help="A YAML file with the key patrol.")]) -> None:
    """Say when a patrol is where."""
    import nmm

    section = nmm.Scenario.load(scenario).parts.section("patrol")
    if section is None:
        raise nmm.InputError(where=scenario, expected="the key patrol")
    for t, place in zip(section.times, section.places, strict=True):
        print(f"{t:g} s  {place}")
