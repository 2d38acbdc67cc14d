"""The plugin that plans motions: the task `parking`, the command `nmm plan` and the scenario's key `plan`."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "planning",
    kinds={"task": {"parking": "nmm.plans.parking:Parking"}},
    commands={"plan": "nmm.cli.planning:plan"},
    after={"plan": "compare"},
    sections={"plan": "nmm.plans.section:PlanSection"},
)
