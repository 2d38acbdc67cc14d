"""The hunt: hostile and random input of every kind, with Hypothesis. `python -m tests.fuzz --minutes 30`.

hunting   what a hunt is, how long it goes, what is kept of a failure
mutants   plain data, text and bytes with something changed in them
the hunts themselves: scenarios, robots, xacros, meshes, folders, caches, commands, films, problems

A case is plain data, so that it can be kept as a file and tried again: `kept/HUNT-….json`.
"""

from . import caches, commands, films, folders, meshes, problems, robots, scenarios, xacros

ALL = (scenarios, robots, xacros, meshes, folders, caches, commands, films, problems)
HUNTS = {module.HUNT.name: module.HUNT for module in ALL}
