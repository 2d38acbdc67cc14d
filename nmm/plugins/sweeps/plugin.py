"""The plugin for sweeps: a scenario run many times, over ranges of its keys."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "sweeps",
    commands={"sweep": "nmm.plugins.sweeps.cli:sweep"},
    after={"sweep": "torques"},
    folders={"sweep": "nmm.plugins.sweeps.folder:is_sweep"},
)
