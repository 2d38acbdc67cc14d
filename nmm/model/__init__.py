"""A robot by itself: platform, kinematics, dynamics, distances between shapes, and how a file becomes one.

Nothing here knows a task, a limit on inputs or time.
"""
