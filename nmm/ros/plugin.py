"""The plugin for robots: loops at a robot's pace, odometry, and logs of ROS 2's messages."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "robot",
    commands={"export": "nmm.cli.logs:export"},
    after={"export": "render"},
    options={"compare": "nmm.cli.logs:LogOptions"},
    findings=("nmm.findings.loop:WORDS", "nmm.findings.bag:WORDS"),
)
