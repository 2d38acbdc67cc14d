"""The command line, `nmm`: what comes in, what goes out, and the exit status.

    app          the commands, their options and their help
    runs         run, compare, paper, play
    descriptions info, scenarios, robots
    report       the numbers of a run, as a table
    output       tables, warnings and progress, on a terminal and in a pipe

Commands import what they need when they run: `nmm --help` is quick.
"""

from nmm.cli.app import main

__all__ = ["main"]
