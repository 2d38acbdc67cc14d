"""Scenarios: YAML files that state which robot does which task, and how. One class, `Scenario`."""

from nmm.scenario.scenario import Scenario

__all__ = ["Scenario"]
