"""The command line, `nmm`: what comes in, what goes out, and the exit status.

    app             the commands about runs with their options and help; errors and exit status
    robot_commands  likewise those about robots, and the listings
    options         options that several commands have, and what their texts mean
    runs            run, compare, paper, play
    descriptions    info
    checking        check
    viewing         view
    listings        scenarios, robots
    report          the numbers of a run, as a table
    output          tables, warnings and progress, on a terminal and in a pipe

Commands import what they need when they run: `nmm --help` is quick.
"""

from nmm.cli.app import main

__all__ = ["main"]
