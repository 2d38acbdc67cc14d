"""Scenarios: YAML files that say which robot does which task, and how. One class, `Scenario`.

    numbers    numbers and arithmetic with pi, as written in a file or after `--set`
    document   YAML read strictly, with the line of every key, and `--set` applied to it
    keys       what a part of a scenario is, and errors that know their key
    function_part, robot_functions, motions, functions    the keys of functions: of the robot, of time, all
    robot, tasks, objectives, resolvers, schema    the other keys, and the objects that they make
    reference  the keys as text
    scenario   `Scenario`: load, override, run

Reading a scenario imports neither Pinocchio nor numba; making its robot or controller does.
"""

from nmm.scenario.scenario import Scenario

__all__ = ["Scenario"]
