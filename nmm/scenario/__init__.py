"""Scenarios: YAML files that say which robot does which task, and how. One class, `Scenario`.

numbers    numbers and arithmetic with pi, as written in a file or after `--set`
document   YAML read strictly, with the line of every key, and `--set` applied to it
keys       what a part of a scenario is, and errors that know their key
constructors, spelling    what a class of the library takes, and how a file spells it
made_part  a part that is the call of a constructor: most are made from the lists in `nmm.kinds`
function_part, special_references, functions    functions, of the robot and of time
named_reference   a task's reference in the place of another, by its path
tasks, objectives, resolvers, robot, schema    the other keys, and the objects that they make
reference  the keys as text
short_task tasks as people type them on the command line
scenario   `Scenario`: load, override, run
"""

from nmm.scenario.scenario import Scenario

__all__ = ["Scenario"]
