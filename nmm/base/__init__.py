"""What every room stands on: errors, findings, kinds, files, and the kernels with what compiles them.

Nothing here knows a robot, a task or a scenario.
"""
