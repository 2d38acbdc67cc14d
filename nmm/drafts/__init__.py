"""First scenarios: from a robot's file to a scenario that runs, with a word on every key.

hand     which frame is led along a path: the end of the longest chain of joints
start    where the robot starts: within limits, away from singularities
parts    which robot: as it is in its file, or on a base
paths    what the hand can be asked to follow, the most likely to work first
text     the scenario as YAML with comments
draft    all of it, tried out
"""

from nmm.drafts.draft import Draft, first_scenario

__all__ = ["Draft", "first_scenario"]
