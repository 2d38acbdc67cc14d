"""The plugin for robots: loops at their pace, odometry, logs of ROS 2's messages, numbers from logs."""

from nmm.base.plugins import Plugin

PLUGIN = Plugin(
    "robot",
    commands={
        "export": "nmm.plugins.robot.cli:export",
        "calibrate": "nmm.plugins.robot.calibration.cli:calibrate",
    },
    after={"export": "render", "calibrate": "check"},
    options={"compare": "nmm.plugins.robot.cli:LogOptions"},
    folders={"calibration": "nmm.plugins.robot.calibration.report:is_calibration"},
    findings=(
        "nmm.plugins.robot.findings:WORDS",
        "nmm.plugins.robot.bag_findings:WORDS",
        "nmm.plugins.robot.calibration.findings:WORDS",
        "nmm.plugins.robot.calibration.log_findings:WORDS",
        "nmm.plugins.robot.calibration.arm.findings:WORDS",
    ),
)
