"""The command line, `nmm`: `app` lists the commands; `exit_status` maps errors to lines and exit statuses.

Commands import what they need when they run, so that `nmm --help` is quick.
"""

from nmm.cli.exit_status import main

__all__ = ["main"]
