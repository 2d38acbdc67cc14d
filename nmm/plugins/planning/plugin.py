"""The plugin that plans motions: the task `parking`, the command `nmm plan` and the scenario's key `plan`."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "planning",
    kinds={"task": {"parking": "nmm.plugins.planning.parking:Parking"}},
    commands={"plan": "nmm.plugins.planning.cli:plan"},
    after={"plan": "compare"},
    sections={"plan": "nmm.plugins.planning.section:PlanSection"},
)
