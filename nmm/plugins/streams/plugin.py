"""The plugin with streams: runs and loops shown by other tools, live and recorded."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "streams",
    options={"run": "nmm.plugins.streams.cli:StreamOptions"},
)
