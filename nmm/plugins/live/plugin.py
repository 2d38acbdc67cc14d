"""The plugin with live pages: runs played, robots seen and driven in a browser, and videos."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "live",
    commands={name: f"nmm.plugins.live.cli:{name}" for name in ("play", "render", "view", "drive")},
    after={"play": "paper", "render": "play", "view": "check", "drive": "view"},
)
