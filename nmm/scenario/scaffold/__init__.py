"""First scenarios: from a robot's file to a scenario that runs, with a comment on every key."""

from nmm.scenario.scaffold.draft import Draft, first_scenario

__all__ = ["Draft", "first_scenario"]
