"""The plugin for robots: loops at a robot's pace, odometry, and logs of ROS 2's messages."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "robot",
    commands={"export": "nmm.plugins.robot.cli:export"},
    after={"export": "render"},
    options={"compare": "nmm.plugins.robot.cli:LogOptions"},
    findings=("nmm.plugins.robot.findings:WORDS", "nmm.plugins.robot.bag_findings:WORDS"),
)
