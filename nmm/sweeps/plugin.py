"""The plugin for sweeps: a scenario run many times, over ranges of its keys."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "sweeps",
    commands={"sweep": "nmm.cli.sweeping:sweep"},
    after={"sweep": "torques"},
    folders={"sweep": "nmm.sweeps.folder:is_sweep"},
)
