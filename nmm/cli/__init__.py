"""The command line, `nmm`: what comes in, what goes out, and the exit status.

    exit_status     errors as lines, and the exit status
    app             the commands about runs with their options and help
    robot_commands  likewise those about robots, and the listings
    singularities, mapping, redundancy   likewise those that analyse: singularities, map, redundancy and laps
    options         options that several commands have, and what their texts mean
    subjects        what an analysis is about: a robot with a task, a scenario, a run
    runs            run, compare, paper, play
    gallery         gallery
    descriptions    info
    checking        check
    viewing         view
    driving         drive
    rendering       render
    listings        scenarios, robots
    singularity_*, symbolic_*, searching   what `singularities` prints
    map_files       map
    redundancy_tables, laps              redundancy, laps
    report          the numbers of a run, as a table
    interrupts      Ctrl-C, and when it is not taken
    output          tables, warnings and progress, on a terminal and in a pipe

Commands import what they need when they run: `nmm --help` is quick.
"""

from nmm.cli.exit_status import main

__all__ = ["main"]
